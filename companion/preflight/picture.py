"""How good a picture is: exposure and sharpness."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from companion.geometry.arrays import Image

_DARK, _BRIGHT = 5, 250  # grey levels at the ends of the range
_LOW_PASS = 11  # [px] of the second blur, as in the source


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureQuality:
    """What one picture is like."""

    mean: float  # grey level, 0..255
    contrast: float  # standard deviation of the grey levels
    dark: float  # share of pixels that are black, 0..1
    bright: float  # share of pixels that are burnt out, 0..1
    blur: float  # 0 sharp .. 1 without any detail


def picture_quality(image: Image) -> PictureQuality:
    """Measure a grey picture (height, width)."""
    mean, deviation = cv2.meanStdDev(image)
    return PictureQuality(
        mean=float(mean[0, 0]),
        contrast=float(deviation[0, 0]),
        dark=float(np.mean(image <= _DARK)),
        bright=float(np.mean(image >= _BRIGHT)),
        blur=blur_effect(image),
    )


def blur_effect(image: Image) -> float:
    """Give how blurred a picture is, whatever its contrast: 0 sharp, 1 blurred.

    A picture is blurred once more, strongly. A sharp one loses most of its differences between neighbours, a blurred
    one hardly any:

        blur = 1 - sum max(0, |dF| - |dB|) / sum |dF|,   the worse of both axes,

    F the picture, B the picture blurred along the axis, d the difference of neighbours.
    Source: F. Crete, T. Dolmiere, P. Ladret, M. Nicolas, "The blur effect: perception and estimation with a new
    no-reference perceptual blur metric", SPIE 2007. The noise of the sensor is taken out first by a mean of 3 x 3.
    """
    calm = cv2.blur(image.astype(np.float32), (3, 3))
    return max(_blur_along(calm, axis) for axis in (0, 1))


def _blur_along(image: np.ndarray, axis: int) -> float:
    size = (1, _LOW_PASS) if axis == 0 else (_LOW_PASS, 1)
    fine = np.abs(np.diff(image, axis=axis))
    coarse = np.abs(np.diff(cv2.blur(image, size), axis=axis))
    total = float(fine.sum())
    if total <= 0.0:
        return 1.0
    return 1.0 - float(np.maximum(0.0, fine - coarse).sum()) / total
