"""A delay system as data: its matrices by lag, its channels and its characteristic roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import real, reals
from ..base.arrays import F64
from ..equations.written import channel_names
from ..errors import SpecError
from .roots import Lagged, Roots, rightmost

__all__ = ["Plant", "matrices_of"]


class Plant:
    """What `DelaySystem` holds, and what transformations, laws, responses and bounds are made of."""

    a: Lagged
    b: Lagged
    C: F64
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __init__(
        self,
        A: Mapping[float, ArrayLike] | ArrayLike,
        B: Mapping[float, ArrayLike] | ArrayLike | None = None,
        C: ArrayLike | None = None,
        *,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> None:
        a = _lagged("A", A, None)
        n = len(a[0][1])
        b = _lagged("B", np.zeros((n, 0)) if B is None else B, n)
        own = channel_names("DelaySystem", "states", states, n, "x", always=True)
        c = np.eye(n) if C is None else np.atleast_2d(reals("DelaySystem", "C", C))
        if c.ndim != 2 or c.shape[1] != n or not np.all(np.isfinite(c)):
            raise SpecError(
                f"DelaySystem: C has shape {c.shape}; with {n} states it is (outputs, {n}), finite"
            )
        c = c.copy()
        c.flags.writeable = False
        self.__dict__.update(
            a=a,
            b=b,
            C=c,
            states=own,
            inputs=channel_names("DelaySystem", "inputs", inputs, b[0][1].shape[1], "u"),
            outputs=own if C is None else channel_names("DelaySystem", "outputs", None, len(c), "y"),
        )

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("a DelaySystem cannot be changed; make a new one")

    @property
    def A(self) -> dict[float, F64]:
        """Matrices of x by lag, s."""
        return dict(self.a)

    @property
    def B(self) -> dict[float, F64]:
        """Matrices of u by lag, s."""
        return dict(self.b)

    @property
    def order(self) -> int:
        """Number of states n: as many roots can be moved."""
        return len(self.a[0][1])

    @property
    def shape(self) -> tuple[int, int]:
        """Number of outputs and of inputs."""
        return len(self.C), self.b[0][1].shape[1]

    def poles(self, count: int = 20) -> Roots:
        """Rightmost characteristic roots, each with its residual, counted by the argument principle.

        Parameters
        ----------
        count : int, default 20
            How many at least; pairs are not cut, and a system may have fewer.

        Returns
        -------
        Roots
            An array of complex numbers, rad/s, that prints as a table.

        Warns
        -----
        ModfunWarning
            The argument principle counts others than were found.
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise SpecError(f"poles: count={count!r} must be a whole number of at least 1")
        kept: dict[int, Roots] = self.__dict__.setdefault("_roots", {})
        if count not in kept:
            kept[count] = rightmost(self.a, int(count))
        return kept[count]

    def __repr__(self) -> str:
        parts = [f"x' = {' + '.join([*_terms('A', 'x', self.a), *_terms('B', 'u', self.b)])}"]
        for name, matrices in (("A", self.a), ("B", self.b)):
            parts += [f"{name}[{lag:g}] =\n{m}" for lag, m in matrices if m.size]
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def _terms(name: str, signal: str, matrices: Lagged) -> list[str]:
    return [f"{name}[{lag:g}] {signal}(t{f' - {lag:g}' if lag else ''})" for lag, m in matrices if m.size]


def _lagged(name: str, given: Any, n: int | None) -> Lagged:
    """Matrices by rising lag, that of lag 0 among them; B has the rows of A."""
    found = matrices_of(f"DelaySystem: {name}", given if isinstance(given, Mapping) else {0.0: given})
    if not found:
        raise SpecError(f"DelaySystem: {name} is empty; give at least one matrix, as {{0: ...}}")
    first = next(iter(found.values()))
    shape = (len(first), len(first)) if n is None else (n, first.shape[1])
    for lag, m in found.items():
        if m.shape != shape or not shape[0]:
            raise SpecError(
                f"DelaySystem: {name}[{lag:g}] has shape {m.shape}; beside the others it must be {shape}"
            )
    found.setdefault(0.0, np.zeros(shape))
    for m in found.values():
        m.flags.writeable = False
    return tuple(sorted(found.items()))


def matrices_of(what: str, given: Any) -> dict[float, F64]:
    """Matrices by lag, checked one by one; a vector is a column."""
    if not isinstance(given, Mapping):
        raise SpecError(f"{what} must map lags in seconds to matrices, as {{0: ..., 1.0: ...}}")
    found: dict[float, F64] = {}
    for lag, matrix in given.items():
        if not 0 <= real(what, "a lag", lag) < np.inf:
            raise SpecError(f"{what} has the lag {lag!r}; a lag is a time in seconds, at least 0")
        m = reals(what, f"[{lag:g}]", matrix).copy()
        m = m.reshape(1, 1) if m.ndim == 0 else m[:, None] if m.ndim == 1 else m
        if m.ndim != 2 or not np.all(np.isfinite(m)):
            raise SpecError(f"{what}[{lag:g}] must be a matrix of finite numbers, its shape is {m.shape}")
        found[float(lag)] = m
    return found
