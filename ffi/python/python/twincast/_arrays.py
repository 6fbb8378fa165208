"""What arguments become before the native part sees them: arrays of f32 or f64, of the right shape, not copied where that can be."""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np


def floats(name: str, value: Any, columns: int | None = None, shape: str | None = None) -> np.ndarray:
    """``value`` as an array of float32 or float64, of shape (..., columns), which is told as ``shape`` where it is another.

    float32 and float64 stay what they are, in whichever byte order, and in this machine's stay where they are; other real numbers become float64, also Python's in an array of objects. Anything that
    answers ``__dlpack__`` and is on the CPU, or ``__array__``, is an array.

    Raises
    ------
    TypeError
        Where ``value`` is no array of real numbers, with its name.
    ValueError
        Where its last dimension is not ``columns``, with its name.
    """
    array = _array(name, value)
    # In either byte order.
    if array.dtype.newbyteorder("=") not in (np.float32, np.float64):
        if array.dtype.kind == "O":
            _check_objects(name, array, (numbers.Real, np.bool_), "real numbers")
        elif array.dtype.kind not in "fiub":
            raise TypeError(f"{name} must hold real numbers, not {array.dtype}")
        try:
            array = array.astype(np.float64)
        except OverflowError:
            raise ValueError(f"{name} must hold numbers that a float can hold") from None
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        # An empty list has no columns to count.
        if array.size == 0 and array.ndim <= 1:
            return array.reshape(0, columns)
        raise ValueError(f"{name} must have the shape {shape or f'(..., {columns})'}, not {array.shape}")
    # Numbers in the other byte order, and those that are not aligned, are copied.
    return np.require(array, dtype=array.dtype.newbyteorder("="), requirements="A")


def vectors(name: str, value: Any) -> np.ndarray:
    """``value`` as an (n, 3) array of float32 or float64; raises as :func:`floats` does."""
    array = floats(name, value, 3, "(n, 3)")
    if array.ndim != 2:
        raise ValueError(f"{name} must have the shape (n, 3), not {array.shape}")
    return array


def indices(name: str, value: Any, columns: int = 3) -> np.ndarray:
    """``value`` as an (n, columns) array of uint32.

    Raises
    ------
    TypeError
        Where it holds no integers.
    ValueError
        Where its shape is another, or a number is below 0 or above 2**32 - 1.
    """
    array = _array(name, value)
    # An empty list has neither columns nor a type of its own.
    if array.shape in ((0,), (0, columns)) and array.dtype.kind in "Oiuf":
        return np.zeros((0, columns), dtype=np.uint32)
    if array.size == 0 and array.dtype.kind == "f":
        raise ValueError(f"{name} must have the shape (n, {columns}), not {array.shape}")
    if array.dtype.kind == "O":
        _check_objects(name, array, numbers.Integral, "integers")
    elif array.dtype.kind not in "iu":
        raise TypeError(f"{name} must hold integers, not {array.dtype}")
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} must have the shape (n, {columns}), not {array.shape}")
    if array.dtype == np.uint32:
        return np.require(array, dtype=np.uint32, requirements="A")
    if array.min() < 0 or array.max() > 0xFFFF_FFFE:
        raise ValueError(f"{name} must be numbers of vertices, from 0 on; found {array.min()} to {array.max()}")
    return array.astype(np.uint32)


def whole(name: str, value: Any) -> np.ndarray:
    """``value`` as an array; one of floats that hold whole numbers becomes int64.

    Raises
    ------
    TypeError
        Where it is no array.
    """
    array = _array(name, value)
    is_whole = array.dtype.kind == "f" and (np.abs(array) < 2**53).all() and (array == np.trunc(array)).all()
    return array.astype(np.int64) if is_whole else array


def triangles(name: str, value: Any, vertices: np.ndarray) -> np.ndarray:
    """``value`` as an (n, 3) array of uint32, the numbers of ``vertices``.

    Raises
    ------
    TypeError, ValueError
        As :func:`indices` does; and where a vertex is named that is not there, with its name.
    """
    array = indices(name, value)
    if array.size and array.max() >= len(vertices):
        raise ValueError(f"{name}: vertex {array.max()} is named, but there are {len(vertices)} vertices")
    return array


def vector(name: str, value: Any) -> np.ndarray:
    """``value`` as a (3,) array of float64; raises as :func:`floats` does, also where it is not finite."""
    return _finite(name, value, (3,))


def matrix(name: str, value: Any, size: int) -> np.ndarray:
    """``value`` as a (size, size) array of float64; raises as :func:`floats` does, also where it is not finite."""
    return _finite(name, value, (size, size))


def _finite(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = floats(name, value, shape[-1], str(shape)).astype(np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} must have the shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, not {array.tolist()}")
    return array


def _check_objects(name: str, array: np.ndarray, kinds: Any, what: str) -> None:
    """Whether all that is in an array of objects is of these kinds; else a TypeError says what is not."""
    for item in array.flat:
        if not isinstance(item, kinds):
            raise TypeError(f"{name} must hold {what}, not {type(item).__name__}")


def _array(name: str, value: Any) -> np.ndarray:
    if isinstance(value, np.ndarray):
        # Of a subclass, such as trimesh's that watches for changes, the plain array.
        return value.view(np.ndarray)
    if hasattr(value, "__dlpack__") and hasattr(np, "from_dlpack"):
        try:
            return np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError, ValueError):
            # Not on the CPU, or of a kind that NumPy has not: it may still turn itself into an array.
            pass
    try:
        return np.asarray(value)
    except (ValueError, TypeError, RuntimeError) as error:
        raise TypeError(f"{name} must be an array of numbers: {error}") from error
