"""Records that begin at rest: errors with and without that knowledge, over the bound with known start.

    python benches/known_start.py [records]  # 300 by default, some two minutes

Scatter is the interquartile range over 1.349, as errors have heavy tails under 20 % noise; failed fits are
left out. Times are medians: one fit in ten looks for what is missing from the equations, some 50 ms.
The tables are quoted on docs/known.md.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any

import modfun as mf
import numpy as np

MOTION = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["u"])
# Model, parameters, duration in s, intervals, input before and after a tenth of it, state of rest, trend.
CASES: dict[str, tuple[Any, dict[str, float], float, int, tuple[float, float], Any, str | None]] = {
    "Duffing": (
        mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u"),
        {"a": 0.8, "b": 4.0, "c": 2.0, "d": 4.0}, 5.0, 200, (0.0, 1.0), "zero", None,
    ),
    "first order": (
        mf.Equation("y' + a*y + c*y*abs(y) = b*u"),
        {"a": 1.0, "c": 0.5, "b": 1.0}, 4.0, 200, (0.0, 1.0), "zero", None,
    ),
    "tank, inflow from 1": (
        mf.Equation("h' = -k*sqrt(h) + b*u", outputs=["h"]),
        {"k": 0.5, "b": 0.4}, 6.0, 200, (1.0, 1.5), [0.64], None,
    ),
    "linear, level unknown": (
        mf.Equation("y'' + a*y' + b*y = d*u"),
        {"a": 3.0, "b": 8.0, "d": 5.0}, 3.0, 128, (0.0, 1.0), "zero", "constant",
    ),
    "state space, levels unknown": (
        MOTION, {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0},
        3.0, 150, (0.0, 0.1), "zero", "constant",
    ),
}  # fmt: skip


def run(name: str, nsr: float, records: int) -> None:
    """Print the ratios of a case at a noise level."""
    model, values, duration, count, (before, after), state, trend = CASES[name]
    step = np.where(np.arange(count + 1) >= 0.1 * count, after, before)
    told = {"input": step, "duration": duration, "intervals": count, "intersample": "zoh"}
    clean = mf.simulate(model.model(values), **told, initial_state=state)
    sigma = nsr * np.sqrt(np.mean((clean.y - clean.y[:, :1]) ** 2, axis=1))  # of what moves
    words = {"params": values, "trend": trend, "sigma": sigma if sigma.size > 1 else float(sigma[0])}
    bound = mf.crlb(model, clean, initial_state="rest", **words)
    truth = np.array(list(values.values()))
    for start in ("unknown", "rest"):
        errors, inside, spent = [], [], []
        for seed in range(records):
            noise = np.random.default_rng(seed).standard_normal(clean.y.shape) * sigma[:, None]
            rec = clean.assign(**dict(zip(clean.outputs, clean.y + noise, strict=True)))
            began = time.process_time()
            fit = mf.fit(rec, model, initial_state=start, trend=trend)
            spent.append(time.process_time() - began)
            if not fit.success:
                continue
            low, high = fit.conf_int().T
            errors.append((fit.params - truth) / bound.sd)
            inside.append((low < truth) & (truth < high))
        spread = np.subtract(*np.quantile(errors, [0.75, 0.25], axis=0)) / 1.349
        cover = 100 * np.mean(inside, axis=0)
        print(
            f"{name:28} {nsr:5g}  {start:8} {spread.min():6.2f} to {spread.max():5.2f}   "
            f"{cover.min():5.1f} to {cover.max():5.1f} %  {1e3 * np.median(spent):5.1f} ms {len(errors):5d}"
        )


def batch(duration: float, count: int, nsr: float, records: int) -> None:
    """Print the same of `fit_many` for the report's equation (24) under a step; failed fits are counted."""
    plant, model = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
    truth, t = np.array([3.0, 8.0, 5.0]), np.linspace(0.0, duration, count + 1)
    step = np.where(t >= 0.3, 1.0, 0.0)
    clean = mf.simulate(plant, input=step, duration=duration, intervals=count, intersample="zoh")
    sigma = nsr * float(np.sqrt(np.mean(clean.y**2)))
    noise = sigma * np.random.default_rng(0).standard_normal((records, *clean.y.shape))
    told = {"u": clean.u, "dt": duration / count, "intersample": "zoh"}
    made = mf.Batch(y=clean.y + noise, **told)
    spent, found = [], []
    mf.fit_many(made, model, threads=1)  # what the first call prepares counts in neither
    for start in ("unknown", "rest"):
        began = time.process_time()
        found.append(mf.fit_many(made, model, initial_state=start, threads=1))
        spent.append(time.process_time() - began)
    many, well = found[-1], found[-1].status == "ok"
    bound = mf.crlb(plant, clean, sigma=sigma, initial_state="rest", trend="constant").sd
    errors = (many.params - truth) / bound
    spread = np.subtract(*np.quantile(errors, [0.75, 0.25], axis=0)) / 1.349
    low, high = np.moveaxis(many.conf_int(), -1, 0)
    cover = 100 * np.mean(((low < truth) & (truth < high))[well], axis=0)
    rms = np.sqrt(np.mean(errors[well] ** 2, axis=0))
    print(
        f"equation (24), {duration:3g} s         {nsr:5g}  rest     "
        f"{spread.min():6.2f} to {spread.max():5.2f}   "
        f"{cover.min():5.1f} to {cover.max():5.1f} %  {1e6 * spent[1] / records:5.0f} µs {well.sum():5d}   "
        f"rms {rms.min():.2f} to {rms.max():.2f}, time {spent[1] / spent[0]:.1f} of unknown"
    )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for seconds, intervals in ((3.0, 128), (10.0, 256)):
        for level in (0.05, 0.2):
            batch(seconds, intervals, level, 2000)
    print("case                           NSR  start    scatter over bound    coverage         time    fits")
    for case in CASES:
        for level in (0.05, 0.2):
            run(case, level, int(sys.argv[1]) if len(sys.argv) > 1 else 300)
