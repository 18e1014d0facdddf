"""The page: one table, then what was wanted beside what was measured."""

import os

from measure import has_avx512

HEAD = """# Benchmarks

Written by `make bench` from one run; do not edit.

Setting: the report's eq. (24), 5/(s² + 3s + 8), input sin(t²/5), T = 10 s, N = 256, M = 6, trapezoidal rule,
noise 20 % of the output's rms, `awls`: weights of equation noise, then exactly five reweightings; no trend.
One thread pinned to one core, contestants in turn within each of {rounds} rounds; processor time of a
replicate (of the two threads: elapsed time). Minima are compared; median and maximum show the spread.
Every rival gives modfun's estimates on the same noise to 1e-8, and means and covariances alike with its own.
Rivals stop at the estimates; modfun's studies address each replicate's noise and gather moments and medians.
"Lines" is the form modfun computes, "banded" that of second differences with their covariance.

{machine} Load average at the end {load:.1f}.
"""


def amount(ns: float) -> str:
    """Three digits with a unit."""
    for unit, size in (("ns", 1.0), ("µs", 1e3), ("ms", 1e6), ("s", 1e9)):
        if ns < 999.5 * size or unit == "s":
            return f"{ns / size:.3g} {unit}"
    raise AssertionError


def rows(title, contestants, base=None):
    """A part of the table."""
    lines = [f"| **{title}** | | | | |"]
    for c in contestants:
        times = sorted(c.ns)
        ratio = f"{c.best / base:.3g}" if base else ""
        middle = times[len(times) // 2]
        lines.append(f"| {c.name} | {amount(c.best)} | {amount(middle)} | {amount(times[-1])} | {ratio} |")
    return lines


def table(timed, samples, coefficients):
    """All times."""
    full, drawn = timed["samples"].best, timed["coefficients"].best
    return [
        "| | minimum | median | maximum | times modfun's |",
        "|---|---:|---:|---:|---:|",
        *rows("A replicate, noise included", [timed["samples"], *samples.values(), timed["noise"]], full),
        *rows("A replicate, coefficients drawn", [timed["coefficients"], *coefficients.values()], drawn),
        *rows(
            "modfun in other ways, noise included",
            [timed[k] for k in ("avx2", "plain", "awls", "ml", "one thread", "two threads")],
            full,
        ),
        *rows("A fit", [c for key, c in timed.items() if key.startswith(("fit", "many"))]),
        *rows("A long record", [timed["long modfun"], timed["long numpy"]], timed["long modfun"].best),
    ]


def claims(timed, samples, coefficients, memory):
    """(what, wanted, measured, met): met is None where it cannot be told here."""
    best = {key: c.best for key, c in timed.items()}

    def rival(among, form=""):
        return min((c for name, c in among.items() if form in name), key=lambda c: c.best)

    whole, same, banded = rival(samples), rival(coefficients, "lines"), rival(coefficients, "banded")

    def least(what, value, wanted, note=""):
        return what, f"≥ {wanted}", f"{value:.2f}{note}", value >= wanted

    def most(what, value, wanted, unit="", note=""):
        return what, f"≤ {wanted}{unit}", f"{value:.2f}{unit}{note}", value <= wanted

    yield least(
        "noise included, times faster than the best rival",
        whole.best / best["samples"],
        5,
        f" ({whole.name})",
    )
    yield least("the same, stretch", whole.best / best["samples"], 6)
    yield most("noise included, over NumPy's time for the noise alone", best["samples"] / best["noise"], 0.3)
    yield most("the same, stretch", best["samples"] / best["noise"], 0.25)
    drawn = best["coefficients"]
    yield least(
        "coefficients drawn, times faster than the best rival on the lines",
        same.best / drawn,
        2,
        f" ({same.name})",
    )
    yield least(
        "coefficients drawn, times faster than the best rival in banded form",
        banded.best / drawn,
        5,
        f" ({banded.name})",
    )
    if has_avx512():
        yield least("speed held to AVX2 over that with AVX-512", best["samples"] / best["avx2"], 0.6)
    else:
        yield "speed held to AVX2 over that with AVX-512", "≥ 0.6", "this processor has no AVX-512", None
    yield most("`ml` over `awls`, both to 1e-9", best["ml"] / best["awls"], 1.8)
    if len(os.sched_getaffinity(0)) > 1:
        yield least("two threads, times faster", best["one thread"] / best["two threads"], 1.9)
    else:
        yield "two threads, times faster", "≥ 1.9", "one core here", None
    large = best["many 10000"]
    yield most("`fit_many` of 10 records, a fit over that of 10,000", best["many 10"] / large, 3)
    yield most("`fit_many` of 100 records, a fit over that of 10,000", best["many 100"] / large, 1.3)
    yield most("a single `mf.fit`, `ml`, M = 6", best["fit ml"] / 1e3, 60, " µs")
    yield most("2²² samples, over numpy.fft.rfft", best["long modfun"] / best["long numpy"], 0.5)
    yield most(
        "2²² samples, extra memory",
        memory["modfun"],
        20,
        " MB",
        f" (numpy.fft.rfft {memory['numpy']:.0f} MB)",
    )


def page(machine, rounds, timed, samples, coefficients, absent, memory):
    """docs/benchmarks.md."""
    lines = [HEAD.format(rounds=rounds, machine=machine, load=os.getloadavg()[0])]
    lines += table(timed, samples, coefficients)
    if absent:
        lines += [
            "",
            "Not in this run: " + "; ".join(f"{name} ({why})" for name, why in absent.items()) + ".",
        ]
    lines += ["", "## Wanted and measured", "", "| | wanted | measured | |", "|---|---:|---:|---|"]
    for what, wanted, measured, met in claims(timed, samples, coefficients, memory):
        word = {True: "met", False: "**missed**", None: "not told"}[met]
        lines.append(f"| {what} | {wanted} | {measured} | {word} |")
    return "\n".join(lines) + "\n"
