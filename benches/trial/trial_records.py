"""Records of the trial's set-ups, by seed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "python"))

import flights  # noqa: E402

TF = mf.TransferFunction
PLANT = mf.tf([5], [1, 3, 8])
LIGHT = mf.tf([1], [1, 0.2, 1])
THIRD = mf.tf([2, 5], [1, 3, 8, 4])
CHIRP = "sin(t**2/5)"
Fits = Callable[[mf.Record], Any]


@dataclass(frozen=True)
class Setup:
    """Records by seed, the fit that a user makes, and of a wrong one the right fit and words of its cure."""

    name: str
    record: Callable[[int], Any]
    fit: Fits
    right: Fits | None = None
    cure: str = ""


def noisy(clean: mf.Record, seed: int, nsr: float = 0.05, pole: float = 0.0, more: Any = 0.0) -> mf.Record:
    """The record with noise, of AR(1) colour, of so much of each output's rms about its mean."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((len(clean.y), clean.t.size + 200))
    noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[:, 200:]
    y = clean.y + nsr * clean.y.std(axis=1, keepdims=True) * noise + more
    return mf.Record(
        y=y, u=clean.u, dt=clean.dt, outputs=clean.outputs, inputs=clean.inputs, intersample=clean.intersample
    )


def of(system: Any, text: Any = CHIRP, duration: float = 20.0, intervals: int = 512, **words: Any) -> Any:
    """Records by seed of a system moved by a signal."""
    keys = {"nsr", "pole", "more"}
    clean = mf.simulate(
        system, input=text, duration=duration, intervals=intervals,
        **{k: v for k, v in words.items() if k not in keys},
    )  # fmt: skip
    return lambda seed: noisy(clean, seed, **{k: v for k, v in words.items() if k in keys})


def by(model: Any, **options: Any) -> Fits:
    """A fit with a model."""
    return lambda rec: mf.fit(rec, model, **options)


def declared(word: str, model: Any) -> Fits:
    """A fit of the record with its input declared otherwise."""
    return lambda rec: mf.fit(mf.Record(y=rec.y, u=rec.u, dt=rec.dt, intersample=word), model)


STEPS = "1*(t>1) - 2*(t>5) + 1.5*(t>9) - 1*(t>14)"


def shifted(system: Any, samples: int) -> Any:
    """Records whose output is late by samples."""
    clean = mf.simulate(system, input=CHIRP, duration=20.0, intervals=512)
    y = np.roll(clean.y, samples, axis=1)
    y[:, :samples] = y[:, samples : samples + 1]
    late = clean.assign(y=y[0])
    return lambda seed: noisy(late, seed)


def held(seed: int) -> mf.Record:
    """A staircase of five samples a step, ten samples a second."""
    u = np.repeat(np.random.default_rng(5).standard_normal(41), 5)[:201]
    clean = mf.Record(y=PLANT.simulate(u=u, dt=0.1, intersample="zoh"), u=u, dt=0.1, intersample="zoh")
    return noisy(clean, seed)


def staircase(system: Any, early: int = 0) -> Any:
    """Records of a staircase whose output comes so many samples early."""
    u = np.repeat(np.random.default_rng(5).standard_normal(103), 5)[: 513 + early]
    y = np.ravel(system.simulate(u=u, dt=0.1, intersample="zoh"))
    clean = mf.Record(y=y[early:], u=u[: u.size - early], dt=0.1, intersample="zoh")
    return lambda seed: noisy(clean, seed)


def spiked(seed: int) -> mf.Record:
    rec = of(PLANT)(seed)
    rng = np.random.default_rng(seed + 999)
    y = rec.y.copy()
    y[0, rng.integers(40, 470)] += 20 * 0.05 * y.std()
    return rec.assign(y=y[0])


