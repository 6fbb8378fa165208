"""Numbers as arguments: what is wrong with them is told with their names, before any work."""

from __future__ import annotations

import math
import operator
from typing import Any


def whole(name: str, value: Any, least: int = 0, most: int = 2**63 - 1) -> int:
    """``value`` as an int from ``least`` to ``most``.

    Raises
    ------
    TypeError
        Where it is no integer, with its name.
    ValueError
        Where it is too small or too large, with its name.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, not {value!r}") from None
    if not least <= number <= most:
        raise ValueError(f"{name} must be from {least} to {most}, not {number}")
    return number


def text(name: str, value: Any) -> str | None:
    """``value``, a string or None.

    Raises
    ------
    TypeError
        Where it is neither, with its name.
    """
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{name} must be a string, not {value!r}")
    return value


def real(name: str, value: Any) -> float:
    """``value`` as a float, which may be infinite.

    Raises
    ------
    TypeError
        Where it is no real number, with its name.
    ValueError
        Where it is NaN, or an integer that is too large, with its name.
    """
    try:
        if isinstance(value, (str, bytes, bytearray)):
            raise TypeError  # float() would read the number in it.
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} must be a number that a float can hold") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a real number, not {value!r}") from None
    if math.isnan(number):
        raise ValueError(f"{name} must be a number, not NaN")
    return number
