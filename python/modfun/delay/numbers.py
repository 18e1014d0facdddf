"""What users give, as arrays of numbers, or refused in words."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SpecError

__all__ = ["complex_numbers", "real_numbers"]


def real_numbers(what: str, given: Any) -> NDArray[np.float64]:
    """An array of float64.

    Raises
    ------
    SpecError
        Not numbers.
    """
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise SpecError(f"{what} must be numbers, not {given!r}") from None


def complex_numbers(what: str, given: Any) -> NDArray[np.complex128]:
    """A list of complex numbers.

    Raises
    ------
    SpecError
        Not numbers.
    """
    try:
        return np.atleast_1d(np.asarray(given, dtype=np.complex128))
    except (TypeError, ValueError):
        raise SpecError(f"{what} must be numbers, not {given!r}") from None
