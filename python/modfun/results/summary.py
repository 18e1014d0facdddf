"""A fit in words: its line, its summary. What is doubtful about it: `check`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from ..base import html
from ..base.between import BY_FIT, CLOSE, LOOP, OPEN
from ..base.names import nearest
from ..base.student import root, student_p
from ..base.tables import Findings, Table
from ..errors import SpecError
from ..models.noise import Noise
from ..records.spectra import too_short
from .band_end import end_in_words
from .diagnosis import chi_square, level_p, level_ratio
from .doubts import numbers, still_held
from .estimates import Estimates
from .misfit import too_large, too_small
from .priors import contradicted_priors, known_beforehand
from .process_noise import in_words
from .sample_levels import beside_samples, seen_noise
from .starts import starts

__all__ = ["Summary", "facts", "one_line", "parameters"]


MANY = 8  # records whose noise levels are listed, and samples that are trusted least
SPIKE = 3.0  # times the record's usual noise: a sample that is named
START = {
    "rest": "at rest, taken as known",
    "zero": "zero initial state, taken as known",
    "periodic": "whole periods of a steady response, taken as known",
}


def one_line(fit: Estimates, doubts: int | None = 0) -> str:
    """A fit on one line, with the number of doubts about it; None: not all were looked for."""
    stuck = dict.fromkeys(fit.at_bound, " (on its bound)") | dict.fromkeys(still_held(fit), " (held)")
    numbers = ", ".join(
        f"{name}={value:.5g}{stuck.get(name, f'±{error:.2g}')}"
        for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True)
    )
    said = f", {doubts} doubt{'s' if doubts > 1 else ''} in check()" if doubts else ""
    said = ", check() looks further" if doubts is None else said
    return f"Fit({_path(fit)}, {fit.options.method}, {fit.status}{said}: {numbers})"


def _start(fit: Estimates) -> str:
    """What was known of the initial states."""
    told = fit.options.initial_state
    if isinstance(told, str):
        pairs = zip(fit.with_past or (), fit.records or (), strict=False)
        before = ", ".join(str(rec.t.size - own.t.size) for rec, own in pairs)
        return START[told] + (f", as {before} samples before the first" if before else "")
    return f"{'; '.join(numbers(np.array(state)) for state in told[:4])}, taken as known"


def _prior(fit: Estimates) -> str:
    """What was known of parameters beforehand, and how far the record agrees."""
    p, _ = contradicted_priors(fit)
    told = f"{', '.join(known_beforehand(fit))}; the record"
    if not isfinite(p):
        return f"{told} says nothing beside it"
    return f"{told} {'agrees' if p > 0.01 else 'does not agree'} (p = {p:.2g})"


def _path(fit: Estimates) -> str:
    names = ", ".join(fit.outputs)
    return f"{', '.join(fit.inputs)} -> {names}" if fit.inputs else f"free motion of {names}"


def _read(fit: Estimates) -> str:
    """Inputs that nobody declared and whose samples did not decide how they go between them."""
    return ", ".join(
        f"{name} {word}"
        for rec in (fit.records or ())[:1]
        for name, word in zip(rec.inputs, rec._between_words(), strict=True)
        if rec._seen.get(name) in (BY_FIT, CLOSE, LOOP, OPEN)
    )


class Summary:
    """The fit on one page: prints as text, shows as HTML in a notebook."""

    def __init__(
        self, facts: Sequence[tuple[str, str]], parameters: Table, poles: Table | None, findings: Findings
    ) -> None:
        self.facts, self.parameters, self.poles, self.findings = facts, parameters, poles, findings

    def __str__(self) -> str:
        width = max(len(name) for name, _ in self.facts)
        lines = [f"{name.ljust(width)}  {text}" for name, text in self.facts]
        rule = "-" * 88
        parts = ["\n".join(lines), str(self.parameters)]
        if self.poles is not None:
            parts.append(str(self.poles))
        said = [f"* {text}" for text in self.findings] or [f"Checks: {self.findings.nothing}"]
        note = [self.findings.note] if self.findings and self.findings.note else []
        parts.append("\n".join([*said, *note]))
        return f"\n{rule}\n".join(parts)

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        parts = [html.table(("", ""), self.facts), self.parameters._repr_html_()]
        if self.poles is not None:
            parts.append(self.poles._repr_html_())
        title = "Checks" if self.findings else f"Checks: {self.findings.nothing}"
        parts.append(html.listing(self.findings, title=title))
        parts.append(html.listing((), title=self.findings.note if self.findings else ""))
        return "".join(parts)


def facts(fit: Estimates) -> list[tuple[str, str]]:
    """What stands above the parameters in the summary of a fit of records."""
    late = "".join(f", {name} delayed {delay:.6g} s" for name, delay in fit.layout.known_delays)
    held = [f"{name} = {value:.6g}" for name, value in fit.layout.held.items()]
    late += f"; held: {', '.join(held)}" if held else ""
    spans = [
        f"{n} intervals in {2 * np.pi / w:.6g} s" for n, w in zip(fit.intervals, fit.omega0, strict=True)
    ]
    return [
        ("Model", f"{_path(fit)}: {fit.structure}{late}"),
        ("Records", f"{len(spans)}: {'; '.join(spans[:4])}{'; ...' if len(spans) > 4 else ''}"),
        *([("Inputs", read)] if (read := _read(fit)) else []),
        *([("Weights", f"of the records: {numbers(fit.window_weights)}")] if fit.window_weights else []),
        ("Method", f"{fit.options.method}; {fit.status}. {fit.message}"),
        ("Band", _band(fit)),
        (
            "Trend",
            f"{fit.trend or 'none'}{' (default for this structure)' if fit.options.trend == 'auto' else ''}",
        ),
        *([("Start", _start(fit))] if fit.options.initial_state != "unknown" else []),
        *([("Prior", _prior(fit))] if fit.layout.priors else []),
        *([("Reference", _reference(fit))] if fit.options.reference else []),
        ("Noise", _noise(fit)),
        *([("Tails", tails(fit))] if isfinite(fit.tail) else []),
        ("Chi-square", _chi2(fit)),
        ("Condition", f"{fit.cond:.4g} (whitened, scaled regressors)"),
        ("BIC", f"{fit.bic:.5g} on this band; mf.compare puts models on one band"),
        ("Errors", f"{fit.cov_type}; Student's t with {_degrees(fit)} degrees of freedom"),
    ]


def _reference(fit: Estimates) -> str:
    """The references, taken as free of noise, and what they explain of each input."""
    text = f"{', '.join(fit.options.reference)}, taken as free of noise"
    if fit.records is None or fit.instrumented is None:
        return text
    pairs = list(zip(fit.records, fit.instrumented, strict=True))
    shares = [
        sum(np.var(part.u[j]) * part.u[j].size for _, part in pairs)
        / sum(np.var(rec.u[j]) * rec.u[j].size for rec, _ in pairs)
        for j in range(len(fit.inputs))
    ]
    said = " and ".join(
        f"{100 * share:.3g} % of {name}" for share, name in zip(shares, fit.inputs, strict=True)
    )
    return f"{text}; explains {said}"


def tails(fit: Estimates) -> str:
    """Student's t of a robust fit, and the samples that are trusted least."""
    text = f"Student's t with {fit.tail:.3g} degrees of freedom"
    found = [
        (own[k] / np.median(own), f"{name} at t = {rec.t[k]:.6g}")
        for rec in fit.records or ()
        if rec.sigma is not None
        for name, own in zip(rec.outputs, rec.sigma, strict=True)
        for k in np.flatnonzero(own > SPIKE * np.median(own))
    ]
    if not found:
        return text
    named = [words for _, words in sorted(found, reverse=True)[:MANY]]
    more = f" and {len(found) - len(named)} more" if len(found) > len(named) else ""
    return f"{text}; trusted least: {', '.join(named)}{more}"


