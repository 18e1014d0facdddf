"""What a fit warns of: wrong and right set-ups, a hundred records each, into docs/trial.md."""

from __future__ import annotations

import argparse
import re
import time
import warnings
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from scipy.stats import chi2
from trial_records import Setup
from trial_setups import RIGHT, WRONG

ROOT = Path(__file__).resolve().parents[2]
TELLS = 1e-6  # p-value of the likelihood ratio below which a record tells right from wrong


def tried(setup: Setup, records: int) -> dict[str, Any]:
    """Rates over the records: told by the likelihood ratio, warned of, the right cure, doubts of check."""
    told = warned = cured = doubts = said = 0
    texts: dict[str, int] = {}
    for seed in range(records):
        data = setup.record(seed)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", mf.ModfunWarning)
            fit = setup.fit(data)
        text = str(caught[0].message) if caught else ""
        assert len(caught) <= 1, [str(w.message) for w in caught]
        tells = True
        if setup.right is not None and fit.usable and len(fit.outputs) == 1:
            tells = _ratio(fit, setup.right(data)) < TELLS
        told += tells
        said += bool(text)
        warned += bool(text) and tells
        cured += bool(text) and tells and bool(re.search(setup.cure, text))
        doubts += bool(fit.check())
        if text:
            key = re.sub(r"[-+]?[\d.]+(e[-+]?\d+)?", "#", text)
            texts[key] = texts.get(key, 0) + 1
    common = max(texts, key=lambda k: texts[k]) if texts else ""
    return {"told": told, "said": said, "warned": warned, "cured": cured, "doubts": doubts, "common": common}


def _ratio(wrong: Any, right: Any) -> float:
    """p-value of the likelihood ratio of two fits, per equation: bands of default rules differ."""
    a, b = (fit.cost / fit.df_resid for fit in (wrong, right))
    rows = min(wrong.df_resid, right.df_resid)
    return float(chi2.sf(rows * np.log(max(a / b, 1e-300)), max(right.params.size - wrong.params.size, 1)))


PAGE = """\
# Trial: what a fit warns of

{wrongs} wrong and {rights} right set-ups, {records} records each, by `make trial`. A fit emits at most one
warning: where the data contradict the model or a default beyond doubt. Everything else is in `fit.check()`.

* Of the {told:,} records that tell wrong from right, {warned:.1f} % were warned of. The first cure that the
  warning names was a right one in {cured:.1f} % of these.
* Of the {fits:,} records of right set-ups, {alarms} were warned of. If none was, the rate lies below
  {below:.2g} % (97.5 %).

## Wrong set-ups

A record tells where the likelihood ratio of right and wrong fit has a p-value below {tells:g}. Where the
right model is of another kind, every record counts. "Warned of" and "first cure right" count the records that
tell.

| set-up | records that tell | warned of | first cure right | doubts in `check()` |
|---|---|---|---|---|
{wrong_rows}

## Right set-ups

Doubts are those of `check()`: with white noise one right fit in twenty has some. Coloured noise is doubted in
every record, and rightly: classical standard errors do not hold then.

| set-up | warned of | doubts in `check()` |
|---|---|---|
{right_rows}

## What it does not see

* An input that is not in the record looks like turbulence or load. The fit warns where the residuals have the
  system's own spectrum, and names both. Another spectrum is that of coloured noise, or of a filtered record,
  and only `check()` says that the residuals are far above the noise of the high band.
* A held input that is declared smooth shifts the estimates, but a fit absorbs the half sample of delay: the
  residuals do not tell. `rec.check()` sees it in the samples of the input.
* A chirp passes each frequency once, so that a system that changes in time cannot be told from one of higher
  order. The set-ups with changing stiffness are driven by seven sines.
* Equations and state spaces are tested for events, neighbouring lines, colour and level, linear ones also for
  a channel recorded late or early. Where the level or that test speaks, the fit tries lags, delays, levers,
  missing terms, a drift and a shift of a channel, of one parameter each, and estimates the
  numbers in the equations.
"""

Rows = list[tuple[str, dict[str, Any]]]


def page(wrong: Rows, right: Rows, records: int) -> str:
    """The page docs/trial.md."""
    told, warned, cured = (sum(row[key] for _, row in wrong) for key in ("told", "warned", "cured"))
    fits = records * len(right)
    wrong_rows = (
        (
            name,
            row["told"],
            _share(row["warned"], row["told"]),
            _share(row["cured"], row["warned"]),
            row["doubts"],
        )
        for name, row in wrong
    )
    right_rows = ((name, row["said"], row["doubts"]) for name, row in right)
    return PAGE.format(
        wrongs=len(wrong), rights=len(right), records=records, told=told, warned=100 * warned / told,
        cured=100 * cured / max(warned, 1), fits=fits, alarms=sum(row["said"] for _, row in right),
        below=100 * (1 - 0.025 ** (1 / fits)), tells=TELLS,
        wrong_rows="\n".join(f"| {' | '.join(map(str, row))} |" for row in wrong_rows),
        right_rows="\n".join(f"| {' | '.join(map(str, row))} |" for row in right_rows),
    )  # fmt: skip


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.0f} %" if whole else "–"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "trial.md")
    args = parser.parse_args()
    rows: dict[bool, list[tuple[str, dict[str, Any]]]] = {True: [], False: []}
    for right, setups in ((False, WRONG), (True, RIGHT)):
        for setup in setups:
            if args.only not in setup.name:
                continue
            start = time.perf_counter()
            found = tried(setup, args.records)
            rows[right].append((setup.name, found))
            took = f"{time.perf_counter() - start:.1f} s"
            print("right" if right else "wrong", setup.name, found, took, flush=True)
    if not args.only:
        args.out.write_text(page(rows[False], rows[True], args.records), encoding="utf-8")


if __name__ == "__main__":
    main()
