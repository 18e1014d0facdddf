"""The core beside the slow twins of tests/python/oracle: the greatest difference of each quantity."""

from __future__ import annotations

from gaps import Gaps
from page import Section
from twins_around import bounds, lags, local_models, others, reductions, sinusoids
from twins_estimates import (
    bands,
    estimates,
    general,
    iterates,
    regressors,
    scipy_fits,
    several,
    simulated,
    spectra,
)

CASES = 24  # random ones of each kind
KINDS = (
    spectra, simulated, regressors, estimates, scipy_fits, iterates, bands, several, general, local_models,
    sinusoids, lags, bounds, others, reductions,
)  # fmt: skip


def section(scale: float = 1.0) -> Section:
    """The section."""
    out = Section("Agreement with slow twins")
    gaps = Gaps()
    for kind in KINDS:
        kind(gaps, max(int(CASES * scale), 12))
    out.say(
        "`tests/python/oracle` holds twins of the core in plain NumPy and SciPy, written from the formulas: naive "
        "sums, dense covariances, Levenberg–Marquardt, adaptive integrators. They share no code with modfun. "
        "Below the greatest difference over random systems, records and options; relative to the largest number "
        "of the vector or matrix unless the row says otherwise. What a twin gives by an iteration or by "
        "differences has the digits of these, and the limit says so."
    )
    rows = [
        (name, count, f"{gap:.1e}", f"{limit:.0e}" if limit else "equal", out.judge(name, gap <= limit))
        for name, (count, gap, limit) in gaps.rows.items()
    ]
    out.table(["quantity", "comparisons", "greatest difference", "limit", ""], rows)
    total = int(sum(row[0] for row in gaps.rows.values()))
    out.say(f"{total:,} comparisons in all.")
    out.say(
        "Where the twin differs on purpose: those of equations weigh end samples as the rule does, the core "
        "evenly, so that `awls` and `ml` agree to a part of a standard error and not to digits."
    )
    return out