def _degrees(fit: Estimates) -> str:
    """One number, or the range of those of the parameters, few where few lines carry one."""
    free = np.append(fit.degrees, fit.df_resid) if not fit.params.size else np.atleast_1d(fit.degrees)
    few, many = float(np.min(free)), float(np.max(free))
    return f"{few:.4g}" if few == many or not np.isfinite(many) else f"{few:.3g} to {many:.3g}"


def _band(fit: Estimates) -> str:
    low, high = fit.band
    lines = ", ".join(f"{lo} to {hi}" for lo, hi in dict.fromkeys(fit.lines))
    text = f"{low:.4g} to {high:.4g} rad/s (lines {lines})"
    rule = fit.band_rule
    if getattr(fit, "by_response", False):  # of equations
        return f"{text}, from which a search went on to least squares of the response"
    if rule is not None:
        return (
            f"{text}: chosen as the narrowest whose standard errors are within 1 % of those up to line "
            f"{rule['k_max']:.0f}; started there and from the fit up to line {rule['k_0']:.0f}"
            f"{'; then doubled as long as errors fell' if 'doubled' in rule else ''}"
            f"{end_in_words(fit)}{'; widened for the noise level' if 'widened' in rule else ''}"
            f"{_why_narrowed(fit) if 'narrowed' in rule else ''}"
        )
    if fit.options.band is not None:
        return f"{text}: given as band"
    if fit.options.harmonics is not None:
        return f"{text}: given as harmonics M = {fit.options.harmonics}"
    if any([rec.functions for rec in fit.records or ()]):
        return f"{text}: four fifths of all lines, as inputs are known at all times"
    if fit.options.method in ("ml", "awls"):
        samples = "16/3 samples a period, to tell noise of both kinds apart"
        return f"{text}: down to {samples if fit.options.drives else 'eight samples a period'}"
    return f"{text}: M = 3 times the number of unknowns"


