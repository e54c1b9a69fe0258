"""Fits the simulator's fast camera (tag corners) to its rendered camera, seen through the companion's detector.

    python bench/fit_corners_camera.py [--frames 3000] [--seed 1] [--write]

Renders pads in many poses and motions, detects the tags the way a flight does (in a window predicted 3 cm wrong, then
the whole picture), compares with the exact projection and fits noise, misses and outliers. Prints the table of the
pictures beside that of the fast camera; `--write` puts the numbers into `sitl_stub/world/corners.yaml`.
"""

from __future__ import annotations

import argparse
import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, minimize
from scipy.special import digamma, polygamma

from companion.geometry.transform import RigidTransform
from companion.messages.perception import CameraFrame
from companion.perception.calibration_file import load_calibration
from companion.perception.pad_detector import PadDetector, PerceptionParameters
from companion.perception.pad_file import load_pad as load_companion_pad
from sitl_stub.truth import TargetTruth, Truth, VehicleTruth
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.world.camera import CameraConfig
from sitl_stub.world.corners import FEATURES, BoardView, CornersImager, CornersModel, TagView
from sitl_stub.world.exposure import Exposure, Scene
from sitl_stub.world.light import Light, LightConfig
from sitl_stub.world.pads import find_pad, load_pad
from sitl_stub.world.photosensor import Photosensor
from sitl_stub.world.renderer import Renderer
from sitl_stub.world.world import RenderedImager, World

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PAD = "landing_pad_0p8"
PREDICTION_SIGMA = 0.03  # [m] error of the predicted window
OUTLIER_SPREADS = 3.0  # of the logarithm of a tag's noise: beyond, it counts as an outlier
# A tag's rms over 8 coordinates of unit noise: mean and variance of its logarithm (chi distribution)
LOG_RMS_MEAN = 0.5 * float(digamma(4.0) + math.log(2.0) - math.log(8.0))
LOG_RMS_VARIANCE = 0.25 * float(polygamma(1, 4.0))
FRAMES_PER_LIGHT = 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """What a camera found, tag by tag. Tags whose corners all lie more than 10 px outside are left out."""

    features: Array  # (n, FEATURES)
    side: Array  # (n,) [px]
    border: Array  # (n,) [px]
    found: npt.NDArray[np.bool_]  # (n,)
    rejected: npt.NDArray[np.bool_]  # (n,) found, but in contradiction to the others
    exact: Array  # (n, 4, 2) [px]
    error: Array  # (n, 4, 2) [px] found minus exact; NaN where not found or rejected
    frame: npt.NDArray[np.int_]  # (n,)

    def part(self, chosen: npt.NDArray[np.bool_]) -> Sample:
        """Give the chosen tags."""
        return Sample(
            features=self.features[chosen],
            side=self.side[chosen],
            border=self.border[chosen],
            found=self.found[chosen],
            rejected=self.rejected[chosen],
            exact=self.exact[chosen],
            error=self.error[chosen],
            frame=self.frame[chosen],
        )


def random_exposure(rng: np.random.Generator, camera: CameraConfig, world: World) -> Exposure:
    """Draw a flight-like view: 0.15 m to 6 m above the pad, pad anywhere in the picture, tilted, turning, moving."""
    height = 0.15 * 40.0 ** float(rng.random())  # [m] lens above the pad
    yaw, pad_yaw = rng.uniform(-math.pi, math.pi, 2)
    roll, pitch = np.clip(math.radians(6.0) * rng.standard_normal(2), -0.45, 0.45)
    reach = height * np.array([0.50, 0.38]) * rng.uniform(-1.0, 1.0, 2)  # aims at a part of the pad, sideways and ahead
    aim = rng.uniform(-0.3, 0.3, 2) * min(1.0, height)
    ahead, right = reach[1] + math.tan(pitch) * height, reach[0] - math.tan(roll) * height
    north = -(math.cos(yaw) * ahead - math.sin(yaw) * right) + aim[0]
    east = -(math.sin(yaw) * ahead + math.cos(yaw) * right) + aim[1]
    hurry = 4.0 if rng.random() < 0.25 else 1.0
    rates = 0.35 * hurry * rng.standard_normal(3)
    velocity = 0.5 * hurry * min(1.0, height / 1.5) * rng.standard_normal(3)
    pad_velocity = np.append(0.35 * rng.standard_normal(2) * (rng.random() < 0.5), 0.0)
    down = -(height + world.targets[0].height + camera.mount.position_frd[2])
    half = 0.5 * camera.exposure
    states = []
    for t in (-half, half):
        attitude = (roll + t * rates[0], pitch + t * rates[1], yaw + t * rates[2])
        states.append(
            _truth(t, np.array([north, east, down]) + t * velocity, attitude, t * pad_velocity, pad_yaw, world)
        )
    return Exposure(states, -half, half, mount=camera.mount, pads=(world.targets[0].pad,))


