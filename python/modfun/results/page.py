"""The page about a fit: what it was made of, what it found, and how far that can be believed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..base.waiting import Waiting
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..equations.written import Written
from ..errors import SpecError
from ..pages import formulas, provenance
from ..pages.figures import drawn
from ..pages.parts import Block, Facts, Figure, Grid, Notes, Page, Words, plain_table, section
from ..systems.frequency_response import FrequencyResponse
from . import drawing
from . import page_words as words
from .collinearity import collinearity_of
from .derived import damp
from .estimates import Estimates
from .page_records import Content
from .priors import known_beforehand
from .summary import parameters

__all__ = ["page_of"]

STRONG = 0.9  # correlation
TOLD = ("Model", "Data", "Records", "Method", "Band", "Noise")  # of the facts


def page_of(fit: Estimates, content: Content, title: str | None, command: str | None) -> Page:
    """The page; parts that cannot be made say why.

    Parameters
    ----------
    fit : Estimates
    content : Content
    title : str or None
        Default: what was fitted to what.
    command : str or None
        The command line that made it.
    """
    said, tone, findings = words.verdict(fit, content.findings)
    made = [*content.data]
    with Waiting("report"):
        if fit.usable:
            made = [
                section("model", "Model", lambda: _formulas(fit), lambda: _estimates(fit), content.level),
                *content.explained(),
                section("bode", "Frequency response", lambda: _bode(fit, content.measured)),
                *made,
                section("poles", "Poles", lambda: _poles(fit)),
                section(
                    "parameters",
                    "Collinearity",
                    lambda: _collinear(fit),
                    lambda: _correlation(fit),
                ),
            ]
        made.append(section("provenance", "Provenance", lambda: _provenance(fit, content, command)))
    told = [(name, text) for name, text in content.facts if name in TOLD]
    return Page(
        title or _title(fit), (*told, ("Report made", provenance.now())), said, tone, findings, tuple(made)
    )


def _title(fit: Estimates) -> str:
    kind = {StateSpace: "State space", Equation: "Equation"}.get(type(fit.structure), "Transfer function")
    return f"{kind} of {', '.join(fit.outputs)}" + (
        f" from {', '.join(fit.inputs)}" if fit.inputs else ", free motion"
    )


# Model -------------------------------------------------------------------------------------------


def _formulas(fit: Estimates) -> Iterable[Block]:
    if not isinstance(fit.structure, Written):
        return formulas.transfer_functions(fit)
    values = {**fit.layout.held, **fit.estimates()}
    if isinstance(fit.structure, StateSpace):
        return formulas.state_space(fit.structure, values)
    assert isinstance(fit.structure, Equation)
    return formulas.equations(fit.structure.texts, values)


def _estimates(fit: Estimates) -> Iterable[Block]:
    yield Grid.of(parameters(fit), "Estimates, standard errors and 95 % intervals")
    if fit.layout.held:
        held = ", ".join(f"{name} = {value:.6g}" for name, value in fit.layout.held.items())
        yield Words(f"Held, not estimated: {held}.")
    if fit.layout.priors:
        yield Words(f"Known beforehand, as one measurement more: {', '.join(known_beforehand(fit))}.")
    yield Words(words.assumption(fit))


# What follows from it ----------------------------------------------------------------------------


def _bode(fit: Estimates, measured: Sequence[FrequencyResponse]) -> Block:
    if not fit.inputs:
        raise SpecError("a free motion has no input, and so no frequency response")
    svg = drawn(lambda axes: drawing.bode(*measured, fit, ax=axes), 2, height=2.5, sharex=True)
    return Figure(
        svg,
        f"Bode plot of {_paths(fit)}: magnitude above, phase below, each with its confidence band.",
        "Magnitude and phase with 95 % band (delta method). Dashed: not among the frequencies fitted.",
    )


def _paths(fit: Estimates) -> str:
    return f"{', '.join(fit.inputs)} to {', '.join(fit.outputs)}"


def _poles(fit: Estimates) -> Iterable[Block]:
    if not fit.has_poles:
        raise SpecError(
            "an Equation, linear or not, is not asked for poles; fit a TransferFunction or a StateSpace"
        )
    svg = drawn(lambda axes: drawing.poles(fit, ax=axes[0]), 1, height=4.0, width=6.5)
    yield Figure(
        svg, "Poles in the complex plane.", "Poles with 95 % confidence ellipses (real poles: intervals)."
    )
    yield Grid.of(damp(fit), "Poles, natural frequencies and damping with standard errors (delta method)")


def _collinear(fit: Estimates) -> Iterable[Block]:
    found = collinearity_of(fit)
    yield Notes((f"Condition number {found.condition:.3g}.", *found.findings))
    yield Grid.of(found.table, "Variance inflation: how much of each regressor the others explain")


def _correlation(fit: Estimates) -> Iterable[Block]:
    between = fit.correlation()
    names, count = fit.param_names, len(fit.param_names)
    if count < 2:
        return
    pairs = [(between[i, j], names[i], names[j]) for i in range(count) for j in range(i)]
    strongest, one, other = max(pairs, key=lambda pair: abs(np.nan_to_num(pair[0])))
    yield Words(
        f"The strongest correlation of two estimates is {strongest:+.2f}, of {other} and {one}: "
        + ("one can hardly move without the other." if abs(strongest) > STRONG else "each is seen by itself.")
    )
    yield Figure(
        drawn(
            lambda axes: drawing.correlation(fit, axes[0]), 1, height=1.5 + 0.3 * min(count, 12), width=6.5
        ),
        "Correlation matrix of the estimates, in colours; the table below has its numbers.",
        "Correlations of the estimates.",
    )
    cells = [(name, *(f"{r:+.2f}" for r in row)) for name, row in zip(names, between, strict=True)]
    yield replace(plain_table(("", *names), cells, "Correlations as a table"), folded=True)


# Provenance --------------------------------------------------------------------------------------


def _provenance(fit: Estimates, content: Content, command: str | None) -> Iterable[Block]:
    yield Facts(provenance.versions())
    given = fit.options.given()
    options = ", ".join(f"{name}={value!r}" for name, value in given.items()) or "all as by default"
    yield Facts((("Options", options),))
    lines = [provenance.bare(command)] if command else words.python_call(fit)
    yield provenance.call(lines)
    yield Words(
        "A fit draws no random numbers: the same samples and options give the same numbers, to the last bit, "
        "for any number of threads and any instruction set."
    )
    yield from content.hashes()
