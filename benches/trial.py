"""What a fit warns of: wrong and right set-ups, a hundred records each, into docs/trial.md."""

from __future__ import annotations

import argparse
import re
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parents[1]
TELLS = 1e-6  # p-value of the likelihood ratio below which a record tells right from wrong
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


FIRST = mf.Equation("y' + a1*y = b0*u + c")
LINEAR = mf.Equation("y'' + a1*y' + a2*y = b0*u + c")
DUFFING = mf.Equation("y'' + a1*y' + a2*y + a3*y**3 = b0*u + c")
RIGHT2 = by(TF(poles=2, zeros=0))
DELAYED = mf.tf([5], [1, 3, 8], delay=0.25)
ONE_LATE = mf.tf([5], [1, 3, 8], delay=20 / 512)
FREE = TF(poles=2, zeros=0, delay=mf.Free(min=0.0, max=0.6))
SEPARATE = TF(poles=2, zeros=1, denominator="common")
POLES, DELAY, HOLD = r"pole", r"delay", r"intersample"

WRONG = [
    Setup("one pole for two", of(PLANT), by(TF(poles=1, zeros=0)), RIGHT2, POLES),
    Setup("one pole for a light mode", of(LIGHT), by(TF(poles=1, zeros=0)), RIGHT2, POLES),
    Setup("two poles for three", of(THIRD), by(TF(poles=2, zeros=0)), by(TF(poles=3, zeros=1)), "pole|zero"),
    Setup(
        "two poles for two modes",
        of(mf.tf([4, 2, 90], np.polymul([1, 0.4, 4], [1, 0.6, 25]))),
        by(TF(poles=2, zeros=0), band=8.0),
        by(TF(poles=4, zeros=2), band=8.0),
        POLES,
    ),
    Setup("a zero too few", of(mf.tf([4, 5], [1, 3, 8])), RIGHT2, by(TF(poles=2, zeros=1)), "zero|pole"),
    Setup(
        "a zero too few, step input",
        of(mf.tf([4, 5], [1, 3, 8]), STEPS),
        RIGHT2,
        by(TF(poles=2, zeros=1)),
        "zero|pole",
    ),
    Setup(
        "feed-through left out",
        of(mf.tf([1, 3, 13], [1, 3, 8])),
        by(TF(poles=2, zeros=1)),
        by(TF(poles=2, zeros=2)),
        "zero|pole",
    ),
    Setup(
        "feed-through of a held input left out",
        staircase(mf.tf([1, 3, 13], [1, 3, 8])),
        by(TF(poles=2, zeros=1)),
        by(TF(poles=2, zeros=2)),
        "zero|pole|own sample",
    ),
    Setup("a held input that acts in its own sample", staircase(PLANT, 1), RIGHT2, None, "own sample"),
    Setup("a delay of a quarter second left out", of(DELAYED), RIGHT2, by(FREE), DELAY),
    Setup("the same, steps", of(DELAYED, STEPS), RIGHT2, by(FREE), DELAY),
    Setup("one sample of delay left out", of(ONE_LATE), RIGHT2, by(FREE), DELAY),
    Setup("an output late by six samples", shifted(PLANT, 6), RIGHT2, by(FREE), DELAY),
    Setup("one of two outputs late by three samples", late_output, by(SEPARATE), None, DELAY),
    Setup(
        "half the delay known",
        of(mf.tf([5], [1, 3, 8], delay=0.4)),
        by(TF(poles=2, zeros=0, delay=0.2)),
        by(FREE),
        "delay|pole|zero",
    ),
    Setup(
        "held, declared smooth",
        of(PLANT, "1*(t>1) - 2*(t>5)"),
        declared("smooth", TF(poles=2, zeros=0)),
        declared("zoh", TF(poles=2, zeros=0)),
        HOLD,
    ),
    Setup(
        "smooth, declared held",
        of(PLANT, "sin(t**2/5)", intervals=128),
        declared("zoh", TF(poles=2, zeros=0)),
        declared("smooth", TF(poles=2, zeros=0)),
        f"{HOLD}|delay",
    ),
    Setup(
        "a second input left out",
        two_inputs,
        lambda r: mf.fit(r.select(inputs=["de"]), TF(poles=2, zeros=0)),
        RIGHT2,
        "input|short|pole",
    ),
    Setup("a path left out", two_inputs, by(TF(poles=2, zeros=[0, None])), RIGHT2, "path"),
    Setup("a spike of 20 times the noise", spiked, RIGHT2, None, "leave it out"),
    Setup("a drift", drifting, RIGHT2, by(TF(poles=2, zeros=0), trend="linear"), "linear"),
    Setup("stiffness up by half over the record", changed(1.5), RIGHT2, None, "pieces"),
    Setup("stiffness doubled over the record", changed(2.0), RIGHT2, None, "pieces"),
    Setup(
        "a hard spring",
        nonlinear(lambda s, x, u: [x[1], 5 * u - 3 * x[1] - 8 * x[0] - 20 * x[0] ** 3]),
        RIGHT2,
        None,
        "Equation",
    ),
    Setup(
        "a hard spring, driven harder",
        nonlinear(lambda s, x, u: [x[1], 5 * u - 3 * x[1] - 8 * x[0] - 20 * x[0] ** 3], 2.0),
        RIGHT2,
        None,
        "Equation",
    ),
    Setup(
        "a square in the spring",
        nonlinear(lambda s, x, u: [x[1], 5 * u - 3 * x[1] - 8 * x[0] - 4 * x[0] ** 2]),
        RIGHT2,
        None,
        "Equation",
    ),
    Setup(
        "an actuator that saturates at 0.6",
        nonlinear(lambda s, x, u: [x[1], 5 * np.clip(u, -0.6, 0.6) - 3 * x[1] - 8 * x[0]]),
        RIGHT2,
        None,
        "Equation|pole|zero",
    ),
    Setup(
        "drag by the square",
        nonlinear(lambda s, x, u: [x[1], 5 * u - 6 * x[1] * abs(x[1]) - 8 * x[0]]),
        RIGHT2,
        None,
        "Equation",
    ),
    Setup("a drift under a staircase", held_drift, by(TF(poles=2, zeros=0)), None, "linear"),
    Setup(
        "a vane that lags by 0.08 s, a state space", flown(lag=0.08), by(STATES), None, "lag of the sensor"
    ),
    Setup(
        "an accelerometer off the centre of gravity, a state space",
        flown(lever=-0.2, force=True, nsr=0.02),
        by(FORCES),
        None,
        "lever|sensor of az",
    ),
    Setup(
        "one of four outputs in degrees, a state space", *turned(p=180 / np.pi), None, r"p=rec\['p'\]/57.3\)"
    ),
    Setup("a sideslip of the other sign", *turned(beta=-1.0), None, r"beta=-rec\['beta'\]\)"),
    Setup("an input of the record left out of a state space", *turned(used=("da",)), None, "Input 'dr'"),
    Setup(
        "an equation without the delay",
        of(DELAYED),
        by(LINEAR),
        None,
        "delay|lag|term in u'",
    ),
    Setup("one pole for two, an equation", of(PLANT), by(FIRST), by(LINEAR), "terms? in y''"),
    Setup("two poles for three, an equation", of(THIRD), by(LINEAR), None, "terms in y''' and u'"),
    Setup(
        "a hard spring in a linear equation",
        nonlinear(lambda s, x, u: [x[1], 5 * u - 3 * x[1] - 8 * x[0] - 20 * x[0] ** 3], 2.0),
        by(LINEAR),
        by(DUFFING),
        r"y\*\*[23]",
    ),
    Setup(
        "an equation without the constant",
        lambda s: of(PLANT)(s).assign(y=lambda r: r["y"] + 2.0),
        by(mf.Equation("y'' + a1*y' + a2*y = b0*u")),
        None,
        "constant",
    ),
    Setup(
        "a bound that excludes the truth",
        of(PLANT),
        by(TF(poles=2, zeros=0, params={"a1": mf.Free(max=2.0)})),
        RIGHT2,
        "bound",
    ),
]

