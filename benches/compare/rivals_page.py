"""docs/rivals.md from the figures of accuracy.py."""

import os

import numpy as np
import problems
from competitors import COMPETITORS
from field_benchmark import SNR
from report import amount

ENOUGH = 50  # records to be judged by
BASE = "modfun ml, trend=None"  # who is told as much as the rivals: that there is no offset
SAME = 0.03  # of an error: less is not told apart
SUMMED = ("modfun ml", "SciPy output error", "SRIVC, NumPy", "SRIVC, dsmc, late", "pySINDy weak", "SIPPY OE")
SUMMARY = """# modfun beside its rivals

At 20 % noise, from an initial state that no estimator is told, with default options. How many records
failed is in brackets, and the rest of the page says of what, with every noise level and {count} estimators.

"""
HEAD = """
## How it was measured

Written by `make rivals`; do not edit. Cells may be kept from earlier runs of it (`--keep`).
Every estimator gets the same records. How fast modfun is
in Monte Carlo studies is in [benchmarks.md](benchmarks.md). None of the rivals is a dependency of modfun.

{machine} Load average at the end {load:.1f}.

A record **fails** where the estimator raises or does not converge, where the model is unstable, or where a
parameter is over 50 % off; means and standard deviations are of the records that do not fail, medians of all.
"From rest": initial state zero; "in motion": each state random with the rms it has under the input.
"""

FIELD = """
## The benchmark of the field

Rao and Garnier: (−6400 s + 1600)/(s⁴ + 5 s³ + 408 s² + 416 s + 1600), binary input of 7161 samples, each
held for 0.01 s, white noise at 10 and 20 dB. Wanted: no failure, standard deviations of at most 1.05 times
the Cramér–Rao bound, biases below 3 Monte Carlo standard errors. Standard deviations are over the published
bound, which takes the initial state as known to be zero; with an unknown one (modfun is not told) it is
{unknown} times that for {names}. In motion the initial state excites the
system, too, so that ratios below 1 are right there. Standard deviations are known to {mcse:.1f} % (modfun)
and {slow:.1f} % (SRIVC). All cells share their noise, scaled, so that what is chance in one is chance in all;
"again" is modfun on {own:,} other records. "Off": unstable, or a parameter over 50 % off. Bands are the
default rule's unless given.
"""


def _percent(value):
    return "–" if value is None else f"{value:.3g}" if value < 99.5 else f"{value:.0f}"


def _state(state):
    return {"zero": "from rest", "random": "in motion"}[state]


def field(benchmark):
    """The section on Rao and Garnier."""
    problem, published = problems.rao_garnier(), problems.published()
    bounds = {snr: np.array([published[f"crlb_snr{snr}"][name] for name in problem.names]) for snr in SNR}
    unknown = problem.bound(1.0) / problem.bound(1.0, initial_state="zero")
    counts = {key.split("|")[0]: f["records"] for key, f in benchmark.items()}
    own = max(counts.values())
    text = FIELD.format(
        unknown=", ".join(f"{r:.3f}" for r in unknown), names=", ".join(problem.names),
        own=own,
        mcse=100 / np.sqrt(2 * own),
        slow=100 / np.sqrt(2 * min(counts.values())),
    ).splitlines()  # fmt: skip
    lines, missed = [], []
    for snr in SNR:
        for state in problems.STATES:
            lines += ["", f"**{snr} dB, {_state(state)}**", ""]
            names = " | ".join(problem.names)
            lines.append(f"| sd over bound | records | not converged | off | {names} | largest bias |")
            lines.append("|---|---:|---:|---:|" + "---:|" * (len(problem.names) + 1))
            for key, f in benchmark.items():
                who, at, of = key.split("|")
                if (int(at), of) != (snr, state):
                    continue
                ratio = np.array(f["sd"]) / bounds[snr]
                bias = _bias(problem, f)
                cells = " | ".join(f"{r:.3f}" for r in ratio)
                counts = " | ".join(str(f[count]) for count in ("records", "unfinished", "off"))
                lines.append(f"| {_own(who)} | {counts} | {cells} | {bias:.1f} |")
                if who == "ml" and (f["unfinished"] or f["off"] or np.any(ratio > 1.05) or bias >= 3):
                    other = _bias(problem, benchmark[f"ml, again|{snr}|{state}"])
                    missed.append(
                        f"{snr} dB {_state(state)} (largest ratio {np.max(ratio):.3f}, bias {bias:.1f}; "
                        f"on the other records {other:.1f})"
                    )
    said = "With defaults modfun meets all three targets in every cell."
    if missed:
        said = f"With defaults modfun misses a target at {'; '.join(missed)}."
    return [*text, "", f"{said} {_compared(benchmark, bounds)}", *lines]


