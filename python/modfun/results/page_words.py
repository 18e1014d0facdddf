"""What a fit says for itself, in words: the verdict, what standard errors rest on, how it was called."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from ..base.tables import Findings
from ..errors import ModfunError
from ..models.noise import Noise
from ..models.process import ProcessNoise
from .diagnosis import chi_square, diagnose
from .estimates import Estimates
from .line_tests import Whiteness, colour_of_lines, correlation_of_lines
from .misfit import UNLIKELY
from .scores import score

__all__ = ["assumption", "python_call", "tests", "verdict"]

# What is asked by tests of further columns, of a channel.
ASKED = {
    "response": "nothing of {} left",
    "gain": "linear in {}",
    "power": "linear in {}",
    "change": "{} unchanged over time",
    "drift": "no drift of {}",
    "event": "no event in {}",
    "spike": "no sample of {} alone",
}
_OWN = re.compile(r"\b(TransferFunction|Equation|StateSpace|Free|Noise)\(")


def verdict(fit: Estimates, found: Findings) -> tuple[str, str, tuple[str, ...]]:
    """A sentence, its tone, and the findings behind it."""
    if not fit.usable:
        return f"There is no usable estimate (status {fit.status}).", "bad", (fit.message,)
    findings = tuple(found)
    shares = _shares(fit)
    told = f"{_explained(fit, shares)} {found.note}".strip()
    if not fit.success:
        return f"Not to be used as it is: the fit did not settle. {told}", "bad", findings
    if shares is not None and np.any(shares <= 0):
        return (
            f"Not to be used: a constant describes an output better than the model. {told}",
            "bad",
            findings,
        )
    if findings:
        count = f"{len(findings)} thing{'s' if len(findings) > 1 else ''}"
        return (
            f"Usable with reservations: the checks found {count} wrong or doubtful. {told}",
            "doubtful",
            findings,
        )
    return f"The checks found nothing wrong. {told}", "good", ()


def _shares(fit: Estimates) -> Any:
    """R² of each output and record; None where the model cannot be simulated."""
    try:
        return np.asarray(score(fit)["r2"], dtype=float)
    except (ModfunError, FloatingPointError, OverflowError, np.linalg.LinAlgError):
        return None


def _explained(fit: Estimates, share: Any) -> str:
    """How much of the outputs the model explains, and which parameters it hardly knows."""
    said = []
    if share is not None and np.all(share > 0):
        several = len(fit.outputs) > 1 or len(fit.records or ()) > 1
        low, high = (float(f(share)) for f in (np.min, np.max))
        if math.isfinite(low):
            of = (
                "of the measured variation of each output"
                if several
                else f"of the variation of {fit.outputs[0]}"
            )
            amount = f"{100 * low:.4g} %" if not several else f"{100 * low:.4g} to {100 * high:.4g} %"
            said.append(f"Simulated from the inputs, never one step ahead, the model explains {amount} {of}.")
    with np.errstate(divide="ignore", invalid="ignore"):
        weak = [n for n, v, e in zip(fit.param_names, fit.params, fit.bse, strict=True) if not abs(v) > 2 * e]
    weak = [name for name in weak if name not in fit.at_bound]
    if weak:
        said.append(
            f"{', '.join(weak)} {'is' if len(weak) == 1 else 'are'} within two standard errors of zero."
        )
    return " ".join(said)


def assumption(fit: Estimates) -> str:
    """What the standard errors and intervals rest on."""
    if fit.cov_type == "gains":
        return (
            "Standard errors come from those of the gains that were fitted, enlarged where the misfit is "
            "larger than these. Intervals are 95 %, Student's t."
        )
    kind = fit.options.noise
    if isinstance(kind, Noise):
        noise = "noise as it was given"
    elif isinstance(kind, ProcessNoise):
        noise = f"noise that enters through {', '.join(kind.names)}, and white noise on the outputs"
    else:
        noise = {
            "output": "white noise on the outputs, of unknown level",
            "equation": "white noise in the equation",
            "process": "white noise that drives the system, and white noise on the output",
            "coloured": "noise of the fitted colour on the outputs",
            "errors-in-variables": "white noise on outputs and inputs",
            "log-normal": "white noise on the logarithms of the outputs",
        }[kind]
    whole = noise if fit.process_levels is not None else None
    rest = {
        "spectral": whole
        or f"{noise.replace('white noise', 'noise of any smooth spectrum')}; that spectrum is "
        "estimated from the residual lines",
        "HC3": "residual lines that are independent, and nothing about the colour of the noise",
        "nonrobust": noise,
    }[fit.cov_type]
    return (
        f"The standard errors assume {rest}. The 95 % intervals are Student's t. Neither covers errors of "
        "the model itself."
    )


def tests(fit: Estimates) -> list[tuple[str, str, str, str]]:
    """Tests of the residual lines: what is asked, of what, the figure, and the answer."""
    rows = []
    for i, name in enumerate(fit.row_names):
        pieces = [piece[i] for piece in fit.pieces]
        near, _ = correlation_of_lines(pieces)
        rows.append(("neighbouring lines uncorrelated", name, *_answer("Ljung-Box", near)))
        level, ratio = colour_of_lines(pieces)
        rows.append(
            (
                "one level over the band",
                name,
                *_answer(f"lower half {ratio:.3g} × upper, Kolmogorov-Smirnov", level),
            )
        )
    found = diagnose(fit)
    if math.isfinite(found.chi2_p):
        chi2, df = chi_square(fit)
        figure = f"chi-square {chi2:.4g} of {df:g}, p = {found.chi2_p:.2g}"
        rows.append(("level as the noise explains", "all", figure, _said(found.chi2_p)))
    for one in found.further:
        if math.isfinite(one.p_value):
            answer = _said(one.p_value, len(found.further))
            rows.append((ASKED[one.what].format(one.channel), "all", f"p = {one.p_value:.2g}", answer))
    return rows


def _answer(name: str, test: Whiteness) -> tuple[str, str]:
    if math.isnan(test.p_value):
        return "too few lines", "not tested"
    return f"{name} {test.statistic:.3g}, p = {test.p_value:.2g}", _said(test.p_value)


def _said(p_value: float, of: int = 1) -> str:
    return "objects" if p_value < UNLIKELY / of else "no objection"


def python_call(fit: Estimates) -> list[str]:
    """The call that makes the fit again."""
    options = "".join(f", {name}={value!r}" for name, value in fit.options.given().items())
    count = len(fit.records or ())
    several = f"[{', '.join(f'rec{k}' for k in range(count))}]" if count <= 4 else "records"
    data = "frf" if fit.cov_type == "gains" else "rec" if count < 2 else several
    made = f"fit = mf.fit({data}, {fit.structure!r}{options})"
    lines = [_OWN.sub(r"mf.\1(", made)]
    for k, rec in enumerate((fit.records or ())[:4]):
        if rec.source is not None:
            name = "rec" if count < 2 else f"rec{k}"
            lines.insert(k, f"# {name}: of {rec.source.name}, with the samples and words under Data")
    return ["import modfun as mf", *lines]
