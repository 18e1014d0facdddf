"""Doubts about a fit that need no test of its residuals: bounds, stability, samples, conditioning."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.cached import kept
from ..base.names import listed
from ..language.parser import Node
from ..models.free import Free
from ..records.check import bad_samples, remarks_for_fits
from ..records.conversion import mixed_angles
from ..records.record import Record
from ..records.spectra import spectrum_of
from .cures import amplified
from .diagnosis import fewest_samples, growth, level_p, overlapping, surely_stable
from .estimates import Estimates
from .known_start import contradicted_p
from .lags import none_seen
from .priors import contradicted_priors
from .response_call import output_error_call

__all__ = [
    "FINEST",
    "SURE",
    "Doubt",
    "biased",
    "clipped",
    "coded",
    "condition",
    "contradicted",
    "crowded",
    "eliminated",
    "few_samples",
    "in_hertz",
    "in_two_units",
    "joined",
    "may_integrate",
    "minima",
    "noise_bends",
    "noise_free",
    "numbers",
    "of_records",
    "of_samples",
    "on_bound",
    "pieces",
    "repeated",
    "rms",
    "unexpected",
    "unstable",
]

FEW_SAMPLES = 8.0  # a period of the highest harmonic
CONDITION = 1e6
SURE = 1e-4  # p-value below which a fit warns by itself
AGAINST = 0.005  # the same of a prior, one test: what a user told is rather wrong than so unlikely
FINEST = 1e-3  # of an output: finer residuals may be errors of the quadrature
BLOCK = 2**16  # samples
# Share of the outputs' power below the edge of a band: in the wrong unit at most, in the right at least.
MISSED, HELD = 0.5, 0.9
# An unstable mode that is one of the system shows: within the record it grows a thousandfold, and its pole is
# four standard errors from the axis.
VISIBLE, CERTAIN = math.log(1000.0), 4.0
TOLD = 3.0  # standard errors of a pole from 0, below which it may as well be there
# Noise, % of the output, below which nothing is said of the bias of "ls" and "wls". At 1 % it is a tenth to
# nine tenths of their scatter over bands of up to 20 lines, at 5 % up to twice the scatter.
LITTLE = 0.5
CURVED = 0.5  # second differences over first ones, of signals that noise moves by a standard deviation

NARROW = 1e-9  # s: what is closer to a bound is on it


@dataclass(frozen=True)
class Doubt:
    """Something doubtful about a fit, in two sentences: what, and the first cure to try.

    `sure`: the data contradict the model or a default beyond doubt, so that the fit warns by itself.
    """

    text: str
    sure: bool = True


def rms(values: NDArray[np.float64], mean: float) -> float:
    """Standard deviation; `std` makes a copy, as large as the record."""
    parts = (values[k : k + BLOCK] - mean for k in range(0, values.size, BLOCK))
    return math.sqrt(sum(float(np.sum(part * part)) for part in parts) / values.size)


def on_bound(fit: Estimates) -> Doubt | None:
    """That parameters ended on their bounds."""
    on = [name for name in fit.at_bound if name not in still_held(fit)]
    if not on:
        return None
    if len(on) == 1 and (text := none_seen(fit, on[0])):
        return Doubt(text)
    which, them = ("a bound", "it") if len(on) == 1 else ("bounds", "them")
    cure = (
        f"Leave {them} out, or take fewer poles: poles do what a delay does."
        if all(name.startswith("delay") and fit[name] == 0 for name in on)
        else f"Widen it, or hold {them} there if that is known."
    )
    ends = {name: bound_of(fit, name) for name in on}
    given = [f"{name} at {end[0]}" if len(on) > 1 else f"at {end[0]}" for name, end in ends.items() if end]
    if len(on) == 1 and (end := ends[on[0]]) and not end[1]:
        cure = (
            f"There the model has no value: try it without {on[0]}, or give a larger bound if one is known."
        )
    return Doubt(
        f"{', '.join(on)} ended on {which}: the data would have {them} elsewhere"
        f"{' than ' + listed(given) if given else ''}, and the other standard "
        f"errors hold only if the bound is right. {cure}"
    )


def bound_of(fit: Estimates, name: str) -> tuple[str, bool] | None:
    """The bound given by the user on which a parameter ended, and whether the estimate has its value."""
    told = dict(getattr(fit.structure, "params", ())).get(name)
    if not isinstance(told, Free):
        return None
    low = abs(fit[name] - told.min) <= abs(fit[name] - told.max)
    value = told.min if low else told.max
    return f"{'min' if low else 'max'}={value:.6g}", bool(fit[name] == value)


def still_held(fit: Estimates) -> list[str]:
    """Delays inside their bounds that a search which did not settle held for its last steps."""
    layout: Any = fit.layout
    if fit.success or not fit.at_bound or not layout.rational:
        return []
    late = [layout.paths[k] for k in layout.free_delays]
    return [
        path.name
        for path in late
        if path.name in fit.at_bound
        and max(path.delay.min, 0.0) + NARROW < fit[path.name] < path.delay.max - NARROW
    ]


def noise_bends(fit: Estimates) -> Doubt | None:
    """That noise does to a signal what its slope does not tell, so that a low criterion proves nothing."""
    if fit.layout.rational:
        return None
    bend = getattr(fit, "bend", 0.0)  # of equations
    if not bend > CURVED:
        return None
    layout: Any = fit.layout
    inside = {fit.param_names[k] for _, k, _ in layout.formulas.words["signal_slopes"]}
    names = [name for name in fit.param_names if name in inside]
    return Doubt(
        f"The noise of the outputs moves the terms with {listed(names)} inside by more than their slopes "
        f"tell (by {bend:.2g} times as much in second differences as in first), and such terms follow any "
        f"record. First try closer bounds, params={{{names[0]!r}: mf.Free(start, min=..., max=...)}}."
    )


def eliminated(fit: Estimates) -> Doubt | None:
    """That estimates and intervals are biased by products which the elimination of a hidden signal has left.

    The window of the polynomials that smooth these follows the noise, and so does their bias: of two tanks
    and of a Lorenz system estimates were 2 to 25 standard errors off at noise of any level.
    """
    if not amplified(fit) or getattr(fit, "by_response", False) or noise_free(fit) is not None:
        return None
    layout: Any = fit.layout  # that of equations
    hidden = listed(layout.compiled.hidden)
    return Doubt(
        f"Eliminating {hidden} has left products of a signal and a derivative, which amplify noise and are "
        "smoothed: estimates are biased by several of their standard errors whatever the noise, and "
        f"intervals do not hold. First measure {hidden}, or fit the response itself from here, "
        f"{output_error_call(fit)}(rec)."
    )


def repeated(fit: Estimates) -> Doubt | None:
    """That samples are counted twice: records that overlap, or outputs that are the same."""
    records = fit.records or ()
    for name, other in combinations(fit.outputs, 2):
        if records and all(np.array_equal(rec[name], rec[other]) for rec in records):
            return Doubt(
                f"Outputs {name!r} and {other!r} are the same samples: they count as two measurements, and "
                "the errors are too small. Leave one out."
            )
    pair = overlapping([rec.y for rec in records])
    if pair is None:
        return None
    first, second, count = pair
    return Doubt(
        f"Records {first} and {second} share {count} samples of the outputs: they count as new data, and the "
        "errors are too small. Give each sample once; cut windows without overlap."
    )


def few_samples(fit: Estimates) -> Doubt | None:
    """That the highest lines are sampled too slowly for the quadrature; held inputs need none.

    Of a band that was given, or that methods without a rule take: the rule goes there only where residuals
    stay at their level, for the few lines of short records, whose residuals hold that error, or to tell kinds
    of noise apart.
    """
    samples, options = fewest_samples(fit), fit.options
    given = options.band is not None or options.harmonics is not None
    by_rule = fit.band_rule is not None or options.drives
    exact = fit.exact_lines or getattr(fit, "by_response", False)
    if samples >= FEW_SAMPLES or exact or (by_rule and not given):
        return None
    return Doubt(
        f"The highest harmonic used, {fit.band[1]:.4g} rad/s, has {samples:.1f} samples a period; below "
        f"{FEW_SAMPLES:.0f} quadrature errors grow: lower the band or sample faster.",
        sure=False,
    )


def crowded(fit: Estimates) -> bool:
    """Whether signals of few samples reach into the upper half of the lines, where the noise level is read.

    Of prey and predators, 10 samples a period, the level of 24 samples was 2.2 times the noise.
    """
    return fit.band_rule is not None and not fit.layout.rational and fewest_samples(fit) < FEW_SAMPLES


def in_hertz(fit: Estimates) -> Doubt | None:
    """That the band was given in Hz: it leaves out most of the motion, but would hold it in that unit."""
    if fit.options.band is None or not fit.records:
        return None
    edge = fit.options.band[1]
    for rec in fit.records:
        seen = spectrum_of(rec)
        power = np.sum([seen[name] ** 2 for name in rec.outputs], axis=0)
        within, meant = (
            float(power[seen.omega <= top].sum() / max(power.sum(), 1e-300))
            for top in (edge, 2 * math.pi * edge)
        )
        if within > MISSED or meant < HELD:
            return None
    return Doubt(
        f"The band ends at {edge:.4g} rad/s, below {100 * (1 - within):.0f} % of the power of the outputs. "
        f"If the edge was meant in Hz, give band={2 * math.pi * edge:.4g}.",
        sure=False,
    )


def unstable(fit: Estimates) -> Doubt | None:
    """That a pole is unstable; beyond doubt wrong where it is fast and yet not told from a stable one."""
    if not fit.has_poles:
        return None
    if fit.layout.rational and all(map(surely_stable, fit.layout.denominators(fit.params))):
        return None
    growing, longest = growth(fit), 2 * math.pi / min(fit.omega0)
    slow = not fit.layout.rational and growing * longest < math.log(2)  # such as the spiral of an aircraft
    if growing <= 0 or slow:
        return None
    visible = growing * longest > VISIBLE
    doubtful = fit.layout.rational and visible and growing < CERTAIN * _growing(fit, fit.cov_params())[1]
    if may_integrate(fit):
        return None  # which `slow_pole` says
    cure = f"try another number of poles, select_order{_stable_words(fit)}"
    if not fit.layout.rational:
        cure = "look for a term, a sign or a unit that is wrong"
    return Doubt(
        f"The estimate is unstable: a pole has real part {growing:.4g} rad/s (time to double "
        f"{math.log(2) / growing:.3g} s). This is right for an unstable system; otherwise first {cure}.",
        doubtful,
    )


def of_stability(fit: Estimates) -> str | None:
    """What it cost that poles were kept stable."""
    if not math.isfinite(fit.stability_cost):
        return None
    from scipy.special import chdtrc

    # A pole at the border: half of chi-square with one degree of freedom.
    p = 0.5 * float(chdtrc(1, max(fit.stability_cost, 0.0)))
    said = (
        "as a stable system explains by chance"
        if p > 0.05
        else "more than chance: the system may be unstable"
    )
    return (
        f"The poles were kept stable, which raises -2 log likelihood by {fit.stability_cost:.3g} "
        f"(p = {p:.2g}), {said}."
    )


def _stable_words(fit: Estimates) -> str:
    return ", or the nearest stable model, fit.stable()" if fit.layout.rational and fit.inputs else ""


def may_integrate(fit: Estimates) -> str:
    """That noise alone may have moved a pole to the right of 0, and what holds it there; "" of others."""
    if not (
        fit.layout.rational and fit.omega0 and 0 < growth(fit) * 2 * math.pi / min(fit.omega0) <= VISIBLE
    ):
        return ""
    i, error, pole = _growing(fit, fit.cov_nonrobust)  # others take long for long records
    name = fit.layout.names[fit.layout.places[0][i] + fit.layout.orders[i] - 1]
    if pole.imag or pole.real > TOLD * error or name not in fit.param_names:
        return ""
    return (
        f"A pole is not told from 0: its real part is {pole.real:.3g} ± {error:.2g} rad/s. If the system "
        f"integrates, say so, params={{{name!r}: 0.0}}."
    )


def _growing(fit: Estimates, cov: F64) -> tuple[int, float, complex]:
    """The output of the pole with the largest real part, the standard error of that part, and the pole."""
    found = (0, 0.0, complex(-math.inf))
    for _, i in fit.denominators():
        poles, slopes = fit.pole_gradients(i)
        at = int(np.argmax(poles.real))
        if poles[at].real > found[2].real:
            slope = slopes[at].real
            error = math.sqrt(max(float(slope @ cov @ slope), 0.0))
            found = (i, error, complex(poles[at]))
    return found


def minima(fit: Estimates) -> Doubt | None:
    """That the two starts of the default rule ended at different fits: a remark of the search."""
    rule = fit.band_rule
    if rule is None or not fit.layout.rational:
        return None
    wide, narrow = rule["cost_wide"], rule["cost_narrow"]
    # Of several outputs the costs are N log det of the noise's covariance: absolute differences count.
    apart = 1e-6 * min(wide, narrow) if len(fit.outputs) == 1 else 0.01
    if not (np.isfinite(wide) and np.isfinite(narrow)) or abs(wide - narrow) <= apart:
        return None
    return Doubt(
        f"Two minima were found over the wide band, with costs {min(wide, narrow):.6g} and "
        f"{max(wide, narrow):.6g}; the lower one was taken. Often a delay is missing from the structure, or "
        "it has too many poles.",
        sure=False,
    )


def unexpected(fit: Estimates) -> Doubt | None:
    """That the records contradict what was known of parameters beforehand."""
    p, name = contradicted_priors(fit)
    if not p <= 0.01:
        return None
    told = {fit.param_names[k]: (mean, sd) for k, mean, sd in fit.layout.priors}
    mean, sd = told[name]
    return Doubt(
        f"The record contradicts what was told of {name} beforehand, {mean:.4g} ± {sd:.3g} (p = {p:.2g}), "
        f"and the estimate, {fit[name]:.4g}, is a compromise. First fit without the prior, "
        f"params={{{name!r}: mf.Free()}}.",
        sure=p < AGAINST,
    )


def contradicted(fit: Estimates) -> Doubt | None:
    """That the records do not begin as they were said to."""
    told = fit.options.initial_state
    if told == "unknown" or not fit.records:
        return None
    spread = max(rms(rec.y[0], float(rec.y[0].mean())) for rec in fit.records)
    p = contradicted_p(fit)
    if p > 0.01 or not math.sqrt(fit.noise_cov[0, 0]) > FINEST * spread:
        return None
    words = {
        "rest": "begin at rest", "zero": "begin with zero initial state",
        "periodic": "hold whole periods of a steady response",
    }  # fmt: skip
    begin = words[told] if isinstance(told, str) else "begin in the given state"
    return Doubt(
        f"The record does not {begin} (p = {p:.2g}), and the estimates are biased where it does not. "
        'First try initial_state="unknown".',
        sure=p < SURE,
    )


def condition(fit: Estimates) -> Doubt | None:
    """That the parameters can hardly be told apart."""
    if fit.condition_bound <= CONDITION or fit.cond <= CONDITION:
        return None
    return Doubt(
        f"The regressors are nearly dependent (condition number {fit.cond:.2g}). Take fewer poles or zeros, "
        "or a record with more excitation."
    )


def biased(fit: Estimates) -> Doubt | None:
    """That one-shot estimates are biased by noise, unless the high band shows next to none."""
    method = fit.options.method
    if method not in ("ls", "wls") or fit.options.noise == "equation" or fit.records is None:
        return None
    spread = np.sqrt(np.mean([rec.y.var(axis=1) for rec in fit.records], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = 100 * float(np.max(fit.high_band_levels / spread))
    if noise < LITTLE:
        return None
    seen = (
        f" (here noise of {noise:.2g} % of the output is seen in the unused high band)" if noise > 0 else ""
    )
    return Doubt(
        f'method="{method}" is biased by noise on the output{seen}, the more the wider the band, and no '
        'standard error counts that: compare with method="ml".',
        sure=False,
    )


def noise_free(fit: Estimates) -> str | None:
    """That there is no noise to test residuals against: they may be errors of the quadrature."""
    if not fit.records or fit.noise_cov.shape != (len(fit.outputs),) * 2 or fit.process_levels is not None:
        return None
    levels = np.sqrt(np.diag(fit.noise_cov))
    ys = [rec.y for rec in fit.records]
    if fit.options.noise == "log-normal":  # levels are those of the logarithms
        with np.errstate(divide="ignore", invalid="ignore"):
            ys = [np.log(y) for y in ys]
    spread = np.sqrt([
        np.mean([rms(y[i], float(y[i].mean())) ** 2 for y in ys]) for i in range(len(fit.outputs))
    ])  # fmt: skip
    # One scale for all outputs does not say in which of them the errors are.
    each = levels / spread
    if not (np.all(each < 3 * FINEST) and np.mean(np.log(each)) < math.log(FINEST)):
        return None
    return (
        f"There is no noise to test the residuals against: they are {numbers(each)} of the output "
        "(rms), as errors of the quadrature may be."
    )


def coded(fit: Estimates) -> Doubt | None:
    """That a channel has codes for missing values, beside which nothing else of it counts."""
    return of_samples(fit, codes_only=True)


def of_samples(fit: Estimates, *, codes_only: bool = False) -> Doubt | None:
    """The first code, or else dropouts or outlying samples, of the records."""
    for k, rec in enumerate(fit.records or ()):
        if text := _first(rec, codes_only):
            return Doubt(text if len(fit.records or ()) == 1 else f"Record {k}: {text}")
    return None


@kept
def _first(rec: Record, codes_only: bool) -> str:
    """The first of a record, in words."""
    return next(bad_samples(rec, codes_only=codes_only), "")


def clipped(fit: Estimates) -> Doubt | None:
    """That an output sits at an extreme, which residuals show as a system that is not linear."""
    return _remark(fit, "clipped")


def joined(fit: Estimates) -> Doubt | None:
    """That a record is two, end to end, which residuals show as noise that drives the system."""
    return _remark(fit, "joint")


def _remark(fit: Estimates, what: str) -> Doubt | None:
    """The first remark of a kind about a record or an output."""
    for rec in fit.records or ():
        for kind, channel, text in remarks_for_fits(rec):
            if kind == what and channel in ("", *rec.outputs):
                return Doubt(text)
    return None


def pieces(fit: Estimates) -> Iterator[tuple[str, Node]]:
    """Each piece of the texts of equations, with its text; none of transfer functions."""
    for text in getattr(fit.structure, "parsed", ()):
        yield from ((text.text, node) for node in text.tree.walk())


def in_two_units(fit: Estimates) -> Doubt | None:
    """That equations go between outputs with angles in degrees and in radians; free gains may make up."""
    if fit.layout.rational or not fit.records:
        return None
    text = next(mixed_angles(fit.records[0]), None)  # all have the same units
    return Doubt(text, sure=not fit.success or level_p(fit) < SURE) if text else None


def of_records(fit: Estimates, said: Sequence[str]) -> list[Doubt]:
    """Remarks of the records' own check that bear on the fit, unless the fit has said more of it."""
    found: dict[tuple[str, str], str] = {}  # of many records the first
    for k, rec in enumerate(fit.records or ()):
        for kind, channel, text in remarks_for_fits(rec):
            found.setdefault((kind, channel), text if k == 0 else f"Record {k}: {text}")
    held = any("intersample=" in text for text in said)
    return [
        Doubt(text, sure=False)
        for (kind, _), text in found.items()
        if not (held and kind == "between") and text not in said
    ]


def numbers(values: Any) -> str:
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(values))