def _bias(problem, f):
    """Largest bias in Monte Carlo standard errors."""
    off = np.abs(np.array(f["mean"]) - problem.truth) / np.array(f["sd"])
    return float(np.max(off) * np.sqrt(f["records"] - f["off"]))


def _compared(benchmark, bounds):
    """Means of sd over bound from rest, and who fails, by estimator."""
    ratios, failures = {}, {}
    for key, f in benchmark.items():
        who, snr, state = key.split("|")
        if state == "zero":
            ratios.setdefault(_own(who), []).append(np.mean(np.array(f["sd"]) / bounds[int(snr)]))
        if max(f["unfinished"], f["off"]):
            count = max(f["unfinished"], f["off"])
            told = f"{count} of {f['records']} at {snr} dB {_state(state)}"
            failures.setdefault(_own(who), []).append(told)
    means = ", ".join(f"{who} {np.mean(each):.3f}" for who, each in ratios.items())
    failing = "; ".join(f"{who} ({', '.join(each)})" for who, each in failures.items())
    return f"Mean of sd over bound from rest: {means}. Failures: {failing or 'none'}."


def _own(who):
    return f"modfun {who}" if who.startswith("ml") else who


def table(results, problem, state):
    """Competitors down, noise levels across."""
    found = {}
    for key, figures in results.items():
        who, name, nsr, of = key.split("|")
        if (name, of) == (problem.name, state):
            found.setdefault(who, {})[float(nsr)] = figures
    levels = sorted(next(iter(found.values())))
    heads = " | ".join(f"NSR {nsr:g}" for nsr in levels)
    lines = ["", f"**{problem.name}, {_state(state)}**", "", f"| | records | {heads} | over modfun |"]
    lines.append("|---|---:|" + "---:|" * (len(levels) + 1))
    for who, at in found.items():
        shown = " | ".join(_cell(at[nsr], nsr) for nsr in levels)
        over = ", ".join(_over(found, who, nsr) for nsr in levels[1:])
        lines.append(f"| {who} | {len(at[levels[0]]['errors'])} | {shown} | {over} |")
    bounds = [_percent(_rms(problem.bound(nsr) / problem.truth)) if nsr else "" for nsr in levels]
    lines.append(f"| *Cramér–Rao bound, sd* | | {' | '.join(bounds)} | |")
    return [*lines, "", _judged(found, levels)]


def _rms(v):
    return float(100 * np.sqrt(np.mean(v**2)))


def _median(errors):
    """Of all records, those that fail without an end to their error."""
    return float(np.median([np.inf if e is None else e for e in errors]))


def _ratio(found, who, nsr):
    """Median error over that of BASE on the same records."""
    errors = found[who][nsr]["errors"]
    return _median(errors) / _median(found[BASE][nsr]["errors"][: len(errors)])


def _over(found, who, nsr):
    ratio = _ratio(found, who, nsr)
    return f"{ratio:.2f}" if ratio < 100 else "–"


def _cell(f, nsr):
    median = _median(f["errors"])
    shown = "–" if np.isinf(median) else "0" if median < 1e-4 else _percent(median)
    text = f"{_percent(f['bias'])} / {_percent(f['sd'])} / {shown}" if nsr else shown
    return f"{text}; {f['failed']} fail" if f["failed"] else text


def _judged(found, levels):
    """Who is better than modfun on the same records, who as good, who fails."""
    better, alike = [], []
    for who, at in found.items():
        if who.startswith("modfun") or len(at[levels[0]]["errors"]) < ENOUGH:
            continue
        ratios = {nsr: _ratio(found, who, nsr) for nsr in levels[1:]}
        won = [f"{nsr:g}" for nsr, ratio in ratios.items() if ratio < 1 - SAME]
        if won:
            better.append(f"{who} (at NSR {', '.join(won)})")
        elif max(ratios.values()) <= 1 + SAME:
            alike.append(who)
    failing = [who for who, at in found.items() if any(f["failed"] for f in at.values())]
    near = f"{100 * SAME:.0f} %"
    return (
        f"Of the estimators with {ENOUGH} records or more, {', '.join(better) or 'none'} had a median "
        f"error over {near} below that of {BASE} on the same records; within {near} of it or "
        f"better at every NSR: {', '.join(alike) or 'none'}. "
        + (f"Failures: {', '.join(failing)}." if failing else "Nobody failed.")
    )


