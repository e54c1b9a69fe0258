"""From light to grey values: lens blur, vignetting, shot and read noise, and spoilt pictures."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from sitl_stub.world.camera import CameraConfig

Image = npt.NDArray[np.uint8]
Picture = npt.NDArray[np.float32]

_BANK_MARGIN = 256  # [px] room to shift the stored noise
_PIXEL_SPREAD = 0.005  # standard deviation of the pixels' sensitivity
_BANK_SEED = 7


@lru_cache(maxsize=2)
def _noise_bank(rows: int, columns: int) -> Picture:
    bank = np.random.default_rng(_BANK_SEED).standard_normal((rows, columns), dtype=np.float32)
    bank.setflags(write=False)
    return bank


class Photosensor:
    """Turns light into a grey picture."""

    def __init__(self, config: CameraConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        shape = (config.intrinsics.height, config.intrinsics.width)
        self._bank = _noise_bank(shape[0] + _BANK_MARGIN, shape[1] + _BANK_MARGIN)
        spread = 1.0 + _PIXEL_SPREAD * rng.standard_normal(shape, dtype=np.float32)
        self._sensitivity: Picture = (spread * self._lens_shading(config)).astype(np.float32)
        self._sigma: Picture = np.empty(shape, dtype=np.float32)

    @staticmethod
    def _lens_shading(config: CameraConfig) -> Picture:
        """Give 1 in the middle, falling with the square of the distance to 1 - vignetting in the corners."""
        lens = config.intrinsics
        v, u = np.mgrid[0 : lens.height, 0 : lens.width]
        squared = (u - lens.cx) ** 2 + (v - lens.cy) ** 2
        shading: Picture = (1.0 - config.vignetting * squared / squared.max()).astype(np.float32)
        return shading

    def develop(self, light: Picture, uneven: Picture, exposure: float, *, bad: bool) -> Image:
        """Give the grey picture.

        `light` and `uneven` (height, width) are multiplied, then by `exposure`. Noise variance [grey levels^2]:
        `read_noise^2 + level * 255 / full_well`. `bad` spoils the picture: glare, darkness or a torn transfer.
        """
        rng = self._rng
        kind = int(rng.integers(3)) if bad else -1
        exposure *= {0: 6.0, 1: 0.03}.get(kind, 1.0)
        if self._config.lens_blur > 0.0:
            light = np.asarray(cv2.GaussianBlur(light, (0, 0), self._config.lens_blur), dtype=np.float32)
        level = np.asarray(cv2.multiply(light, uneven, scale=exposure), dtype=np.float32)
        cv2.multiply(level, self._sensitivity, dst=level)
        np.multiply(level, np.float32(255.0 / self._config.full_well), out=self._sigma)
        self._sigma += np.float32(self._config.read_noise**2)
        np.sqrt(self._sigma, out=self._sigma)
        row, column = (int(offset) for offset in rng.integers(_BANK_MARGIN, size=2))
        rows, columns = level.shape
        cv2.multiply(self._sigma, self._bank[row : row + rows, column : column + columns], dst=self._sigma)
        grey = cv2.add(level, self._sigma, dtype=cv2.CV_8U)
        image: Image = np.asarray(grey, dtype=np.uint8)
        if kind == 2:
            image[int(rng.integers(rows)) :] = 0
        return image
