"""Records made of hostile numbers, each a case of its own, through `mf.fit_many`: a million in minutes.

    python fuzz/python/many.py --cases 1000000 --seed 1

Every record ends in a status. Where it is "ok", estimates are finite and no standard error is below 0; one
that cannot be told is nan or inf, and counted. A panic of the core would be an InternalError.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import modfun as mf
import numpy as np
from modfun.fitting.many import FitMany
from numpy.typing import NDArray

F64 = NDArray[np.float64]
BATCH = 2048  # records of one length, step and structure
METHODS = ("ls", "wls", "awls", "ml")


def channel(rng: np.random.Generator, samples: int) -> F64:
    """One signal: of any size, still, alternating, a spike, steps, a ramp, a tone, noise, rounding."""
    t = np.arange(samples)
    kinds = (
        np.zeros(samples),
        np.ones(samples),
        (-1.0) ** t,
        (t == rng.integers(samples)).astype(float),
        np.sign(np.sin(t * rng.uniform(0.01, 3))),
        t.astype(float),
        np.sin(t * rng.uniform(0.001, 3.1)),
        rng.standard_normal(samples),
        np.exp(np.clip(t * rng.uniform(-40, 40), -600, 300)),
        1 + 1e-16 * rng.standard_normal(samples),
        rng.standard_normal(samples) * 10.0 ** rng.integers(-300, 140, samples),
    )
    size = 10.0 ** rng.choice([0, 0, 0, rng.integers(-320, 150), rng.integers(-12, 12)])
    with np.errstate(over="ignore", under="ignore"):
        values = np.clip(kinds[rng.integers(len(kinds))] * size, -1e150, 1e150)
    if rng.random() < 0.03:
        values[rng.integers(samples)] = rng.choice([np.nan, np.inf, -np.inf])
    return values


def batch(rng: np.random.Generator, records: int) -> tuple[mf.Batch, mf.TransferFunction, dict[str, object]]:
    """Records alike in length, step, structure and options."""
    samples, inputs = int(rng.integers(40, 97)), int(rng.integers(1, 3))
    outputs = 1 if rng.random() < 0.9 else 2
    y = np.array([[channel(rng, samples) for _ in range(outputs)] for _ in range(records)])
    u = np.array([[channel(rng, samples) for _ in range(inputs)] for _ in range(records)])
    u = np.where(np.isfinite(u), u, 0.0)  # inputs are refused at once
    for k in np.flatnonzero(
        rng.random(records) < 0.2
    ):  # collinear: the output is an input, or inputs are alike
        y[k, 0] = u[k, 0] * rng.choice([1.0, -3.0, 1e-9])
        u[k, -1] = u[k, 0]
    poles = int(rng.integers(1, 4))
    structure = mf.TransferFunction(poles=poles, zeros=int(rng.integers(0, poles + 1)))
    options: dict[str, object] = {
        "method": METHODS[rng.integers(4)] if outputs == 1 else "ml",
        "trend": ("auto", None, "constant", "linear")[rng.integers(4)],
        "harmonics": int(rng.integers(poles * 3 + 4, samples // 2 - 4)) if rng.random() < 0.7 else None,
    }
    return mf.Batch(y, u, dt=10.0 ** rng.uniform(-9, 9)), structure, options


def wrong(found: object) -> str | None:
    """What a result claims that its numbers do not hold."""
    assert isinstance(found, FitMany)
    ok = found.status == "ok"
    if not np.all(np.isfinite(found.params[ok])):
        return "an estimate that is ok is not finite"
    if np.any(found.bse[ok] < 0):
        return "a standard error is below 0"
    if not set(found.status.tolist()) <= {"ok", "maxiter", "rank", "nonfinite"}:
        return f"unknown outcomes {set(found.status.tolist())}"
    return None


def extreme(data: mf.Batch) -> NDArray[np.bool_]:
    """Which records hold a signal beyond 1e60, or one that is nowhere above 1e-60."""
    largest = np.concatenate([np.abs(data.y), np.abs(data.u)], axis=1).max(axis=2)
    return np.asarray(~((largest < 1e60) & ((largest > 1e-60) | (largest == 0))).all(axis=1))


def run(cases: int, seed: int) -> tuple[Counter[str], list[str]]:
    """How the records ended, and what of it was wrong, in words."""
    ended: Counter[str] = Counter()
    faults = []
    for number in range(-(-cases // BATCH)):
        data, structure, options = batch(np.random.default_rng([seed, number]), BATCH)
        fault: str | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", mf.ModfunWarning)
            try:
                found = mf.fit_many(data, structure, progress=False, **options)  # type: ignore[arg-type]
            except mf.InternalError as error:
                fault = repr(error)
            except mf.ModfunError as error:
                ended[type(error).__name__] += len(data)
            except Exception as error:
                fault = repr(error)
            else:
                ended.update(found.status.tolist())
                fault = wrong(found)
                lost = (found.status == "ok") & ~np.isfinite(found.bse).all(axis=1)
                ended["ok without an error"] += int(lost.sum())
                ended["of these neither huge nor tiny"] += int((lost & ~extreme(data)).sum())
        if fault is not None:
            faults.append(f"batch {number} of seed {seed}: {structure}, {options}: {fault}")
    return ended, faults


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    ended, faults = run(given.cases, given.seed)
    for word, count in ended.most_common():
        print(f"{count:9d}  {word}")
    print(f"{len(faults)} batches with a defect", *faults, sep="\n")
    raise SystemExit(bool(faults))


if __name__ == "__main__":
    main()
