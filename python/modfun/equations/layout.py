"""Equations for the channels of a record: names, orders, and the formulas that the core fits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import SpecError
from ..models.noise import Noise
from ..models.options import Options
from ..models.process import ProcessNoise
from ..records.forms import Forms

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled
    from .symbolic.formulas import Formulas

__all__ = ["EquationLayout", "layout_of", "with_excess", "with_spread"]

KEPT = 32


@dataclass(frozen=True, eq=False)
class EquationLayout:
    """Equations for the channels of a record: names, orders, what the core is told.

    Attributes
    ----------
    outputs, inputs, param_names : tuple of str
    orders : tuple of int
        Highest derivative of each equation.
    compiled : Compiled
    formulas : Formulas
    rational : bool
        Whether parameters are coefficients of polynomials: no.
    """

    rational: ClassVar[bool] = False

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    param_names: tuple[str, ...]
    orders: tuple[int, ...]
    compiled: Compiled
    formulas: Formulas

    @property
    def plain(self) -> bool:
        """Not what the fastest path fits."""
        return False

    @property
    def known_delays(self) -> list[tuple[str, float]]:
        """Delays stand in the equations."""
        return []

    @property
    def free_delays(self) -> list[int]:
        """Parameters that signals are late by."""
        return [place for _, _, place in self.formulas.words["signals"] if place is not None]

    @property
    def held(self) -> dict[str, float]:
        """Parameters that are not estimated."""
        return dict(self.compiled.fixed)

    @property
    def priors(self) -> tuple[tuple[int, float, float], ...]:
        """Parameters of which something is known beforehand: position, mean, standard deviation."""
        return tuple(self.formulas.words["priors"])

    @property
    def common(self) -> bool:
        """One set of poles, if any."""
        return True

    @property
    def constants(self) -> list[str]:
        """Parameters of which nothing but constants depends and nothing is known: line 0 alone tells them."""
        words = self.formulas.words
        operations, results = words["formulas"]
        still = [operations[at][0] == "constant" for at in results[: len(words["signals"])]]
        told = {p for term, p in words["slopes"] if not still[words["terms"][term][1]]}
        told |= {p for _, _, p in words["signals"]} | {p for _, p, _ in words["signal_slopes"]}
        told |= {p for p, _, _ in words["priors"]}
        return [name for p, name in enumerate(self.param_names) if p not in told]

    @property
    def longest_delay(self) -> float:
        """The most that a signal may be late, s."""
        bounds = self.formulas.words["bounds"]
        late = [delay if k is None else bounds[k][1] for _, delay, k in self.formulas.words["signals"]]
        return max(late, default=0.0)


@lru_cache(KEPT)
def _layout(structure: Any, options: Options, outputs: Any, inputs: Any, forms: Any) -> EquationLayout:
    compiled = structure.compiled(outputs, inputs)
    from .symbolic.formulas import formulas

    noisy = list(outputs)
    if options.noise == "errors-in-variables" or (
        isinstance(options.noise, Noise) and options.noise.u is not None
    ):
        noisy += inputs
    if isinstance(options.noise, ProcessNoise):
        noisy += [name for name, _ in options.noise.filters]
        steep = max([len(num) - 1 for _, (num, _) in options.noise.filters])
        if options.noise.estimated and steep > min(compiled.orders):
            raise SpecError(
                f"fit: noise=ProcessNoise: a numerator of degree {steep} asks for equations of that order, "
                f"and one is of order {min(compiled.orders)}; give mf.Numerator({min(compiled.orders)})"
            )
    found = formulas(compiled, options.rule, forms, noisy, options.noise == "log-normal", options.correct)
    for _, _, late in found.words["signals"]:
        if late is not None and not isfinite(found.words["bounds"][late][1]):
            name = compiled.parameters[late]
            raise SpecError(
                f"fit: {name!r} is a delay that is to be estimated and has no largest value; give its bounds "
                f"in s, as params={{{name!r}: mf.Free(min=0, max=0.5)}}, or a number"
            )
    return EquationLayout(
        tuple(outputs), tuple(inputs), tuple(compiled.parameters), tuple(compiled.orders), compiled, found
    )


def layout_of(
    structure: Any,
    options: Options,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    forms: Forms,
) -> EquationLayout:
    """The equations for the channels of records or of a batch; `forms`: of all records, or of each."""
    for name, plain, why in (
        (
            "output_weights",
            options.output_weights is None,
            "is for transfer functions; give noise=mf.Noise(y=...)",
        ),
        ("extended", options.extended, "is for transfer functions; equations use all indices"),
    ):
        if not plain:
            raise SpecError(f"fit: {name}={getattr(options, name)!r} {why}")
    own = options.replace(
        band=None, harmonics=None, method="ml", trend=None, tol=1e-9, maxiter=50, cov_type="spectral"
    )
    if isinstance(own.noise, Noise):
        own = own.replace(noise=Noise(y=1.0, u=None if own.noise.u is None else 1.0))
    return _layout(structure, own, outputs, inputs, forms)


@lru_cache(KEPT)
def with_spread(layout: EquationLayout) -> EquationLayout:
    """The same equations with the noise of each sample of the outputs, whose channels come last; themselves
    where noise has no mean in them."""
    from .symbolic.spread import spread

    found = spread(layout.formulas, len(layout.outputs))
    return layout if found is layout.formulas else replace(layout, formulas=found)


@lru_cache(KEPT)
def with_excess(layout: EquationLayout, rule: str) -> EquationLayout:
    """The same equations less one known signal in each, whose channels come last."""
    words, count = layout.formulas.words, len(layout.orders)
    operations, results = words["formulas"]
    numbers, values = words["coefficients"]
    first, signals, terms = words["channels"], len(words["signals"]), len(words["terms"])
    # Channels come before all other inputs of the formulas, which move up.
    moved = [
        (name, value, a + count if name == "input" and a >= first else a, b)
        for name, value, a, b in operations
    ]
    own = range(len(moved), len(moved) + count)
    more = {
        "formulas": (
            [*moved, *[("input", 0.0, first + e, 0) for e in range(count)]],
            [*results[:signals], *own, *results[signals:]],
        ),
        "signals": [*words["signals"], *[((rule,), 0.0, None)] * count],
        "terms": [*words["terms"], *[(e, signals + e, 0) for e in range(count)]],
        "coefficients": (
            [*numbers, ("constant", -1.0, 0, 0)],
            [*values[:terms], *[len(numbers)] * count, *values[terms:]],
        ),
        "channels": first + count,
    }
    return replace(layout, formulas=replace(layout.formulas, words=words | more))