def summary(results, times):
    """The main figures on one screen."""
    names = list(times)
    heads = " | ".join([f"median error, {name}" for name in names] + [f"time per fit, {names[0]}"])
    lines = [f"| | {heads} |", "|---|" + "---:|" * (len(names) + 1)]
    for who in SUMMED:
        found = [results.get(f"{who}|{name}|0.2|random") for name in names]
        if all(found) and who in times[names[0]]:
            cells = [f"{_cell_of(f)} ({f['failed']} of {len(f['errors'])})" for f in found]
            lines.append(f"| {who} | {' | '.join(cells)} | {amount(times[names[0]][who])} |")
    return lines


def _cell_of(f):
    median = _median(f["errors"])
    return "–" if np.isinf(median) else f"{_percent(median)} %"


def comparison(results):
    """The tables of all competitors."""
    lines = [
        "", "## Accuracy", "",
        "Bias / standard deviation / median error, in % of the true parameters, rms over the parameters (the "
        "report's footnote 10); at NSR 0 the median error alone. NSR: standard deviation of the noise over "
        "the rms of the response from rest. Slow estimators got the first few of the same records: a "
        "standard deviation from 2 of them tells its order of magnitude, from 20 it is known to 16 %, from "
        "200 to 5 %. The last column compares on equal terms: median error over that of modfun's ml without "
        "trend (rivals fit no offset, modfun's default does) on the same records, at NSR 0.05, 0.2, 0.6.",
        "",
        "Eq. (24): 5/(s² + 3s + 8), u = sin(t²/5), 10 s, 256 intervals; its input is smooth, and who knows "
        "only held or straight pieces takes straight ones, which costs 0.05 % at NSR 0.",
    ]  # fmt: skip
    for name in dict.fromkeys(key.split("|")[1] for key in results):
        problem = problems.report() if name == problems.report().name else problems.rao_garnier()
        for state in problems.STATES:
            lines += table(results, problem, state)
    return lines


def timed(times):
    """The table of times."""
    names = list(times)
    lines = [
        "", "## Time per fit", "",
        "NSR 0.2, from rest; minimum over " + " and ".join(str(times[n]["rounds"]) for n in names)
        + " rounds of processor time, all in turn on one core; what takes over 0.2 s: mean of the cell "
        "above. Single calls, but dsmc eight records a call without Python. The search for the default band "
        "is part of modfun's time; many records in one call cost it far less (benchmarks.md).", "",
        f"| | {' | '.join(names)} |", "|---|" + "---:|" * len(names),
    ]  # fmt: skip
    for who in [key for key in times[names[0]] if key != "rounds"]:
        lines.append(f"| {who} | {' | '.join(amount(times[n][who]) for n in names)} |")
    verdicts = []
    for n in names:
        ranked = sorted((ns, who) for who, ns in times[n].items() if who != "rounds")
        place = [who for _, who in ranked].index("modfun ml") + 1
        verdicts.append(f"on {n} {ranked[0][1]} is the fastest and modfun ml number {place} of {len(ranked)}")
    return [*lines, "", f"Single calls: {'; '.join(verdicts)}."]


def taking_part(absent):
    """What each was given, licences, and what is missing."""
    lines = [
        "", "## Who took part", "",
        "Licences are those of the packages run here; what is under the LGPL is run beside modfun, never "
        "part of it. All install by pip on Python 3.11 in one environment: SIPPY is `sippy-unipi` there "
        "(`sippy` is telephony), pysid imports IPython without asking for it, jax-sysid holds JAX at 0.4.31 "
        "or older. MATLAB's toolboxes are not run.",
        "", "| | package | licence | what it was given |", "|---|---|---|---|",
    ]  # fmt: skip
    for who in COMPETITORS:
        if who.name not in absent:
            lines.append(f"| {who.name} | {who.package} {who.version()} | {who.licence} | {who.given} |")
    if absent:
        lines += [
            "",
            "Not in this run: " + "; ".join(f"{name} ({why})" for name, why in absent.items()) + ".",
        ]
    return lines


def page(machine, benchmark, results, times, absent):
    """docs/rivals.md."""
    shown = [SUMMARY.format(count=len(COMPETITORS) - len(absent)).rstrip(), "", *summary(results, times)]
    lines = [*shown, HEAD.format(machine=machine, load=os.getloadavg()[0]).rstrip()]
    if benchmark is None:
        lines += ["", "Without the shared data folder the benchmark of Rao and Garnier is left out."]
    else:
        lines += field(benchmark)
    lines += comparison(results) + timed(times) + taking_part(absent)
    return "\n".join(lines) + "\n"
