"""Structures: what may be fitted, without numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import SpecError
from .lti import LTI, tf

__all__ = ["TransferFunction"]


MOST_POLES = 100


@dataclass(frozen=True, kw_only=True)
class TransferFunction:
    """Transfer function with a number of poles, zeros an input and known delays; keywords only.

    yⁿ + a1 yⁿ⁻¹ + … + an y = Σ over inputs of (b0 p^zeros + b1 p^(zeros−1) + …) u(t − delay).

    Parameters
    ----------
    poles : int
        Order n of the denominator, at least 1.
    zeros : int, or sequence of int and None, optional
        Degree of the numerators: one for all inputs, or one an input, None where an input has no path
        to the output. Default: poles − 1.
    delay : float or sequence of float, default 0
        Known delay, s: one for all inputs, or one an input.

    Raises
    ------
    SpecError
        More zeros than poles, negative counts or delays, or lengths that differ.

    Notes
    -----
    Parameters are a1 … an, then the numerator of each input in descending powers: b0, b1, … with one
    input, b0[de], b1[de], … with several.

    Examples
    --------
    >>> TransferFunction(poles=2, zeros=[1, None], delay=[0.1, 0]).param_names(["de", "da"])
    ('a1', 'a2', 'b0[de]', 'b1[de]')
    """

    poles: int
    zeros: int | tuple[int | None, ...]
    delay: float | tuple[float, ...]

    def __init__(
        self,
        *,
        poles: int,
        zeros: int | Sequence[int | None] | None = None,
        delay: float | Sequence[float] = 0.0,
    ) -> None:
        if not _is_count(poles) or poles < 1:
            raise SpecError(f"TransferFunction: poles={poles!r} must be a whole number of at least 1")
        if poles > MOST_POLES:
            raise SpecError(
                f"TransferFunction: poles={poles} is more than {MOST_POLES}; no record determines so many"
            )
        n = int(poles)
        degrees: int | tuple[int | None, ...]
        if zeros is None:
            degrees = n - 1
        elif isinstance(zeros, str | bytes) or not isinstance(zeros, Sequence | np.ndarray):
            degrees = _degree(zeros, n)
        else:
            if any(isinstance(z, Sequence | np.ndarray) for z in zeros):
                raise SpecError(
                    f"TransferFunction: zeros={zeros!r} is nested (output, input); structures of several "
                    "outputs come with denominator= in a later version: fit one output at a time, "
                    "rec.select(outputs=[...])"
                )
            degrees = tuple(None if z is None else _degree(z, n) for z in zeros)
            if not any(z is not None for z in degrees):
                raise SpecError(
                    f"TransferFunction: zeros={zeros!r} leaves no input with a path; "
                    "give the degree of at least one numerator"
                )
        late: float | tuple[float, ...]
        if isinstance(delay, str | bytes) or not isinstance(delay, Sequence | np.ndarray):
            late = _delay(delay)
        else:
            late = tuple(_delay(d) for d in delay)
        if isinstance(degrees, tuple) and isinstance(late, tuple) and len(degrees) != len(late):
            raise SpecError(
                f"TransferFunction: zeros has {len(degrees)} inputs and delay {len(late)}; "
                "give both for the same inputs, or one number for all"
            )
        if isinstance(late, tuple) and not late:
            raise SpecError("TransferFunction: delay=[] names no input; give one number, or one an input")
        object.__setattr__(self, "poles", n)
        object.__setattr__(self, "zeros", degrees)
        object.__setattr__(self, "delay", late)

    @property
    def n_inputs(self) -> int | None:
        """Number of inputs, or None where the structure serves any number."""
        for given in (self.zeros, self.delay):
            if isinstance(given, tuple):
                return len(given)
        return None

    def numerators(self, inputs: int) -> tuple[int | None, ...]:
        """Degree of each input's numerator, None without a path.

        Parameters
        ----------
        inputs : int
            Number of inputs of the record.

        Raises
        ------
        SpecError
            The structure was made for another number of inputs.
        """
        self._check(inputs)
        return self.zeros if isinstance(self.zeros, tuple) else (self.zeros,) * inputs

    def delays(self, inputs: int) -> tuple[float, ...]:
        """Delay of each input, s; raises as `numerators`."""
        self._check(inputs)
        return self.delay if isinstance(self.delay, tuple) else (self.delay,) * inputs

    def param_names(self, inputs: Sequence[str] = ("u",)) -> tuple[str, ...]:
        """Names of the parameters.

        Parameters
        ----------
        inputs : sequence of str
            Names of the record's inputs; they stand in the names when there are several.
        """
        names = [f"a{k}" for k in range(1, self.poles + 1)]
        for channel, degree in zip(inputs, self.numerators(len(inputs)), strict=True):
            suffix = "" if len(inputs) == 1 else f"[{channel}]"
            if degree is not None:
                names += [f"b{k}{suffix}" for k in range(degree + 1)]
        return tuple(names)

    def model(self, theta: ArrayLike, inputs: int | None = None) -> LTI:
        """The system with these parameters.

        Parameters
        ----------
        theta : array_like
            Parameters in the order of `param_names`.
        inputs : int, optional
            Number of inputs; default: the structure's own, or 1.

        Returns
        -------
        LTI
        """
        count = (self.n_inputs or 1) if inputs is None else inputs
        degrees = self.numerators(count)
        values = np.asarray(theta, dtype=np.float64)
        wanted = self.poles + sum(0 if d is None else d + 1 for d in degrees)
        if values.shape != (wanted,):
            raise SpecError(
                f"TransferFunction.model: {values.size} numbers for {wanted} parameters; give a1 … "
                f"a{self.poles}, then each input's numerator in descending powers"
            )
        at = self.poles
        nums: list[Any] = []
        for degree in degrees:
            size = 0 if degree is None else degree + 1
            nums.append(values[at : at + size] if size else None)
            at += size
        return tf([nums], np.concatenate([[1.0], values[: self.poles]]), delay=self.delays(count))

    def theta(self, system: LTI) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Parameters of a system in this structure, in the order of `param_names`.

        Parameters
        ----------
        system : LTI
            A system with one output.

        Raises
        ------
        SpecError
            The system has other poles, more zeros, other delays or several outputs.
        """
        own = TransferFunction.from_system(system)
        inputs = system.shape[1]
        degrees, theirs = self.numerators(inputs), own.numerators(inputs)
        fits = own.poles == self.poles and self.delays(inputs) == own.delays(inputs)
        for mine, other in zip(degrees, theirs, strict=True):
            fits = fits and (other is None or (mine is not None and other <= mine))
        if not fits:
            raise SpecError(f"the system is a {own}, which the structure {self} does not hold")
        num, den = system.polynomials()
        parts = [den[0][0][1:]]
        for degree, p in zip(degrees, num[0], strict=True):
            if degree is not None:
                parts.append(np.concatenate([np.zeros(degree + 1 - p.size), p]))
        return np.concatenate(parts)

    @classmethod
    def from_system(cls, system: LTI) -> TransferFunction:
        """The structure a system with one output has: its poles, zeros and delays.

        Parameters
        ----------
        system : LTI
            A system with one output.

        Raises
        ------
        SpecError
            Several outputs, or paths with denominators of their own.
        """
        outputs, inputs = system.shape
        num, den = system.polynomials()
        if outputs != 1:
            raise SpecError(
                f"TransferFunction.from_system: the system has {outputs} outputs; structures of several "
                "outputs come with denominator= in a later version: take one row"
            )
        if not isinstance(system.den, np.ndarray):
            raise SpecError(
                "TransferFunction.from_system: the inputs have different denominators; bring them to a "
                "common one, mf.tf([num1, num2], den)"
            )
        if den[0][0].size < 2:
            raise SpecError(
                "TransferFunction.from_system: a static gain has no poles; there is nothing to fit"
            )
        degrees = tuple(p.size - 1 if np.any(p) else None for p in num[0])
        if inputs == 1 and degrees[0] is not None:
            return cls(poles=den[0][0].size - 1, zeros=degrees[0], delay=system.delays[0])
        return cls(poles=den[0][0].size - 1, zeros=degrees, delay=system.delays)

    def _check(self, inputs: int) -> None:
        own = self.n_inputs
        if own is not None and own != inputs:
            raise SpecError(
                f"TransferFunction: made for {own} input(s), used with {inputs}; give zeros and delay "
                "one an input of the record, or select its inputs"
            )

    def __repr__(self) -> str:
        zeros = list(self.zeros) if isinstance(self.zeros, tuple) else self.zeros
        delay = list(self.delay) if isinstance(self.delay, tuple) else self.delay
        late = f", delay={delay}" if np.any(delay) else ""
        return f"TransferFunction(poles={self.poles}, zeros={zeros}{late})"


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool | np.bool_)


def _degree(value: Any, poles: int) -> int:
    if not _is_count(value) or value < 0:
        raise SpecError(
            f"TransferFunction: zeros holds {value!r}; give whole numbers of at least 0, or None for an "
            "input without a path"
        )
    if value > poles:
        raise SpecError(
            f"TransferFunction: {value} zeros with {poles} poles; a system that can be sampled has at most "
            "as many zeros as poles: lower zeros= or raise poles="
        )
    return int(value)


def _delay(value: Any) -> float:
    try:
        late = float(value)
    except (TypeError, ValueError):
        raise SpecError(
            f"TransferFunction: delay={value!r} is no number; give known delays in seconds"
        ) from None
    if not (np.isfinite(late) and late >= 0):
        raise SpecError(f"TransferFunction: delay={value!r} s must be finite and at least 0")
    return late