def _why_narrowed(fit: Estimates) -> str:
    uneven = any([step is None for step in fit.steps])
    what = "sums over uneven samples err" if uneven else "the search fails"
    return f"; narrowed, as {what} beyond"


def _noise(fit: Estimates) -> str:
    if fit.process_levels is not None:
        return in_words(fit)
    if fit.options.noise == "equation":
        return f"white equation error; level {numbers(fit.sigma)}"
    if fit.options.method in ("ls", "wls"):
        return f"not used by {fit.options.method}; level of the equation error {fit.sigma:.4g}"
    kind = {
        "coloured": "an autoregression fitted to the residuals",
        "errors-in-variables": "white on outputs and inputs, levels from the unused high band",
        "log-normal": "white on the logarithms of the outputs",
    }.get(fit.options.noise if isinstance(fit.options.noise, str) else "", "white")
    if isinstance(fit.options.noise, Noise):
        kind = f"as given, {fit.options.noise!r}"
    text = f"{kind}; standard deviation on {', '.join(fit.outputs)}: {numbers(fit.sigma)}"
    levels = fit.noise_levels
    if len(levels) > 1 and np.ptp(levels, axis=0).any():
        each = "; ".join(f"record {k}: {numbers(own)}" for k, own in enumerate(levels[:MANY]))
        text += f" (geometric mean; {each}{'; ...' if len(levels) > MANY else ''})"
    if len(fit.outputs) > 1:
        level = np.sqrt(np.diag(fit.noise_cov))
        between = fit.noise_cov / np.outer(level, level)
        strongest = np.max(np.abs(np.triu(between, 1)))
        text += f", correlated up to {strongest:.2f}" + (
            " (weights as given)" if fit.options.output_weights is not None else ""
        )
    if beside_samples(fit):
        seen, _, levels = seen_noise(fit)
        return f"{text}; {seen} {numbers(levels)}" if np.isfinite(fit.chi2) else text
    of_lines = not getattr(fit, "by_response", False)  # levels of a response are those of its own residuals
    if of_lines and fit.noise_scale == fit.noise_scale:
        return f"{text}, {np.sqrt(fit.noise_scale):.3g} times what was expected"
    if fit.options.noise == "coloured" or not np.all(np.isfinite(fit.high_band_levels)):
        return text
    return f"{text}; in the unused high band {numbers(fit.high_band_sigma)}"


