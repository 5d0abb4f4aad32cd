# SPDX-License-Identifier: Apache-2.0
"""Checks the shapes of arrays that callers give."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _described(shape: tuple[int, ...]) -> str:
    return f"({shape[0]},)" if len(shape) == 1 else str(shape)


def as_rows(name: str, values: ArrayLike, width: int) -> NDArray[np.float64]:
    """Rows of `width` numbers, as float64 of shape (..., width).

    Raises:
        ValueError: The last axis is not `width` long; the message names the array and its shape.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != width:
        got = _described(array.shape) if array.ndim else "one number"
        axis = (
            f": axis {array.ndim - 1} must have length {width}, not {array.shape[-1]}"
            if array.ndim
            else ""
        )
        turn = array.ndim == 2 and array.shape[0] == width
        raise ValueError(
            f"{name} must be (N, {width}), got {got}{axis}" + ("; transpose it" if turn else "")
        )
    return array


def as_nanoseconds(name: str, values: ArrayLike) -> NDArray[np.int64]:
    """Times in integer nanoseconds, as int64 of any shape.

    Raises:
        TypeError: They are no integers. A float holds a time since 1970 to a quarter of a
            microsecond only.
    """
    array = np.asarray(values)
    if array.size == 0:
        return array.astype(np.int64)
    if not np.issubdtype(array.dtype, np.integer):
        raise TypeError(
            f"{name} must be integers, nanoseconds, got {array.dtype}; "
            "of seconds: numpy.rint(1e9 * seconds).astype(numpy.int64)"
        )
    return array.astype(np.int64)
