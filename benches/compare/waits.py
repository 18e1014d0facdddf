"""What a user waits for: calls on one record of 1,000 samples, into docs/performance.md.

`make bench` calls it. --quick: one round, for the tests.
"""

import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

import history
import modfun as mf
import numpy as np
from measure import Contestant, compete, machine
from report import amount
from section import publish, rounds_of

HEADING = "## What a user waits for"
TEXT = """
Written by `make bench` from one run; do not edit. Calls on one record of 1,000 samples of 5/(s² + 3s + 8),
or of y'' + dy' + ay + by³ = u for the equation, noise of 5 % of the output's rms, one thread; batches of such
records. State spaces are those of a lateral motion: four outputs of 600 samples, noise of 2 %. Six poles are
fitted to four in noise of 30 %, which leads to an unstable model. Processor time, minimum and median of
{rounds} rounds. What is prepared once for all records of one kind was prepared before, as in a session that
fits a second record.

{machine}
"""
SAMPLES, DURATION, NSR = 1000, 10.0, 0.05
TF2 = mf.TransferFunction(poles=2, zeros=0)
LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=0.5))
SIX = mf.TransferFunction(poles=6, zeros=5)
LIGHT = mf.tf([1], np.polymul([1, 1.5, 4], [1, 0.8, 12]))


def record(system: mf.LTI | mf.NonlinearModel, u: str, duration: float, **options: object) -> mf.Record:
    return mf.simulate(system, input=u, duration=duration, intervals=SAMPLES - 1, nsr=NSR, seed=0, **options)


def lateral(yaw: float | str) -> tuple[mf.Record, mf.StateSpace]:
    """A lateral motion under two doublets, and its model; `yaw`: the moment of sideslip in it."""
    a = [[-0.25, 0.03, -0.99, 9.81 / 60], [-12, -3, 0.9, 0], [5, -0.2, -0.6, 0], [0, 1, 0.03, 0]]
    names, inputs = ["beta", "p", "r", "phi"], ["da", "dr"]
    plant = mf.ss(a, [[0, 0.05], [-8, 2], [-0.4, -3], [0, 0]], np.eye(4), np.zeros((4, 2)))
    t = 0.02 * np.arange(600)
    u = 0.1 * np.array([(1.0 * (t > s) - 2 * (t > s + 0.6) + (t > s + 1.2)) for s in (1, 5)])
    clean = plant.simulate(u=u, dt=0.02, intersample="zoh")
    noise = 0.02 * clean.std(axis=1, keepdims=True) * np.random.default_rng(0).standard_normal(clean.shape)
    rec = mf.Record(y=clean + noise, u=u, dt=0.02, outputs=names, inputs=inputs, intersample="zoh")
    free = [["Yb", 0.03, -0.99, "9.81/60"], ["Lb", "Lp", "Lr", 0], [yaw, "Np", "Nr", 0], [0, 1, 0.03, 0]]
    b = [[0, "Yd"], ["La", "Ld"], ["Na", "Nd"], [0, 0]]
    return rec, mf.StateSpace(free, b, states=names, inputs=inputs)