def _no_level(fit: Estimates) -> str:
    """Why no level of noise is known that the residuals could be judged by."""
    if not np.all(np.isfinite(fit.params)):
        return "there is no estimate"
    if fit.options.method not in ("awls", "ml"):
        return f'method="{fit.options.method}" does not weigh by the noise'
    if fit.process_levels is not None:
        return "the levels of the noise are estimated from the same residuals"
    if fit.options.noise in ("equation", "coloured"):
        return f'noise="{fit.options.noise}" comes without a level'
    if fit.records is None:
        return "a loaded fit has no samples"
    if any(rec.mask is not None or rec.sigma is not None for rec in fit.records):
        return "records with a mask or a sigma show no level in an unused band"
    if any(rec.dt is None for rec in fit.records):
        return "uneven samples show no level beside their neighbours"
    if any(too_short(rec.t.size, max(fit.layout.orders)) for rec in fit.records):
        return "so few samples leave no band that shows the noise"
    if not fit.layout.rational:
        return "these equations need no level of noise; give one, noise=mf.Noise(y=...)"
    return "the lines used leave no band that shows the noise"


def _chi2(fit: Estimates) -> str:
    if np.isnan(fit.chi2) or not np.all(np.isfinite(fit.params)):
        return f"not available ({_no_level(fit)})"
    p = level_p(fit)
    seen = "level beside neighbouring samples" if beside_samples(fit) else "high band's level"
    verdict = (
        f"residuals above the {seen}: model too simple, or filtered record"
        if too_large(p)
        else f"residuals below the {seen}"
        if fit.success and too_small(p, level_ratio(fit))
        else "as it should be"
    )
    chi2, df = chi_square(fit)
    return f"{chi2:.4g} for {df:g} degrees of freedom (p = {p:.2g}): {verdict}"


def parameters(
    fit: Estimates,
    level: float = 0.95,
    units: Mapping[str, str] | None = None,
    initial: bool = False,
    pvalues: bool = False,
) -> Table:
    """Table of the parameters; see `Fit.table`."""
    interval = fit.conf_int(level)
    for name in units or {}:
        if name not in fit.param_names:
            raise SpecError(
                f"table: units names {name!r}, which is not a parameter; {nearest(name, fit.param_names)}"
            )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = fit.params / fit.bse
    low, high = _percentages(level)
    where = "held by a search that did not settle" if still_held(fit) else "on a bound"
    note = f"{', '.join(fit.at_bound)} {where}: no error of its own; the others' hold if the bound is right"
    columns: dict[str, Any] = {
        "parameter": list(fit.param_names),
        "value": fit.params,
        **({"unit": [units.get(name, "") for name in fit.param_names]} if units else {}),
        "se": fit.bse,
        "t": ratio,
        **({"p": student_p(ratio, fit.degrees)} if pvalues else {}),
        low: interval[:, 0],
        high: interval[:, 1],
    }
    if initial:
        columns = _with_starts(fit, level, columns)
    return Table(columns, title=note if fit.at_bound else None)


def _with_starts(fit: Estimates, level: float, columns: dict[str, Any]) -> dict[str, Any]:
    """The columns with a row for each initial state and trend of a record."""
    if not fit.records:
        raise SpecError("table: initial=True needs the records of the fit, and this one was loaded without")
    names, values, variances = starts(fit)
    used = root(variances)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(used > 0, values / used, np.nan)
    low, high = fit.interval(values, used, level)
    *_, low_name, high_name = columns
    more: dict[str, Any] = {
        "parameter": names, "value": values, "unit": [""] * len(names), "se": used, "t": ratio,
        "p": student_p(ratio, fit._fewest_degrees()), low_name: low, high_name: high,
    }  # fmt: skip
    return {name: np.concatenate([np.asarray(own), np.asarray(more[name])]) for name, own in columns.items()}


def _percentages(level: float) -> tuple[str, str]:
    """Headings of both ends of an interval, with as many digits as tell them apart."""
    for digits in (4, 8, 15):
        low, high = (f"{50 * (1 + side * level):.{digits}g} %" for side in (-1, 1))
        if low != high:
            return low, high
    return "low", "high"