def changed(factor: float) -> Any:
    """A stiffness that goes up by a factor over the record."""
    t = np.linspace(0, 20, 513)

    def u(time: Any) -> Any:  # a chirp would pass each frequency once, and time could not be told from it
        return sum(np.sin((0.5 + 0.7 * k) * time + k**2) for k in range(7)) / 2

    def rate(time: float, x: Any) -> Any:
        k = 8 * (1 + (factor - 1) * time / 20)
        return [x[1], 5 * u(time) - 3 * x[1] - k * x[0]]

    y = solve_ivp(rate, (0, 20), [0, 0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    clean = mf.Record(y=y, u=u(t), dt=20 / 512, intersample="smooth")
    return lambda seed: noisy(clean, seed)


def nonlinear(text: Callable[[float, Any, float], Any], amplitude: float = 1.0) -> Any:
    t = np.linspace(0, 20, 513)

    def u(time: Any) -> Any:
        return amplitude * np.sin(time**2 / 5)

    y = solve_ivp(lambda s, x: text(s, x, u(s)), (0, 20), [0, 0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    clean = mf.Record(y=y, u=u(t), dt=20 / 512, intersample="smooth")
    return lambda seed: noisy(clean, seed)


def two_inputs(seed: int) -> mf.Record:
    rng = np.random.default_rng(7)
    t = np.linspace(0, 20, 513)
    u = np.array([np.sin(t**2 / 5), sum(np.sin(0.7 * k * t + rng.uniform(0, 6)) for k in range(1, 6)) / 2])
    one = PLANT.simulate(u=u[0], dt=20 / 512)
    two = mf.tf([2], [1, 3, 8]).simulate(u=u[1], dt=20 / 512)
    clean = mf.Record(
        y=np.ravel(one) + np.ravel(two), u=u, dt=20 / 512, inputs=["de", "da"], intersample="smooth"
    )
    return noisy(clean, seed)


def spring(time: float, x: Any, u: float) -> Any:
    """A hard spring, as of a Duffing oscillator."""
    return [x[1], 5 * u - 3 * x[1] - 8 * x[0] - 20 * x[0] ** 3]


TWO = mf.ss([[0, 1], [-8, -3]], [[0], [5]], np.eye(2), np.zeros((2, 1)))


def late_output(seed: int) -> mf.Record:
    """Two outputs, the second late by three samples."""
    clean = mf.simulate(TWO, input=CHIRP, duration=20.0, intervals=512)
    y = clean.y.copy()
    y[1] = np.roll(y[1], 3)
    y[1, :3] = y[1, 3]
    return noisy(mf.Record(y=y, u=clean.u, dt=clean.dt, intersample=clean.intersample), seed)


def held_drift(seed: int) -> mf.Record:
    rec = held(seed)
    return rec.assign(y=rec.y[0] + 3 * rec.y.std() * rec.t / 20)


def drifting(seed: int) -> mf.Record:
    rec = of(PLANT)(seed)
    return rec.assign(y=rec.y[0] + 0.6 * rec.y.std() * rec.t / 20)


A2, B2 = [[-0.9, 1], [-5.2, -1.4]], [[-0.12], [-7.5]]
FREE2 = {"A": [["Za", 1], ["Ma", "Mq"]], "B": [["Zd"], ["Md"]], "states": ["alpha", "q"], "inputs": ["u"]}
FORCE = {"C": [[0, 1], ["12.2*Za", 0]], "D": [[0], ["12.2*Zd"]], "outputs": ["q", "az"]}
STATES = mf.StateSpace(**FREE2)
FORCES = mf.StateSpace(**FREE2, **FORCE)


def flown(lag: float = 0.0, lever: float = 0.0, force: bool = False, **words: Any) -> Any:
    """A short period behind an actuator: its states, of a late vane, or a rate and an accelerometer."""
    a = np.zeros((4, 4))
    a[:2, :2], a[:2, 3] = A2, np.ravel(B2)
    a[2, 0], a[2, 2], a[3, 3] = 1 / (lag or 1.0), -1 / (lag or 1.0), -1 / 0.07
    c = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0]]) if lag else np.eye(4)[:2]
    names = ["alpha", "q"]
    if force:
        c = np.array([[0, 1, 0, 0], 12.2 * a[0] - 12.2 * np.eye(4)[1] + lever * a[1]])
        names = ["q", "az"]
    plant = mf.ss(a, [[0], [0], [0], [1 / 0.07]], c, np.zeros((2, 1)))
    t = 0.02 * np.arange(700)
    u = 0.05 * (1.0 * (t > 1) - 2 * (t > 1.9) + (t > 2.5)) + 0.04 * (1.0 * (t > 7) - 2 * (t > 8) + (t > 9))
    y, moved = (
        one.simulate(u=u, dt=0.02, intersample="zoh")
        for one in (plant, mf.ss([[-1 / 0.07]], [[1 / 0.07]], [[1.0]]))
    )
    seen = mf.Record(y=y, u=np.ravel(moved), dt=0.02, outputs=names, inputs=["u"], intersample="smooth")
    return lambda seed: noisy(seen, seed, **words)


def turned(*, used: tuple[str, ...] = ("da", "dr"), **scales: float) -> tuple[Any, Any]:
    """Records by seed of a lateral motion, channels times `scales`, and its model of these inputs."""
    columns = {"da": [0, "La", "Na", 0], "dr": ["Yr", "Lr", "Nr", 0]}
    model = mf.StateSpace(
        [["Yb", 0.03, -0.99, "9.81/60"], ["Lb", "Lp", "Lq", 0], ["Nb", "Np", "Nq", 0], [0, 1, 0.03, 0]],
        np.transpose([columns[name] for name in used]).tolist(),
        states=["beta", "p", "r", "phi"],
        inputs=list(used),
    )
    a = [[-0.25, 0.03, -0.99, 9.81 / 60], [-12, -3, 0.9, 0], [5, -0.2, -0.6, 0], [0, 1, 0.03, 0]]
    plant = mf.ss(a, [[0, 0.05], [-8, 2], [-0.4, -3], [0, 0]], np.eye(4), np.zeros((4, 2)))
    t = 0.02 * np.arange(600)
    u = 0.1 * np.array([(1.0 * (t > s) - 2 * (t > s + 0.6) + (t > s + 1.2)) for s in (1, 5)])
    y = plant.simulate(u=u, dt=0.02, intersample="zoh")
    clean = mf.Record(y=y, u=u, dt=0.02, outputs=model.states, inputs=["da", "dr"], intersample="zoh")

    def record(seed: int) -> mf.Record:
        rec = noisy(clean, seed, nsr=0.02)
        return rec.assign(**{name: size * rec[name] for name, size in scales.items()})

    return record, by(model)


def flight(late: int = 0, early: int = 0, **words: Any) -> Any:
    """Records by seed of a short period behind an actuator; the vane late, or the rate early, in samples."""

    def record(seed: int) -> mf.Record:
        rec = flights.flown(seed, **words)
        if late:
            return rec.window(rec.t[late], rec.t[-1]).assign(alpha=rec["alpha"][:-late])
        return rec.window(rec.t[0], rec.t[-1 - early]).assign(q=rec["q"][early:]) if early else rec

    return record


def trimmed(seed: int) -> mf.Record:
    """The same from the rest to which gravity leads."""
    gravity = np.array([0.01, 0.0])
    a = [[flights.TRUTH["Za"], 1], [flights.TRUTH["Ma"], flights.TRUTH["Mq"]]]
    rest = tuple(-np.linalg.solve(a, gravity))
    return flights.flown(seed, trim=rest, forces=lambda t, rng: np.outer(gravity, np.ones(t.size)))


def conditions(seed: int) -> list[mf.Record]:
    """Two manoeuvres, the second at another speed."""
    faster = {**flights.TRUTH, "Ma": -8.0, "Md": -10.0}
    return [flights.flown(2 * seed), flights.flown(2 * seed + 1, truth=faster)]


def joined(seed: int) -> mf.Record:
    """Two records of the plant, one after the other, as one."""
    rng = np.random.default_rng(seed)
    told = {"duration": 10.0, "intervals": 256, "nsr": 0.05}
    each = [
        mf.simulate(
            PLANT, input=text, **told, seed=2 * seed + k, initial_state=[sign * rng.uniform(0.4, 0.8), 0.0]
        )
        for k, (text, sign) in enumerate((("sin(t**2/5)", 1), ("sin(t**2/7+1)", -1)))
    ]
    return mf.Record(y=np.r_[each[0]["y"], each[1]["y"]], u=np.r_[each[0]["u"], each[1]["u"]], dt=10 / 256)


def heated(seed: int) -> mf.Record:
    """A process of 30 s under steps, one sample a second."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.choice([-1.0, 0.0, 1.0], size=20), 60)
    y = mf.tf([12], [30, 1]).simulate(u=steps, dt=1.0, intersample="zoh")
    return mf.Record(y=y + 0.1 * rng.standard_normal(steps.size), u=steps, dt=1.0, intersample="zoh")


def stored(seed: int) -> mf.Record:
    """The same with each value kept until it has changed by one."""
    rec, kept, last = heated(seed), [], 0.0
    for value in rec["y"]:
        last = value if abs(value - last) >= 1 else last
        kept.append(last)
    return rec.assign(y=np.array(kept))