def _truth(
    t: float, position: Array, attitude: tuple[float, float, float], pad: Array, pad_yaw: float, world: World
) -> Truth:
    (cr, cp, cy), (sr, sp, sy) = (tuple(f(0.5 * a) for a in attitude) for f in (math.cos, math.sin))
    quaternion = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    vehicle = VehicleTruth(
        t=t,
        position_ned=(float(position[0]), float(position[1]), float(position[2])),
        velocity_ned=(0.0, 0.0, 0.0),
        quaternion=quaternion,
        angular_velocity_frd=(0.0, 0.0, 0.0),
        acceleration_ned=(0.0, 0.0, 0.0),
        feet_in_contact=0,
        surface="",
        armed=True,
    )
    target = TargetTruth(
        t=t,
        name="pad",
        position_ned=(float(pad[0]), float(pad[1]), -world.targets[0].height),
        yaw=pad_yaw,
        velocity_ned=(0.0, 0.0, 0.0),
        yaw_rate=0.0,
        half_size=(0.4, 0.4),
        moving=False,
        started=False,
    )
    return Truth(t=t, vehicle=vehicle, targets=(target,))


def _companion() -> PadDetector:
    pad = load_companion_pad(ROOT / "config" / "pads" / f"{PAD}.yaml")
    return PadDetector(pad, load_calibration(ROOT / "config" / "cameras" / "sim_640x480.yaml"), PerceptionParameters())


def _prediction(scene: Scene, rng: np.random.Generator) -> RigidTransform:
    rotation = scene.ned_from_cam.T @ scene.boards[0].ned_from_board
    offset = scene.ned_from_cam.T @ (scene.boards[0].center_ned - scene.camera_ned)
    return RigidTransform(rotation=rotation, translation=offset + PREDICTION_SIGMA * rng.standard_normal(3))


def sample(frames: int, seed: int, *, rendered: bool, model: CornersModel | None = None) -> Sample:
    """Look at `frames` random views with the rendered camera and the companion's detector, or with the fast camera."""
    views, finds = np.random.default_rng(seed), np.random.default_rng((seed, 1))
    world = World.load("static_pad")
    camera = CameraConfig.from_mapping(VehicleConfig.load("x500").camera)
    pad = load_pad(find_pad(PAD))
    board, detector = BoardView(pad), _companion()
    fast = CornersImager(camera.intrinsics, (pad,), finds, model)
    renderer = Renderer(camera.intrinsics, world.targets, contrast=world.ground_contrast, rng=finds)
    rows: list[tuple[TagView, dict[int, Array], set[int]]] = []
    imager = None
    for number in range(frames):
        exposure = random_exposure(views, camera, world)
        scenes = (exposure.at(exposure.t_open), exposure.at(exposure.t_middle), exposure.at(exposure.t_close))
        view = board.look(camera.intrinsics, scenes, 0)
        if view is None:
            continue
        rejected: set[int] = set()
        if rendered:
            if imager is None or number % FRAMES_PER_LIGHT == 0:
                imager = RenderedImager(renderer, Light(LightConfig(), finds), Photosensor(camera, finds))
            image = imager.capture(exposure, bad=False).image
            assert image is not None
            frame = CameraFrame(t=0.0, t_arrival=0.0, sequence=number, image=image)
            observation, diagnostics = detector.examine(frame, _prediction(scenes[1], finds))
            tags = {tag.id: np.asarray(tag.corners) for tag in observation.detections}
            rejected = set(diagnostics.rejected_ids)
        else:
            tags = dict(fast.capture(exposure, bad=False).tags or ())
        rows.append((view, tags, rejected))
    return _sample(rows)


def _sample(rows: list[tuple[TagView, dict[int, Array], set[int]]]) -> Sample:
    nothing = np.full((4, 2), np.nan)
    everything = Sample(
        features=np.concatenate([view.features for view, _, _ in rows]),
        side=np.concatenate([view.side for view, _, _ in rows]),
        border=np.concatenate([view.border for view, _, _ in rows]),
        found=np.array([i in tags or i in bad for view, tags, bad in rows for i in view.ids]),
        rejected=np.array([i in bad for view, _, bad in rows for i in view.ids]),
        exact=np.concatenate([view.corners for view, _, _ in rows]),
        error=np.array(
            [
                tags[i] - c if i in tags else nothing
                for view, tags, _ in rows
                for i, c in zip(view.ids, view.corners, strict=True)
            ]
        ),
        frame=np.array([k for k, (view, _, _) in enumerate(rows) for _ in view.ids]),
    )
    return everything.part(everything.border > -10.0)


