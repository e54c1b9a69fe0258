"""The one place that names array types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]


def frozen(values: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """Copy to a read-only float array.

    Args:
        values: the numbers.
        shape: the shape they must have; None accepts any.

    Raises:
        ValueError: the shape differs.
    """
    array: NDArray[Any] = np.array(values, dtype=np.float64)
    if shape is not None and array.shape != shape:
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    array.setflags(write=False)
    return array
