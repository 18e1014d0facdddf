"""A whole Monte Carlo replicate against the time NumPy's fastest generator takes for its noise alone.

Setting: the report's eq. (24), M = 6, N = 256, trapezoid, NSR .2, noise included. Pinned to one core, the
contestants in turn within each round, minima over rounds. Run it on an idle machine:

    python benches/compare/noise_ratio.py
"""

import argparse
import os
import sys
from time import perf_counter

import modfun as mf
import numpy as np
from modfun import _core

INTERVALS, DURATION = 256, 10.0
COMMON = {
    "order": 2, "numerators": [0], "delays": [0.0], "intersample": ["smooth"], "noise": "output",
    "trend": None, "rule": "trapezoid", "extended": True, "band": None, "harmonics": 6,
}  # fmt: skip


def study(replicates, threads=1, draw="samples", **estimator):
    """A study of one cell, without intervals, ready to run."""
    dt = DURATION / INTERVALS
    y = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=dt, intervals=INTERVALS)
    t = dt * np.arange(INTERVALS + 1)
    options = {**COMMON, "method": "awls", "tol": 1e-9, "maxiter": 50, **estimator}
    own = {
        "options": options, "truth": np.array([3.0, 8.0, 5.0]), "cov_type": None, "position": 0,
        "columns": [0, 1, 2],
    }  # fmt: skip
    group = {
        "group": 0, "dt": dt, "y": y, "u": np.sin(t**2 / 5)[None], "free": np.zeros((0, y.size)),
        "sigma": np.array([0.2 * np.sqrt(np.mean(y**2))]), "estimators": [own],
    }  # fmt: skip
    laid_out = _core.Study([group], (1, 3), draw=draw, level=0.95)

    def run():
        return laid_out.part(seed=1, first=0, replicates=replicates, samples=False, threads=threads)

    return run


def take(contestants, times, count):
    """One round: every contestant once, ns a replicate."""
    for name, run in contestants.items():
        start = perf_counter()
        run()
        times[name].append(1e9 * (perf_counter() - start) / count)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--replicates", type=int, default=20_480)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    count = given.replicates
    generator = np.random.Generator(np.random.SFC64(1))
    out = np.empty((count, INTERVALS + 1))
    alone = {
        "NumPy SFC64, 257 normals": lambda: generator.standard_normal(out=out),
        "awls, 5 reweightings": study(count, tol=0.0, maxiter=5),
        "awls, 5, coefficients drawn": study(count, draw="coefficients", tol=0.0, maxiter=5),
        "awls to 1e-9": study(count),
        "ml to 1e-9": study(count, method="ml"),
    }
    pair = {"one thread": study(4 * count), "two threads": study(4 * count, threads=2)}
    times = {name: [] for name in [*alone, *pair]}
    cores = os.sched_getaffinity(0)
    for _ in range(given.rounds):
        os.sched_setaffinity(0, {min(cores)})
        take(alone, times, count)
        os.sched_setaffinity(0, cores)
        take(pair, times, 4 * count)
    print(f"{count} replicates, {given.rounds} rounds, load {os.getloadavg()[0]:.1f}; ns a replicate")
    print(f"{'':30}{'minimum':>9}{'median':>9}{'maximum':>9}")
    for name, values in times.items():
        print(f"{name:30}{min(values):9.0f}{np.median(values):9.0f}{max(values):9.0f}")
    best = {name: min(values) for name, values in times.items()}
    ratio = best["awls, 5 reweightings"] / best["NumPy SFC64, 257 normals"]
    ml = best["ml to 1e-9"] / best["awls to 1e-9"]
    gain = best["one thread"] / best["two threads"]
    claims = [
        ("replicate over NumPy's noise", ratio, "at most 0.5", ratio <= 0.5),
        ("ml over awls, both to 1e-9", ml, "at most 2", ml <= 2),
        ("two threads, times faster", gain, "at least 1.8", gain >= 1.8),
    ]
    for what, value, limit, met in claims:
        print(f"{what:30}{value:9.3f}   {limit}: {'met' if met else 'missed'}")
    return 0 if all(met for *_, met in claims) else 1


if __name__ == "__main__":
    sys.exit(main())