RIGHT = [
    Setup("eq. (24), chirp, 5 %", of(PLANT), RIGHT2),
    Setup("the same in 10 s, 256 intervals, 10 %", of(PLANT, duration=10.0, intervals=256, nsr=0.1), RIGHT2),
    Setup("the same in 64 intervals", of(PLANT, duration=10.0, intervals=64, nsr=0.1), RIGHT2),
    Setup("2,000 intervals", of(PLANT, duration=80.0, intervals=2000), RIGHT2),
    Setup("no noise", of(PLANT, nsr=0.0), RIGHT2),
    Setup("no noise, a light mode", of(LIGHT, nsr=0.0), RIGHT2),
    Setup("a light mode", of(LIGHT), RIGHT2),
    Setup("third order", of(THIRD), by(TF(poles=3, zeros=1))),
    Setup("a known delay", of(DELAYED), by(TF(poles=2, zeros=0, delay=0.25))),
    Setup("a free delay", of(DELAYED), by(FREE)),
    Setup("steps", of(PLANT, STEPS), RIGHT2),
    Setup("a held staircase", held, RIGHT2),
    Setup("sines", of(PLANT, "sin(t) + sin(2.3*t) + sin(4.1*t)"), RIGHT2),
    Setup("coloured noise, AR(0.5)", of(PLANT, pole=0.5), RIGHT2),
    Setup("coloured noise, AR(0.9)", of(PLANT, pole=0.9), RIGHT2),
    Setup("coloured noise, AR(0.95), a light mode", of(LIGHT, pole=0.95), RIGHT2),
    Setup("two inputs", two_inputs, RIGHT2),
    Setup("two outputs", of(TWO), by(SEPARATE)),
    Setup("two outputs, own denominators", of(TWO), by(TF(poles=2, zeros=1, denominator="separate"))),
    Setup("three records", lambda s: [of(PLANT)(3 * s + k) for k in range(3)], RIGHT2),
    Setup("an equation", of(PLANT), by(LINEAR)),
    Setup(
        "an equation with feed-through, a staircase",
        staircase(mf.tf([1, 3, 13], [1, 3, 8])),
        by(mf.Equation("y'' + a1*y' + a2*y = b0*u'' + b1*u' + b2*u + c")),
    ),
    Setup("a state space, both states", flown(), by(STATES)),
    Setup("a state space, rate and accelerometer", flown(force=True, nsr=0.02), by(FORCES)),
    Setup("a state space in coloured noise, AR(0.9)", flown(pole=0.9), by(STATES)),
    Setup("a state space of four outputs and two held inputs", *turned()),
    Setup("an equation in coloured noise, AR(0.9)", of(PLANT, pole=0.9), by(LINEAR)),
    Setup("a Duffing oscillator", nonlinear(spring), by(DUFFING)),
    Setup("two outputs, a band given", of(TWO), by(SEPARATE, harmonics=20)),
]  # fmt: skip


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