def calls(scratch: Path) -> dict[str, Callable[[], object]]:
    """What is called, by what the table says of it."""
    system = mf.tf([5], [1, 3, 8])
    rec = record(system, "sin(t**2/5)", DURATION)
    short = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=256, nsr=NSR, seed=0)
    stepped = record(system, "sign(sin(2*t) + 0.2)", DURATION)
    late = record(mf.tf([5], [1, 3, 8], delay=0.2), "sin(t**2/5)", DURATION)
    duffing = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
    truth = duffing.model({"d": 0.3, "a": 1.0, "b": 0.5})
    bent = record(truth, "2*sin(1.1*t) + sin(2.3*t)", 20.0)
    fit, equation_fit = mf.fit(rec, TF2), mf.fit(bent, duffing)
    four = mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24])
    yawing, lacking = lateral(0)
    turned, whole = yawing.assign(beta=-yawing["beta"]), lateral("Nb")[1]
    quiet = mf.simulate(LIGHT, input="sin(t**2/8)", duration=15.0, intervals=400, nsr=0.3, seed=10)
    live = mf.Stream(mf.Estimator(TF2, harmonics=16), dt=rec.dt, window=6.0)
    live.push(y=rec.y, u=rec.u)
    y, u = float(rec.y[0, -1]), float(rec.u[0, -1])
    noise = NSR * np.sqrt(np.mean(rec.y**2)) * np.random.default_rng(1).standard_normal((10_000, 1, SAMPLES))
    batches = {
        size: mf.Batch(y=rec.y + noise[:size], u=rec.u, dt=rec.dt, intersample="smooth")
        for size in (10, 10_000)
    }
    alone = {"threads": 1, "progress": False}

    def estimate() -> object:
        live.push(y=y, u=u)
        return live.params

    return {
        "`mf.fit`, 16 harmonics, no trend": lambda: mf.fit(rec, TF2, harmonics=16, trend=None),
        "`mf.fit`, all defaults": lambda: mf.fit(rec, TF2),
        "`mf.fit`, all defaults, 256 intervals": lambda: mf.fit(short, TF2),
        "`mf.fit`, all defaults, an input of steps": lambda: mf.fit(stepped, TF2),
        "`mf.fit`, one free delay": lambda: mf.fit(late, LATE),
        "`mf.fit` of an equation": lambda: mf.fit(bent, duffing),
        "`mf.fit`, a state space of four outputs": lambda: mf.fit(yawing, whole),
        "`mf.fit`, the same without the weathercock stability, and its warning": lambda: mf.fit(
            yawing, lacking
        ),
        "`mf.fit`, a sideslip of the other sign, which does not settle": lambda: mf.fit(turned, whole),
        "`mf.fit`, six poles for four, `stable=True`": lambda: mf.fit(quiet, SIX, stable=True),
        "`mf.bootstrap`, 1,000 replicates": lambda: mf.bootstrap(fit, replicates=1000, **alone),
        "`mf.bootstrap` of an equation, 100": lambda: mf.bootstrap(equation_fit, replicates=100, **alone),
        "`mf.select_order`, one to four poles": lambda: mf.select_order(rec, poles=range(1, 5)),
        "`mf.reduce`, four poles to two": lambda: mf.reduce(four, 2),
        "`fit.predict`": lambda: fit.predict(),
        "`fit.report`, a page": lambda: fit.report(scratch / "fit.html"),
        "a sample and an estimate of `mf.Stream`": estimate,
        "`mf.fit_many`, 10 records": lambda: mf.fit_many(batches[10], TF2, **alone),
        "`mf.fit_many`, 10,000 records": lambda: mf.fit_many(batches[10_000], TF2, **alone),
    }


def main() -> int:
    given = rounds_of(__doc__, "one round, nothing kept", seconds=120)
    warnings.simplefilter("ignore", mf.ModfunWarning)
    about = machine()

    def repeated(call: Callable[[], object]) -> Callable[[int], None]:
        def run(count: int) -> None:
            for _ in range(count):
                call()

        return run

    with tempfile.TemporaryDirectory() as scratch:
        every = [Contestant(name, repeated(call), unit=1) for name, call in calls(Path(scratch)).items()]
        rounds = compete(every, given.rounds, given.seconds)
    text = [
        HEADING,
        TEXT.format(rounds=rounds, machine=about),
        "| call | minimum | median |",
        "|---|---:|---:|",
    ]
    text += [f"| {c.name} | {amount(c.best)} | {amount(float(np.median(c.ns)))} |" for c in every]
    publish(given.out, text)
    if not given.quick:
        history.append({c.name.replace("`", ""): c.best for c in every})
    return 0


if __name__ == "__main__":
    sys.exit(main())
