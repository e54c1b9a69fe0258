"""What perception costs: the bare detector call, corner refinement, pose, predicted window against whole frame.

Run: python bench/detector.py [--repeats N]
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "unit" / "perception"))

from perception_render import look_down, render  # noqa: E402

from companion.geometry.transform import RigidTransform  # noqa: E402
from companion.messages.perception import CameraFrame  # noqa: E402
from companion.perception.camera_model import CameraModel  # noqa: E402
from companion.perception.detector import AprilTagFinder, ArucoFinder  # noqa: E402
from companion.perception.edge_refinement import refine_corners  # noqa: E402
from companion.perception.pad_detector import PadDetector, PerceptionParameters, find_in_window  # noqa: E402
from companion.perception.pad_file import load_pad  # noqa: E402
from companion.perception.pad_pose import solve_pad_pose  # noqa: E402
from companion.perception.window import predict_window  # noqa: E402

PAD = ROOT / "config" / "pads" / "landing_pad_0p8.yaml"
HEIGHTS = (0.2, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0)  # [m]
COLUMNS = ("window", "tags", "aruco", "refine", "pose", "total", "apriltag", "aruco", "total")


def milliseconds(call: Callable[[], object], repeats: int) -> float:
    """Median processor time of a call [ms]."""
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * statistics.median(times)


def textured(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Put a rough ground where the renderer left it plain."""
    ground = cv2.GaussianBlur(rng.normal(0.0, 60.0, picture.shape), (0, 0), 1.5)
    plain = np.abs(picture.astype(np.float64) - 110.0) < 12.0
    return np.clip(picture + np.where(plain, ground, 0.0), 0, 255).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    repeats = parser.parse_args().repeats
    cv2.setNumThreads(1)
    lens = np.array([-0.12, 0.03, 0.0005, -0.0004, 0.0])
    camera = CameraModel(width=640, height=480, fx=460.0, fy=460.0, cx=319.5, cy=239.5, distortion=lens)
    pad = load_pad(PAD)
    tags = [(tag.id, tag.size, tag.x, tag.y, tag.heading) for tag in pad.tags]
    parameters = PerceptionParameters()
    detector = PadDetector(pad, camera, parameters)
    aruco, apriltag = ArucoFinder(pad.ids), AprilTagFinder(pad.ids)
    rng = np.random.default_rng(1)
    print("processor time in ms, median; 640x480, one thread, 12-tag pad on rough ground, camera at `height` m")
    print(f"{'':6} | {'predicted window':^49} | {'whole frame':^26}")
    print(
        f"{'height':6} | "
        + " ".join(f"{c:>{9 if c == 'window' else 7}}" for c in COLUMNS[:6])
        + " | "
        + " ".join(f"{c:>8}" for c in COLUMNS[6:])
    )
    for height in HEIGHTS:
        pose = look_down(height, tilt=0.1, axis=1.0, turn=0.5)
        image = render(tags, pose, camera.matrix, lens, blur=0.6, noise=3.0, rng=rng, samples=3)
        frame = CameraFrame(t=0.0, t_arrival=0.0, sequence=0, image=textured(image, rng))
        predicted = RigidTransform(rotation=pose[0], translation=pose[1])
        window = predict_window(pad, camera, predicted, parameters.window)
        assert window is not None
        found = find_in_window(frame.image, window, aruco)
        corners = np.stack([tag.corners for tag in found])
        seen = detector.observe(frame, predicted)
        row = [
            milliseconds(lambda f=frame, w=window: find_in_window(f.image, w, aruco), repeats),
            milliseconds(
                lambda f=frame, c=corners: refine_corners(f.image, c, camera=camera, parameters=parameters.edges),
                repeats,
            ),
            milliseconds(lambda s=seen: solve_pad_pose(pad, s.detections, camera, parameters.pose), repeats),
            milliseconds(lambda f=frame, p=predicted: detector.observe(f, p), repeats),
        ]
        whole = [
            milliseconds(lambda f=frame: apriltag.find(f.image, smallest_side=0.0), repeats),
            milliseconds(lambda f=frame: aruco.find(f.image, smallest_side=0.0), repeats),
            milliseconds(lambda f=frame: detector.observe(f, None), repeats),
        ]
        size = f"{window.right - window.left}x{window.bottom - window.top}"
        print(
            f"{height:6.1f} | {size:>9} {len(found):7d} "
            + " ".join(f"{v:7.2f}" for v in row)
            + " | "
            + " ".join(f"{v:8.2f}" for v in whole)
        )


if __name__ == "__main__":
    main()
