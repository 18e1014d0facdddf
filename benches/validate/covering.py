"""Coverage of 95 % intervals and efficiency against the Cramér–Rao bound, with validation_coverage.png."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import reasons
from intervals import CASES, COLOURS, KINDS, Row, case
from page import FALSE_ALARM, Section, limit

FIGURE = Path(__file__).resolve().parents[2] / "docs" / "figures" / "validation_coverage.png"
MARGIN = 0.01  # of coverage: what short records may cost without being called off
EFFICIENT = 1.05  # sd over the bound

WIDE = (
    "too wide: σ is that of the residuals at an estimate that does not minimise them, larger where it errs more, and "
    "the columns that make the covariance are noisy; without both they cover 95 to 96 % about their own mean (Reasons "
    "tried). Take `ml`"
)
BIAS = (
    "`awls` is biased by 0.3 standard deviations at this noise: it leaves out the gradient through the weights. About "
    "their own mean they cover (Reasons tried)"
)
COLOUR = "these intervals believe in white noise; spectral ones do not"
HUM = "a hum on a single line is smoothed over: spectral errors are for spectra that are smooth"
STEEP = (
    "noise that rises steeply leaks from its strong lines into the residuals of the quiet ones that carry the "
    "information"
)
CHANGING = (
    "noise that changes in the record makes lines depend on each other, which only spectral errors know. "
    "Give sigma="
)
REASONS = {
    "eq. (24), NSR 0.05, `ls`": WIDE,
    "eq. (24), NSR 0.05, `wls`": WIDE,
    "eq. (24), NSR 0.2, `ls`": WIDE,
    "eq. (24), NSR 0.2, `wls`": WIDE,
    "eq. (24), NSR 0.2, `awls`": BIAS,
    **{f"{name} noise, M = {lines}, classical": COLOUR for name in COLOURS for lines in (11, 40)},
    **{f"resonant, 1 line noise, M = {lines}, spectral": HUM for lines in (11, 40)},
    **{f"differenced noise, M = {lines}, spectral": STEEP for lines in (11, 40)},
    'AR(0.95) noise, noise="coloured", classical': "the spectrum that was fitted counts as known (Reasons tried); "
    "spectral errors allow for it",
    "noise 4 times as strong": CHANGING,
    "frequency response, eq. (24)": "the half-width is chosen on the same record, which the circle does not count; with "
    "one that is given it covers (rows beside it)",
    "efficiency, eq. (24), sin(": "a sinusoid tells two numbers at its line; the third comes from the onset, which "
    "falls with 1/m over all lines: more lines come nearer, slowly (docs/explanation/limits.md)",
    "sinusoids, AR(1) noise, all samples": "these standard errors are for white noise; lines= follows the colour",
}


def section(scale: float = 1.0, figure: Path | None = FIGURE) -> Section:
    """The section."""
    out = Section("Coverage and efficiency", reasons=REASONS)
    names = [one.__name__ for one in CASES]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        *found, bounds = pool.map(case, [*names, "efficiency"], [scale] * (len(names) + 1))
    rows = [row for group in found for row in group]
    z = limit(sum(row.covered.size for row in rows))
    out.say(
        "Share of records whose 95 % intervals contain the true value [nominal 95.0]: mean over the parameters, in brackets "
        "the least and the greatest, ± the Monte Carlo standard error of one parameter at 95 %. *Classical* "
        'intervals (`cov_type="nonrobust"`) believe in white noise of one level; *spectral* ones, the default, in '
        "a noise spectrum that is smooth; *HC3* in nothing, and errs to either side where few lines carry the "
        "information ([uncertainty](explanation/uncertainty.md#is-it-true)).",
        f"A row is off where a parameter is covered by more than {100 * MARGIN:.0f} point less than 95 %, or by "
        f"classical intervals more, and {z:.2f} Monte Carlo standard errors besides (Bonferroni over all "
        f"parameters of the table: right intervals raise a false alarm in {100 * FALSE_ALARM:.0f} % of tables). "
        "HC3 and spectral intervals that cover more are called cautious; they are wider than they need be. *ok from* is the least coverage of a parameter that this rule "
        "lets pass: it falls with the number of records, and of 400 records ok says that intervals are not far "
        "off, no more.",
        "![Coverage](figures/validation_coverage.png)",
    )
    shown = []
    for row in rows:
        low = np.all(row.covered + z * row.errors >= 0.95 - MARGIN)
        high = np.all(row.covered - z * row.errors <= 0.95 + MARGIN)
        verdict = out.judge(row.name, bool(low and (high or row.kind != "classical")))
        if verdict == "ok" and not high:
            verdict = "ok, cautious"
        c = 100 * row.covered
        one = 100 * np.sqrt(0.95 * 0.05 / row.records)
        cells = (row.name, f"{row.records:,}", row.failures, f"{c.mean():.1f} ({c.min():.1f}–{c.max():.1f})")
        shown.append((*cells, f"{one:.1f}", f"{100 * least(row.records, z):.1f}", verdict))
    out.table(["intervals", "records", "not ok", "covered, % [95.0]", "±", "ok from, %", "why"], shown)
    out.say(
        "Bands of `fit.predict(interval=...)` are in "
        "[uncertainty](explanation/uncertainty.md#degrees-of-freedom-and-intervals); how good predictions of "
        "measured records are is in [records](records/README.md)."
    )
    out.under("Reasons tried")
    out.say(
        "Coverage, mean over the parameters, as it is and where the cause that is named above is taken away: 95 % is "
        "what is left where it was the cause. Initial states by least squares take the model as exact; the last row "
        "says what that costs."
    )
    out.table(reasons.HEAD, reasons.rows(scale), left=2)
    z = limit(sum(ratio.size for _, ratio, _, _ in bounds))
    out.under("Efficiency")
    out.say(
        "Standard deviation of `ml` with the default band over the Cramér–Rao bound of all samples, initial state "
        f"unknown [1]: at most {EFFICIENT} (the band leaves out lines that would add a hundredth), and not below 1, "
        f"each by {z:.2f} Monte Carlo standard errors."
    )
    shown = []
    for name, ratio, error, records in bounds:
        good = np.all(ratio - z * error <= EFFICIENT) and np.all(ratio + z * error >= 1.0)
        verdict = out.judge(f"efficiency, {name}", bool(good))
        shown.append(
            (name, f"{records:,}", f"{ratio.min():.3f}–{ratio.max():.3f}", f"{error.max():.3f}", verdict)
        )
    out.table(["system", "records", "sd over bound [1]", "±", ""], shown)
    if figure is not None:
        draw(rows, figure)
    return out


def least(records: int, z: float) -> float:
    """The least coverage that the rule lets pass."""
    tried = np.arange(records + 1) / records
    row = Row("", "HC3", tried, records)
    return float(tried[np.argmax(tried + z * row.errors >= 0.95 - MARGIN)])


def draw(rows: list[Row], figure: Path) -> None:
    """Least, mean and greatest coverage of each row around 95 %; all kinds of intervals on one line."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    names = list(dict.fromkeys(row.name.removesuffix(f", {row.kind}") for row in rows))
    fig, ax = plt.subplots(figsize=(9.5, 0.3 * len(names) + 1.2), layout="constrained")
    for row in rows:
        place = list(KINDS.values()).index(row.kind)
        k = names.index(row.name.removesuffix(f", {row.kind}")) + 0.22 * (place - 1)
        c, colour = 100 * row.covered, f"C{place}"
        ax.plot([max(c.min(), 60), c.max()], [k, k], color=colour, linewidth=3, alpha=0.45)
        ax.plot(max(c.mean(), 60), k, "o" if c.mean() >= 60 else "<", color=colour, markersize=5)
    ax.axvspan(94, 96, color="0.88", zorder=0)
    ax.axvline(95, color="0.4", linewidth=0.9)
    ax.set(
        xlim=(59, 100.5),
        xlabel="coverage (%): mean over the parameters, line from least to greatest; ◂ below 60 %",
    )
    ax.set_yticks(range(len(names)), [name.replace("`", "") for name in names], fontsize=8)
    ax.set_ylim(len(names) - 0.4, -0.6)
    for place, word in enumerate(KINDS.values()):
        ax.plot([], [], "o-", color=f"C{place}", label=word)
    ax.legend(loc="lower left", fontsize=9)
    ax.grid(True, axis="x", alpha=0.3)
    fig.savefig(figure, dpi=110)
    plt.close(fig)
