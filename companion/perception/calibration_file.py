"""Reads camera calibrations: OpenCV's FileStorage (YAML or JSON) and ROS's camera_info YAML.

Which of the two a file is shows in its keys. Keys that do not describe the lens are ignored, since calibration tools
write many of their own.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from companion.documents import Document, load_document, plain
from companion.errors import InputError, Problem
from companion.geometry.arrays import Array
from companion.perception.camera_model import CameraModel, Distortion

_TAGS = ("tag:yaml.org,2002:opencv-matrix", "tag:yaml.org,2002:opencv-nd-matrix")
_MATRIX_KEYS = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "intrinsic_matrix", "mtx", "k")
_COEFFICIENT_KEYS = (
    "distortion_coefficients",
    "distCoeffs",
    "dist_coeffs",
    "dist_coeff",
    "Distortion_Coefficients",
    "distortion_coeffs",
    "dist",
    "D",
    "d",
)
_WIDTH_KEYS = ("image_width", "image_Width", "width")
_HEIGHT_KEYS = ("image_height", "image_Height", "height")
_SIZE_KEYS = ("image_size", "imageSize", "resolution")
_MODEL_KEYS = ("distortion_model", "camera_model_type")
_MODELS = {
    "plumb_bob": Distortion.PLUMB_BOB,
    "rational_polynomial": Distortion.RATIONAL,
    "equidistant": Distortion.EQUIDISTANT,
    "fisheye": Distortion.EQUIDISTANT,
}
_FIELDS = {"fx": 0, "cx": 2, "fy": 4, "cy": 5}  # place in the matrix, for messages


def load_calibration(path: str | os.PathLike[str]) -> CameraModel:
    """Read a calibration file.

    Raises:
        InputError: it cannot be read, or is not a valid calibration; names every problem.
    """
    return calibration_from_document(load_document(path, tags=_TAGS))


def calibration_from_document(document: Document) -> CameraModel:
    """Build the camera of a parsed calibration file.

    Raises:
        InputError: it is not a valid calibration; names every problem.
    """
    if document.problems:
        raise InputError(document.problems)
    data = plain(document.root)
    reader = _Reader(document, data if isinstance(data, dict) else {})
    if not isinstance(data, dict):
        reader.report((), "the file is not a calibration", "it holds `image_width: 640` and the like")
    width, height = reader.size()
    matrix = reader.matrix()
    coefficients = reader.coefficients()
    model = reader.model(coefficients)
    if reader.problems or matrix is None or coefficients is None or width is None or height is None or model is None:
        raise InputError(reader.problems)
    try:
        return CameraModel(
            width=width,
            height=height,
            fx=float(matrix[0, 0]),
            fy=float(matrix[1, 1]),
            cx=float(matrix[0, 2]),
            cy=float(matrix[1, 2]),
            distortion=coefficients,
            model=model,
        )
    except InputError as error:
        raise InputError([reader.placed(problem) for problem in error.problems]) from None


class _Reader:
    """Finds the parts of a calibration in a document and collects what is wrong."""

    def __init__(self, document: Document, data: Mapping[str, Any]) -> None:
        self.problems: list[Problem] = []
        self._document = document
        self._data = data

    def report(self, path: tuple[str | int, ...], wrong: str, right: str) -> None:
        self.problems.append(self._document.problem(path, wrong=wrong, right=right))

    def placed(self, problem: Problem) -> Problem:
        """Give a problem of the camera model the place of the key it is about."""
        names = {"width": _WIDTH_KEYS, "height": _HEIGHT_KEYS, "distortion": _COEFFICIENT_KEYS}
        candidates = names.get(problem.key, _MATRIX_KEYS)
        key = self._key(candidates) or self._key(_SIZE_KEYS) or ""
        wrong = f"{problem.key} {problem.wrong}" if problem.key in _FIELDS else problem.wrong
        return self._document.problem((key,) if key else (), wrong=wrong, right=problem.right)

    def size(self) -> tuple[int | None, int | None]:
        """Find the picture's width and height."""
        both = self._key(_SIZE_KEYS)
        if both is not None and self._key(_WIDTH_KEYS) is None:
            values = self._numbers(both)
            if values is not None and values.shape == (2,) and np.all(values == np.rint(values)):
                return int(values[0]), int(values[1])
            self.report((both,), f"is {self._data[both]!r}", "give the width and height in pixels, such as [640, 480]")
            return None, None
        return self._whole(_WIDTH_KEYS), self._whole(_HEIGHT_KEYS)

    def matrix(self) -> Array | None:
        """Find the camera matrix (3, 3)."""
        key = self._key(_MATRIX_KEYS)
        if key is None:
            self.report((), "there is no camera matrix", "give `camera_matrix` with 3 rows and 3 columns")
            return None
        values = self._numbers(key)
        if values is None or values.size != 9:
            found = "is not a matrix of numbers" if values is None else f"has {values.size} numbers"
            self.report((key,), found, "give 9 numbers, row by row: fx 0 cx, 0 fy cy, 0 0 1")
            return None
        matrix = values.reshape(3, 3)
        if not np.array_equal(matrix[[1, 2, 2, 2], [0, 0, 1, 2]], [0.0, 0.0, 0.0, 1.0]):
            self.report((key,), "is not a camera matrix", "its rows are fx 0 cx, 0 fy cy, 0 0 1")
            return None
        if matrix[0, 1] != 0.0:
            self.report((key,), f"has the skew {matrix[0, 1]}", "calibrate with zero skew: OpenCV and ROS do")
            return None
        return matrix

    def coefficients(self) -> Array | None:
        """Find the distortion coefficients."""
        key = self._key(_COEFFICIENT_KEYS)
        if key is None:
            self.report(
                (),
                "there are no distortion coefficients",
                "give `distortion_coefficients`, five zeros for a lens without distortion",
            )
            return None
        if isinstance(self._data[key], list) and not self._data[key]:
            return np.zeros(0)
        values = self._numbers(key)
        if values is None:
            self.report((key,), "is not a list of numbers", "give k1, k2, p1, p2, k3")
            return None
        if values.size in (12, 14) and not values.ravel()[8:].any():
            return values.ravel()[:8]
        return values.ravel()

    def model(self, coefficients: Array | None) -> Distortion | None:
        """Find the distortion model; where the file does not name it, the number of coefficients tells."""
        key = self._key(_MODEL_KEYS)
        if key is not None:
            name = str(self._data[key])
            if name not in _MODELS:
                self.report((key,), f"the model {name} is not known", f"known are {', '.join(_MODELS)}")
                return None
            return _MODELS[name]
        if coefficients is not None and coefficients.size == 8:
            return Distortion.RATIONAL
        return Distortion.PLUMB_BOB

    def _key(self, names: tuple[str, ...]) -> str | None:
        return next((name for name in names if name in self._data), None)

    def _whole(self, names: tuple[str, ...]) -> int | None:
        key = self._key(names)
        if key is None:
            self.report((), f"there is no `{names[0]}`", f"give the calibrated size, such as `{names[0]}: 640`")
            return None
        value = self._data[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value):
            self.report((key,), f"is {value!r}", "give a whole number of pixels, such as 640")
            return None
        return int(value)

    def _numbers(self, key: str) -> Array | None:
        """Give the numbers of a list, nested list, or matrix written as rows, cols and data."""
        value = self._data[key]
        rows = cols = None
        if isinstance(value, dict):
            rows, cols, value = value.get("rows"), value.get("cols"), value.get("data")
        flat = _flatten(value)
        if flat is None:
            return None
        if isinstance(rows, int) and isinstance(cols, int) and rows * cols != len(flat):
            self.report((key,), f"says {rows}x{cols} but has {len(flat)} numbers", "rows times cols is the count")
            return None
        return np.array(flat, dtype=np.float64)


def _flatten(value: Any) -> list[float] | None:
    if isinstance(value, bool) or not isinstance(value, list | int | float | str):
        return None
    if isinstance(value, str):
        text = value.strip().lower().lstrip("+-.")
        return [float("nan")] if text in ("nan", "inf", "infinity") else None
    if not isinstance(value, list):
        return [float(value)]
    flat: list[float] = []
    for item in value:
        part = _flatten(item)
        if part is None:
            return None
        flat.extend(part)
    return flat
