"""Single fits without their warnings: one problem of least squares, and what options ask for beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.equation import Equation
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from ..results.stability import refuse_stable
from .by_response import by_response
from .by_samples import LOGS, by_samples
from .instruments import referenced_fit, refuse_reference
from .known_inputs import equations_closely, fit_known_inputs, held_closely, refuse_uneven
from .of_equations import fit_equation
from .past import fit_with_past
from .plain import fit_plain
from .prepared import counts_start
from .robust import refuse_robust, robust_fit
from .signs import settled, signed
from .uneven import equations_on_fewer_lines, from_response, without_excess
from .wider import equations_on_enough_lines, equations_on_more_lines

__all__ = ["fit_ended", "fit_from", "fit_near", "fit_quietly", "fit_whole", "refuse_whole"]


def fit_quietly(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    starts: Sequence[float] | None = None,
    unfolded: bool = False,
    near: bool = False,
    less: Sequence[F64] = (),
) -> Fit:
    """One fit without its warnings.

    `starts`: where the search of an equation's parameters begins, or that of a transfer function with free
    delays on a band that is given; `near`: whether these are estimates of the same equations; `unfolded`:
    whether what sampling folds is out of the outputs, as another fit told; `less`: samples that are taken
    from the equations, as that one told.
    """
    refuse_uneven(records)
    if options.reference:
        return referenced_fit(records, structure, options, fit_quietly)
    if not (options.initial_state == "unknown" or counts_start(structure, options, records)):
        if isinstance(structure, Equation) and (options.noise, options.initial_state) == (LOGS, "zero"):
            return _left_to_response(records, structure, options)
        fit: Fit = fit_with_past(records, structure, options, fit_quietly)
        return fit if isinstance(structure, TransferFunction) else by_samples(fit)
    if not isinstance(structure, TransferFunction):
        few = fit_equation(records, structure, options, fit_quietly, starts=starts, near=near, less=less)
        if starts is None:  # begun beside an answer, whose signs are settled
            few = settled(few, lambda made: fit_equation(records, made, options, fit_quietly))
        enough = equations_on_enough_lines(equations_on_fewer_lines(few, fit_equation), fit_equation)
        enough = equations_on_more_lines(enough, fit_equation)
        made = signed(enough if unfolded else equations_closely(enough, fit_equation))
        made = by_samples(made)
        first = records[0]
        named = {*first.inputs, *first.outputs} <= {*made.inputs, *made.outputs}
        return made if named else replace(made, unnamed=records)
    if any([rec.functions for rec in records]):
        return fit_known_inputs(records, structure, options, fit_quietly)
    begun = None if starts is None else np.array(starts, float)
    fit = by_samples(fit_plain(records, structure, options, fit_quietly, begun))
    if any([rec.dt is None for rec in records]):
        return without_excess(fit, lambda moved, lines: fit_plain(moved, structure, lines, fit_quietly))
    return held_closely(fit, fit_quietly)


def _left_to_response(records: tuple[Record, ...], structure: Any, options: Options) -> Fit:
    """A fit that `by_response` goes on from: samples of a start at zero have no logarithms for sums."""
    made: Any = fit_with_past(records, structure, options.replace(noise="output"), fit_quietly)
    unseen = np.full_like(made.seen, nan)
    found: Fit = replace(
        made, options=options, status="maxiter", unsettled=True, seen=unseen, noise_scale=nan
    )
    return found


def fit_near(fit: Fit, options: Options, start: F64) -> Fit | None:
    """The fit with free delays by other options, begun by these parameters; None without an answer."""
    records = fit.records or ()
    if not isinstance(options.initial_state, str) or any([rec.functions for rec in records]):
        return None

    def begun(
        records: tuple[Record, ...], structure: Any, options: Options, starts: Any = start, **_: Any
    ) -> Fit:
        return fit_plain(records, structure, options, fit_quietly, np.array(starts, float))

    if options.initial_state != "unknown" and not counts_start(fit.structure, options, records):
        made: Fit = replace(fit_with_past(records, fit.structure, options, begun, start), again=fit_quietly)
    else:
        made = begun(records, fit.structure, options)
    return made if made.usable else None


def fit_from(fit: Fit, structure: TransferFunction, options: Options) -> Fit | None:
    """The fit of a structure to a fit's uneven records, begun with what that one's response tells of sums."""

    def refit(moved: tuple[Record, ...], lines: Options) -> Fit:
        return fit_plain(moved, structure, lines, fit_quietly)

    return from_response(fit, options, refit)


def fit_whole(records: tuple[Record, ...], structure: Any, options: Options, **starts: Any) -> Fit:
    """The same with samples weighted and poles kept stable where the options say so.

    Fits of a result that is there, `Fit.again`, are without: its records hold the weights. `starts`: as
    those of `fit_quietly`, where samples are not weighted.
    """
    if options.robust:
        fit: Fit = robust_fit(records, structure, options, fit_quietly)
    else:
        fit = fit_quietly(records, structure, options, **starts)
    return fit.stable() if options.stable and fit.usable else fit


def fit_ended(records: tuple[Record, ...], structure: Any, options: Options) -> Fit:
    """The same, led on by `by_response`: of records whose inputs are read already, as `fit_as_read` does."""
    return by_response(fit_whole(records, structure, options))


def refuse_whole(records: tuple[Record, ...], structure: Any, options: Options) -> None:
    """Refuse, before there are many of them, fits whose options go together with none of such records.

    Raises
    ------
    SpecError, DataError
        As `fit_whole` would raise it.
    """
    if options.robust:
        refuse_robust(options)
    if options.reference:
        refuse_reference(records, structure, options)
    if options.stable:
        refuse_stable(fit_quietly(records, structure, options.plain()))
