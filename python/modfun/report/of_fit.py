"""The page about a fit: what it was made of, what it found, and how far that can be believed."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from .. import plot
from ..equations import Equation
from ..errors import FitError, SpecError
from ..explain import UNLIKELY
from ..results import Fit
from ..statespace import StateSpace
from ..written import Written
from . import formulas, provenance, words
from .figures import drawn
from .of_data import data_section, spectrum_section
from .parts import Block, Facts, Figure, Grid, Notes, Page, Words, plain_table, section

__all__ = ["page_of"]

SHOWN = 4  # records that are drawn


def page_of(fit: Fit, title: str | None, command: str | None) -> Page:
    """The page; parts that cannot be made say why.

    Parameters
    ----------
    fit : Fit
    title : str or None
        Default: what was fitted to what.
    command : str or None
        The command line that made it.
    """
    said, tone, findings = words.verdict(fit)
    made = (
        data_section(fit),
        spectrum_section(fit),
        section("model", "Model", lambda: _formulas(fit), lambda: _estimates(fit), lambda: _scores(fit)),
        section("bode", "Frequency response", lambda: _bode(fit)),
        section("response", "Response", lambda: _responses(fit)),
        section("residuals", "Residuals", lambda: _residuals(fit), lambda: _tests(fit)),
        section("poles", "Poles", lambda: _poles(fit)),
        section(
            "parameters", "How parameters hang together", lambda: _collinear(fit), lambda: _correlation(fit)
        ),
        section("provenance", "Provenance", lambda: _provenance(fit, command)),
    )
    return Page(
        title or _title(fit), (*_facts(fit), ("Report made", provenance.now())), said, tone, findings, made
    )


def _title(fit: Fit) -> str:
    what = type(fit.structure).__name__ if isinstance(fit.structure, Written) else "Transfer function"
    names = ", ".join(fit.outputs)
    kind = {"StateSpace": "State space", "Equation": "Equation"}.get(what, what)
    return f"{kind} of {names}" + (f" from {', '.join(fit.inputs)}" if fit.inputs else ", free motion")


def _facts(fit: Fit) -> tuple[tuple[str, str], ...]:
    told = dict(fit.facts())
    return tuple(
        (name, told[name]) for name in ("Model", "Data", "Records", "Method", "Band", "Noise") if name in told
    )


# Model -------------------------------------------------------------------------------------------


def _formulas(fit: Fit) -> Iterable[Block]:
    fit._need_numbers("report")
    if not isinstance(fit.structure, Written):
        return formulas.transfer_functions(fit)
    values = {**fit.layout.held, **fit.estimates()}
    if isinstance(fit.structure, StateSpace):
        return formulas.state_space(fit.structure, values)
    assert isinstance(fit.structure, Equation)
    return formulas.equations(fit.structure.texts, values)


def _estimates(fit: Fit) -> Iterable[Block]:
    yield Grid.of(fit.table(), "Estimates, standard errors and 95 % intervals")
    if fit.layout.held:
        held = ", ".join(f"{name} = {value:.6g}" for name, value in fit.layout.held.items())
        yield Words(f"Held, not estimated: {held}.")
    yield Words(words.assumption(fit))


def _scores(fit: Fit) -> Iterable[Block]:
    yield Grid.of(fit.score(), "Simulated against measured")
    yield Words(
        "signal_to_error is the ratio of signal to error in dB (16 is very good); fit_percent is 100 for a "
        "perfect simulation and 0 for one no better than the mean; r2 is the explained share of the "
        "variance; theil is 0 for perfect and 1 for worst. The model was fitted to these same samples: a "
        "record that was not used tells more."
    )
    facts = dict(fit.facts())
    yield Facts(
        tuple((name, facts[name]) for name in ("Trend", "Chi-square", "Condition", "Errors") if name in facts)
    )


# Against the data --------------------------------------------------------------------------------


def _bode(fit: Fit) -> Block:
    if not fit.inputs:
        raise SpecError("a free motion has no input, and so no frequency response")
    svg = drawn(lambda axes: plot.bode(fit, ax=axes), 2, height=2.5, sharex=True)
    return Figure(
        svg,
        f"Bode plot of {_paths(fit)}: magnitude above, phase below, each with its confidence band.",
        "Magnitude and phase with 95 % band (delta method). Dashed: not among the frequencies fitted.",
    )


def _paths(fit: Fit) -> str:
    return f"{', '.join(fit.inputs)} to {', '.join(fit.outputs)}"


def _responses(fit: Fit) -> Iterable[Block]:
    if fit.records is None:
        raise FitError("the samples are not kept with this fit, so there is nothing to simulate against")
    rows = 2 * len(fit.outputs)
    for k in range(min(len(fit.records), SHOWN)):
        of = f" of record {k}" if len(fit.records) > 1 else ""
        svg = drawn(partial(plot.response, fit, k), rows, height=1.7, sharex=True)
        yield Figure(
            svg,
            f"Measured and simulated {', '.join(fit.outputs)}{of} over time, and the error below.",
            f"Measured and simulated outputs{of}, and what is left. Simulated from the inputs alone; initial "
            "state and trend are fitted to the record.",
        )
    if len(fit.records) > SHOWN:
        yield Words(f"The first {SHOWN} of {len(fit.records)} records are drawn.")


def _residuals(fit: Fit) -> Iterable[Block]:
    fit._need_numbers("report")
    rows = 2 * len(fit.row_names)
    svg = drawn(partial(plot.residuals, fit), rows, height=2.0)
    yield Figure(
        svg,
        "Whitened residuals over the harmonics, and their autocorrelation, each with 95 % lines.",
        "Whitened residual lines (variance one where the model and its noise are right) and their "
        "autocorrelation; one point in twenty lies beyond the dashed lines.",
    )


def _tests(fit: Fit) -> Iterable[Block]:
    fit._need_numbers("report")
    yield plain_table(("asked", "of", "found", "objection"), words.tests(fit), "Tests of the residual lines")
    yield Words(
        f"A test objects where its p-value is below {UNLIKELY}: of right models one in a hundred does so by "
        "chance, in each test."
    )


def _poles(fit: Fit) -> Iterable[Block]:
    fit._need_numbers("report")
    if not fit.has_poles:
        raise SpecError("the equations are not linear, so they have no poles")
    svg = drawn(lambda axes: plot.poles(fit, ax=axes[0]), 1, height=4.0, width=6.5)
    yield Figure(
        svg, "Poles in the complex plane.", "Poles with 95 % confidence ellipses (real poles: intervals)."
    )
    yield Grid.of(fit.damp(), "Poles, natural frequencies and damping with standard errors (delta method)")


def _collinear(fit: Fit) -> Iterable[Block]:
    from ..collinear import diagnosed

    found = diagnosed(fit)
    yield Notes((f"Condition number {found.condition:.3g}.", *found.findings))
    yield Grid.of(found.table, "Variance inflation: how much of each regressor the others explain")


def _correlation(fit: Fit) -> Iterable[Block]:
    import numpy as np

    fit._need_numbers("report")
    errors = fit.bse
    with np.errstate(divide="ignore", invalid="ignore"):
        between = fit.cov_params() / np.outer(errors, errors)
    if len(errors) < 2:
        return
    header = ("", *fit.param_names)
    cells = [
        (name, *(f"{value:+.2f}" for value in row))
        for name, row in zip(fit.param_names, between, strict=True)
    ]
    yield plain_table(header, cells, "Correlation of the estimates")


# Provenance --------------------------------------------------------------------------------------


def _provenance(fit: Fit, command: str | None) -> Iterable[Block]:
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
    if fit.records is not None:
        yield from provenance.hashes(fit.records)
