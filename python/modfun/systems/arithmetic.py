"""Products, quotients, sums and feedback of systems, which python-control computes."""

from __future__ import annotations

from typing import Any, Self

from ..base.arguments import real
from ..base.elsewhere import SYSTEM, Elsewhere
from ..errors import SpecError
from .connections import connected

__all__ = ["Arithmetic"]


class Arithmetic(Elsewhere):
    """Operators of an `LTI`."""

    _elsewhere = SYSTEM
    __array_ufunc__ = None  # numbers of NumPy leave products and sums to the methods here

    def _connected(self, how: str, first: Any, second: Any, sign: int = -1) -> Self:
        return type(self)(**vars(connected(how, first, second, sign)))

    def __mul__(self, other: Any) -> Self:
        """In series: `other` acts first (extra ``control``)."""
        return self._connected("*", self, other)

    def __rmul__(self, other: Any) -> Self:
        """In series, this system acting first."""
        return self._connected("*", other, self)

    def __add__(self, other: Any) -> Self:
        """In parallel (extra ``control``)."""
        return self._connected("+", self, other)

    def __radd__(self, other: Any) -> Self:
        """In parallel."""
        return self._connected("+", other, self)

    def __sub__(self, other: Any) -> Self:
        """In parallel, the other one with the opposite sign (extra ``control``)."""
        return self._connected("-", self, other)

    def __rsub__(self, other: Any) -> Self:
        """In parallel, this one with the opposite sign."""
        return self._connected("-", other, self)

    def __truediv__(self, other: Any) -> Self:
        """Divided by a number, or by a system of one input and output (extra ``control``)."""
        if hasattr(other, "path_delays") or hasattr(other, "ninputs"):
            return self._connected("/", self, other)
        number = real("LTI", "divisor", other)
        if number == 0:
            raise SpecError("LTI: the divisor is 0; give another number")
        return self._connected("*", 1 / number, self)

    def __rtruediv__(self, other: Any) -> Self:
        """The inverse, times a number or a system of python-control (extra ``control``)."""
        return self._connected("/", other, self)

    def __neg__(self) -> Self:
        """The opposite sign (extra ``control``)."""
        return self._connected("*", -1, self)

    def feedback(self, other: Any = 1, sign: int = -1) -> Self:
        """The closed loop with another system, or a gain, in the feedback path (extra ``control``).

        Parameters
        ----------
        other : LTI, system of python-control, number or matrix, default 1
        sign : {-1, 1}
            -1 for negative feedback.

        Returns
        -------
        LTI

        Raises
        ------
        SpecError
            Numbers of channels that do not fit, or delays: give a Padé form of them.
        ImportError
            python-control is not installed.

        Examples
        --------
        >>> import modfun as mf
        >>> mf.tf([5], [1, 3, 8]).feedback(2)
              5
        --------------
        s^2 + 3 s + 18
        """
        return self._connected("feedback", self, other, sign)
