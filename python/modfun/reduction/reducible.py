"""What may be reduced: systems of many forms, as stable part, kept part, delays; lines of a response."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arguments import reals
from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..errors import DataError, SpecError
from ..systems.frequency_response import FrequencyResponse
from ..systems.lti import LTI
from ..systems.making import system_of
from .gramians import AXIS, Balanced, Realisation, balance, split

__all__ = ["FullOrder", "Lines", "read_system", "realisation"]


# Sparse systems up to this order are treated as dense ones: exact, and a few seconds.
DENSE = 2000


@dataclass(frozen=True, eq=False)
class FullOrder:
    """A system as a balanced stable part, what is not stable, and the delays of the inputs."""

    order: int
    balanced: Balanced
    kept: Realisation
    delays: tuple[float, ...]

    @property
    def stable(self) -> Realisation:
        return self.balanced.system

    @cached_property
    def range(self) -> tuple[float, float]:
        """Between which frequencies something happens, rad/s."""
        sizes = np.abs(np.concatenate([self.stable.poles, self.kept.poles]))
        sizes = sizes[sizes > 1e-12 * np.max(sizes, initial=0.0)]
        late = [1 / d for d in self.delays if d > 0]
        if sizes.size == 0:
            return (1.0, 2.0) if not late else (min(late) / 30, max(late) * 30)
        return float(min([*sizes, *late])) / 30, float(max([*sizes, *late])) * 30

    def response(self, omega: F64) -> C128:
        """G(iω) with all its parts, (omega, output, input)."""
        rational = self.stable.response(omega) + self.kept.response(omega)
        found: C128 = rational * np.exp(-1j * omega[:, None, None] * np.array(self.delays))
        return found


@dataclass(frozen=True, eq=False)
class Lines:
    """A measured or computed frequency response, (omega, output, input)."""

    omega: F64
    data: C128


def realisation(system: LTI) -> Realisation:
    """Matrices of a system, counted in its own unit of time where it is a transfer function."""
    a, b, c, d, _ = system.scaled()
    return Realisation(a, b, c, d)


def read_system(given: Any) -> FullOrder | Lines:
    """Read what `reduce` was given.

    Raises
    ------
    SpecError, DataError
        Matrices whose sizes do not fit, numbers that are not finite, discrete time.
    """
    if isinstance(given, FrequencyResponse):
        return _lines(given.omega, given.response)
    if hasattr(given, "omega") and (hasattr(given, "frdata") or hasattr(given, "fresp")):
        return _lines(
            given.omega, getattr(given, "frdata", None) if hasattr(given, "frdata") else given.fresp
        )
    if isinstance(given, tuple):
        return _full_order(_matrices(given), None)
    if not isinstance(given, LTI):
        given = system_of(getattr(given, "model", given), what="reduce")  # the model of a fit
    return _full_order(realisation(given), given.input_delays("reduce"))


def _lines(omega: Any, response: Any) -> Lines:
    found = FrequencyResponse(omega=np.asarray(omega), response=np.asarray(response))
    order = np.argsort(found.omega, kind="stable")
    if found.omega.size < 2 or not np.all(np.isfinite(found.response)) or found.omega[order[0]] < 0:
        raise DataError(
            "reduce: a frequency response needs two lines or more, from 0 rad/s on, all finite; leave others "
            "out with frf.select(band) or frf.take(positions)"
        )
    return Lines(found.omega[order], found.response.transpose(2, 0, 1)[order])


def _matrices(given: tuple[Any, ...]) -> Realisation:
    if len(given) not in (3, 4):
        raise SpecError(f"reduce: a tuple is (A, B, C) or (A, B, C, D), got {len(given)} items")
    a = (
        given[0].tocsc().astype(float)
        if hasattr(given[0], "tocsc")
        else np.atleast_2d(reals("reduce", "A", given[0]))
    )
    plain = [m.toarray() if hasattr(m, "toarray") else m for m in given[1:]]
    dense = [reals("reduce", name, m) for name, m in zip("BCD", plain, strict=False)]
    n, b = a.shape[0], dense[0]
    b = b.reshape(n, -1) if b.ndim < 2 and b.size == n else np.atleast_2d(b)
    c = np.atleast_2d(dense[1])
    d = np.zeros((c.shape[0], b.shape[1])) if len(dense) < 3 else np.atleast_2d(dense[2])
    shapes = [a.shape, b.shape, c.shape, d.shape]
    if shapes != [(n, n), (n, b.shape[1]), (c.shape[0], n), (c.shape[0], b.shape[1])]:
        raise SpecError(
            f"reduce: A, B, C, D have shapes {', '.join(map(str, shapes))}; they must be (state, state), "
            "(state, input), (output, state), (output, input)"
        )
    values = a.data if hasattr(a, "tocsc") else a
    if not all(np.all(np.isfinite(m)) for m in (values, b, c, d)):
        raise SpecError("reduce: a matrix holds nan or inf; all entries must be finite")
    return Realisation(a, b, c, d)


def _full_order(system: Realisation, delays: tuple[float, ...] | None) -> FullOrder:
    n, (outputs, inputs) = system.order, system.d.shape
    if hasattr(system.a, "tocsc") and n <= DENSE:
        system = Realisation(system.a.toarray(), system.b, system.c, system.d)
    kept = Realisation(
        np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0)), np.zeros_like(system.d)
    )
    if isinstance(system.a, np.ndarray) and n and not _settles(system.a):
        system, kept = split(system)
    empty = Balanced(system, np.zeros(0))
    return FullOrder(
        n, balance(system) if system.order else empty, kept, (0.0,) * inputs if delays is None else delays
    )


def _settles(a: F64) -> bool:
    """Whether all poles lie clearly left of the axis."""
    poles = np.linalg.eigvals(a)
    return bool(np.all(poles.real < -AXIS * np.max(np.abs(poles))))