def fit(data: Sample) -> CornersModel:
    """Fit the fast camera's numbers."""
    large = data.part(data.side > 30.0)
    steps = np.arange(0.0, 8.0, 0.5)
    seen = [large.found[(large.border >= b) & (large.border < b + 1.0)] for b in steps]
    border = next((float(b) for b, found in zip(steps, seen, strict=True) if found.size and found.mean() > 0.5), 0.0)
    smallest = float(np.quantile(data.side[data.found], 0.001))
    inside = data.part((data.border >= border) & (data.side >= smallest))
    good = inside.part(inside.found & ~inside.rejected)
    sigma, spread, excess = _fit_sigma(good)
    wild = excess > OUTLIER_SPREADS * math.hypot(spread, math.sqrt(LOG_RMS_VARIANCE))
    tame = good.error[~wild]
    contradicting = int(inside.rejected.sum())
    deviation = np.exp(good.features @ np.array(sigma))
    return CornersModel(
        sigma=sigma,
        sigma_limits=(float(np.quantile(deviation, 0.002)), float(np.quantile(deviation, 0.998))),
        spread=spread,
        miss=_fit_miss(inside),
        common=float(
            np.clip(
                (
                    4.0
                    * _rms(tame.mean(axis=1) / deviation[~wild, None]) ** 2
                    / _rms(tame / deviation[~wild, None, None]) ** 2
                    - 1.0
                )
                / 3.0,
                0.0,
                0.95,
            )
        ),
        outliers=float((wild.sum() + contradicting) / (len(wild) + contradicting)),
        outlier_scale=max(1.0, float(np.exp(excess[wild].mean()))) if wild.any() else 6.0,
        border=border,
        smallest=smallest,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def _fit_miss(data: Sample) -> tuple[float, ...]:
    missed = (~data.found).astype(float)

    def loss(weights: Array) -> float:
        score = data.features @ weights
        return float((np.logaddexp(0.0, score) - missed * score).mean() + 1e-4 * (weights[1:] ** 2).sum())

    return tuple(float(w) for w in minimize(loss, np.zeros(FEATURES), method="BFGS").x)


def _fit_sigma(data: Sample) -> tuple[tuple[float, ...], float, Array]:
    """Fit the logarithm of the tags' noise; gives weights, spread, and what each tag's logarithm is above the fit."""
    logs = 0.5 * np.log((data.error**2).mean(axis=(1, 2))) - LOG_RMS_MEAN

    def miss(weights: Array) -> Array:
        return np.append(data.features @ weights - logs, 1e-2 * math.sqrt(len(logs)) * weights[1:])

    weights = least_squares(miss, np.zeros(FEATURES), loss="soft_l1", f_scale=0.5).x
    excess = logs - data.features @ weights
    width = 0.5 * float(np.quantile(excess, 0.84) - np.quantile(excess, 0.16))
    spread = math.sqrt(max(0.0, width**2 - LOG_RMS_VARIANCE))
    return tuple(float(w) for w in weights), spread, excess


def write(model: CornersModel, path: Path, note: str) -> None:
    """Write the numbers into the simulator's file."""
    rows = [
        "# Fitted by bench/fit_corners_camera.py; what the numbers mean stands in corners.py.",
        f"# {note}",
        f"sigma: [{', '.join(f'{w:.4f}' for w in model.sigma)}]",
        f"sigma_limits_px: [{model.sigma_limits[0]:.4f}, {model.sigma_limits[1]:.4f}]",
        f"spread: {model.spread:.4f}",
        f"miss: [{', '.join(f'{w:.4f}' for w in model.miss)}]",
        f"common_share: {model.common:.4f}",
        f"outlier_share: {model.outliers:.5f}",
        f"outlier_scale: {model.outlier_scale:.3f}",
        f"border_px: {model.border:.2f}",
        f"smallest_px: {model.smallest:.2f}",
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def table(name: str, data: Sample) -> None:
    """Print noise and misses by size of the tag and by blur."""
    inside = data.part(data.border >= 3.0)
    rms = np.sqrt((inside.error**2).mean(axis=(1, 2)))
    print(f"{name}: {len(inside.found)} tags, found {inside.found.mean():.3f}, rejected {inside.rejected.mean():.4f}")
    for label, value, edges in (
        ("side [px]", inside.side, (0, 8, 10, 12, 14, 17, 20, 25, 35, 60, 120, 250, 600)),
        ("motion [modules]", inside.features[:, 3], (0, 0.1, 0.2, 0.4, 0.7, 1.0, 1.4, 2.0, 2.6)),
    ):
        for low, high in itertools.pairwise(edges):
            here = (value >= low) & (value < high) & ((inside.side > 20.0) | (label[0] == "s"))
            if here.sum() >= 20:
                good = rms[here & inside.found & ~inside.rejected]
                noise = f"rms median {np.median(good):.3f} mean {good.mean():.3f}" if good.size else ""
                missed = 1.0 - inside.found[here].mean()
                print(f"  {label} {low:5g}-{high:<5g} n {here.sum():5d} missed {missed:.3f} {noise}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    data = sample(arguments.frames, arguments.seed, rendered=True)
    table("rendered", data)
    model = fit(data)
    print(model)
    table("fitted", sample(arguments.frames, arguments.seed + 1, rendered=False, model=model))
    if arguments.write:
        note = f"{arguments.frames} pictures, seed {arguments.seed}."
        write(model, ROOT / "sitl_stub" / "world" / "corners.yaml", note)


if __name__ == "__main__":
    main()
