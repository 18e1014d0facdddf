"""What the compiler hands to estimation and simulation: terms g(θ)·F·p^k E of modulated equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy
from numpy.typing import NDArray

from ...models.free import Free

__all__ = ["Compiled", "Delayed", "Term", "jet", "time"]

time = sympy.Symbol("t", real=True)


class Delayed(sympy.Function):  # type: ignore[misc]  # SymPy ships no types
    """Delayed(y, h): the channel y at t - h, h seconds, a number or a parameter."""

    nargs = 2
    is_real = True


def jet(name: str, order: int = 0) -> sympy.Symbol:
    """Symbol of the `order`-th derivative of a signal: y, y', y'', ... ."""
    return sympy.Symbol(name + "'" * order, real=True)


@dataclass(frozen=True)
class Term:
    """g(θ) · F · p^order E of one equation.

    Attributes
    ----------
    equation : int
        Which equation of the compiled set.
    coefficient : sympy.Expr
        g, of parameters only.
    order : int
        Derivatives of the signal.
    signal : sympy.Expr
        E: of channels (`jet(name)`, `Delayed(jet(name), h)`), `time`, known functions and, where it cannot be
        otherwise, parameters.
    factor : sympy.Expr or None
        F, of channels, where the product F · p^order E has no exact form (Property 2); None: 1.
    """

    equation: int
    coefficient: sympy.Expr
    order: int
    signal: sympy.Expr
    factor: sympy.Expr | None = None


@dataclass(frozen=True)
class Compiled:
    """Equations as sums of terms that vanish: Σ g(θ) F p^k E = 0.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Channels; symbols of the same names stand in the signals.
    parameters : tuple of str
        What is estimated, in the order of first appearance.
    free : dict of str to Free
        Start and bounds of each parameter.
    terms : tuple of Term
    known : dict of Symbol to callable or (N+1,) array
        Known functions of time that have no expression; `known[s]` takes instants in s and gives values, or
        holds one value a sample.
    source : tuple of sympy.Expr
        The user's equations as they stand (each vanishes), in jets, `time`, parameters and known functions,
        fixed parameters put in: what is simulated.
    hidden : tuple of str
        Signals of the source that are not measured.
    steps : tuple of str
        What was done and why, a sentence each.
    varying : dict of str to tuple of (str, sympy.Expr)
        Of each coefficient c(t) = Σ c_j f_j(t) the names of c_j and the functions f_j, of `time` or
        symbols of `known`. A c_j that is held is not a parameter: its number stands in `fixed`.
    fixed : dict of str to float
        Parameters that are held.
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    free: Mapping[str, Free]
    terms: tuple[Term, ...]
    known: Mapping[sympy.Symbol, Callable[[Any], Any] | NDArray[Any]] = field(default_factory=dict)
    source: tuple[sympy.Expr, ...] = ()
    hidden: tuple[str, ...] = ()
    steps: tuple[str, ...] = ()
    varying: Mapping[str, tuple[tuple[str, sympy.Expr], ...]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)

    @property
    def products(self) -> bool:
        """Whether products of a signal and a derivative are left, which amplify noise."""
        return any(term.factor is not None for term in self.terms)

    @property
    def is_driven_by_time(self) -> bool:
        """Whether the user's equations contain the time or a known function of it."""
        used = set().union(*(e.free_symbols for e in self.source))
        return time in used or not used.isdisjoint(self.known)

    @property
    def is_linear(self) -> bool:
        """Whether the terms are signals and their derivatives as they are, without functions or products."""
        plain = (sympy.Symbol, sympy.Number, Delayed)
        return bool(self.terms) and all(isinstance(x.signal, plain) and x.factor is None for x in self.terms)

    @property
    def orders(self) -> tuple[int, ...]:
        """Highest derivative of each equation: the number of its transient coefficients."""
        count = 1 + max(term.equation for term in self.terms)
        return tuple(max(x.order for x in self.terms if x.equation == e) for e in range(count))
