"""Units of channels where a state is not measured: refits of the records with channels in other units."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log
from typing import Any

import numpy as np

from ..base.cached import kept
from ..equations.matrices import names_in, state_of
from ..equations.state_space import StateSpace
from ..records.record import Record
from .cures import CLOSE, ENOUGH, Cure, again, bic_beside, likely_cure, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates

__all__ = ["DEGREES", "GRAVITY", "angles_of", "forces_of", "in_other_units", "seem"]

DEGREES, GRAVITY = 180 / np.pi, 9.80665
TENTH = log(10.0)  # of the logarithm of a power: what a unit explains at least where other things are wrong
# What a force is multiplied by, so that it is in m/s², in words.
FORCES = (
    (GRAVITY, "in g and not in m/s²"),
    (1.0, ""),
    (-GRAVITY, "of the opposite sign and in g and not in m/s²"),
    (-1.0, "of the opposite sign"),
    (0.3048, "in ft/s² and not in m/s²"),
)
LIKELY = 2  # of these, with which one angle alone is tried, or all but one


def angles_of(model: Any) -> list[str]:
    """Outputs that are states, such as angles and rates."""
    shown = zip(model.outputs, model.C, model.D, strict=True) if isinstance(model, StateSpace) else ()
    return [y for y, c, d in shown if state_of(c, d) is not None]


def forces_of(model: Any) -> list[str]:
    """Outputs that parameters make of states, such as accelerations; never angles."""
    shown = zip(model.outputs, model.C, model.D, strict=True) if isinstance(model, StateSpace) else ()
    return [y for y, c, d in shown if state_of(c, d) is None and names_in((c,), (d,))]


def in_other_units(fit: Estimates) -> Doubt | None:
    """That channels are in another unit than equations with a state that is not measured need.

    Such a state takes any unit, so that a search for the numbers of the equations goes astray. The few usual
    mistakes are tried one after another instead: degrees, g, feet and the sign of a force.
    """
    model = fit.structure
    if fit.again is None or fit.records is None or not isinstance(model, StateSpace) or fit.options.drives:
        return None
    if len(angles_of(model)) >= len(model.states) or not forces_of(model):
        return None
    if fit.usable and not level_p(fit) < SURE:
        return None
    cure = _best(fit)
    if cure is None:
        return None
    # A sensor off the reference point is likelier than channels in units that leave more than the noise.
    beside = likely_cure(fit) if fit.usable and not cure.level_p > ENOUGH else None
    if beside is not None and beside.after < cure.after + CLOSE:
        return None
    fallen = f": BIC falls from {cure.before:.4g} to {cure.after:.4g}" if cure.before < inf else ""
    return Doubt(f"{cure.words}{fallen}.")


@kept
def _best(fit: Estimates) -> Cure | None:
    """The change of units that explains the residuals; the first of those that leave only the noise."""
    options = (on_band(fit, fit.band) if fit.usable else fit.options).replace(trend=fit.trend)
    before, found = bic_beside(fit, fit) if fit.usable else inf, None
    each = (fit.df_resid + fit.params.size) / len(fit.row_names)
    for words, factors in _tries(fit.structure):
        each_record: list[Record] = []
        for rec in fit.records or ():
            rows: dict[str, Any] = {name: size * rec[name] for name, size in factors.items()}
            each_record.append(rec.assign(**rows))
        other = again(fit, tuple(each_record), fit.structure, options)
        if other is None or not other.success:
            continue
        # Residuals in a smaller unit are larger numbers.
        after = bic_beside(other, fit) - 2 * each * log(abs(np.prod(list(factors.values()))))
        cure = Cure(words, before, after, level_p(other))
        if not after < before - each * TENTH or (found and not after < found.after - CLOSE):
            continue
        found = cure
        if cure.level_p > ENOUGH:
            break
    return found


def _tries(model: StateSpace) -> Iterator[tuple[str, dict[str, float]]]:
    """What channels seem to be with the cure, and their factors; the more likely ones first."""
    angles, forces = angles_of(model), forces_of(model)
    some = [[name] for name in angles] + [[x for x in angles if x != name] for name in angles]
    subsets = [[], angles, *(chosen for chosen in some if 0 < len(chosen) < len(angles))]
    seen = list[list[str]]()
    for at, chosen in enumerate(subsets):
        if chosen in seen:
            continue
        seen.append(chosen)
        for factor, what in FORCES[: None if at < LIKELY else LIKELY]:
            moved = forces if what else []
            if not (chosen or moved):
                continue
            parts = [seem(chosen, "in degrees and not in radians")] if chosen else []
            parts += [seem(moved, what)] if moved else []
            code = [f"{name}=rec[{name!r}]/57.3" for name in chosen]
            minus, size = "-" if factor < 0 else "", "" if abs(factor) == 1 else f"*{abs(factor):.4g}"
            code += [f"{name}={minus}rec[{name!r}]{size}" for name in moved]
            factors = dict.fromkeys(chosen, 1 / DEGREES) | dict.fromkeys(moved, factor)
            yield f"{'; '.join(parts)}. First try rec.assign({', '.join(code)})", factors


def seem(names: list[str], what: str) -> str:
    """That channels are in some unit, in words."""
    *first, last = names
    return f"{', '.join(first)} and {last} seem to be {what}" if first else f"{last} seems to be {what}"
