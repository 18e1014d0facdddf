"""Wrong and right set-ups: records, the fit that a user makes, the right one, and words of the first cure."""

from __future__ import annotations

import flights
import modfun as mf
import numpy as np
from trial_records import (
    FORCES,
    LIGHT,
    PLANT,
    STATES,
    STEPS,
    TF,
    THIRD,
    TWO,
    Setup,
    by,
    changed,
    conditions,
    declared,
    drifting,
    flight,
    flown,
    heated,
    held,
    held_drift,
    joined,
    late_output,
    nonlinear,
    of,
    shifted,
    spiked,
    spring,
    staircase,
    stored,
    trimmed,
    turned,
    two_inputs,
)

FIRST = mf.Equation("y' + a1*y = b0*u + c")
LINEAR = mf.Equation("y'' + a1*y' + a2*y = b0*u + c")
DUFFING = mf.Equation("y'' + a1*y' + a2*y + a3*y**3 = b0*u + c")
RIGHT2 = by(TF(poles=2, zeros=0))
DELAYED = mf.tf([5], [1, 3, 8], delay=0.25)
ONE_LATE = mf.tf([5], [1, 3, 8], delay=20 / 512)
FREE = TF(poles=2, zeros=0, delay=mf.Free(min=0.0, max=0.6))
SEPARATE = TF(poles=2, zeros=1, denominator="common")
SHORT = flights.SHORT
WITHOUT = mf.Equation(
    ["alpha' = Za*alpha + q + Zd*de", "q' = Ma*alpha + Mq*q + Md*de"], outputs=["alpha", "q"], inputs=["de"]
)
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
        r"np\.clip\(rec",
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
        "a vane with a factor of 1.08, 2 % noise",
        flight(nsr=0.02, alpha=1.08),
        by(SHORT),
        None,
        "A number in",
    ),
    Setup("a vane late by two samples", flight(late=2), by(SHORT), None, "alpha seems to be recorded"),
    Setup(
        "a pitch rate early by two samples",
        flight(nsr=0.02, early=2),
        by(SHORT),
        None,
        "q seems|alpha seems|recorded",
    ),
    Setup("gusts of 0.01 rad", flight(gust=0.01), by(SHORT), None, "input gust|process"),
    Setup("gravity left out of equations", trimmed, by(WITHOUT), None, 'trend="constant"'),
    Setup("two flight conditions in one list", conditions, by(SHORT), None, "disagree"),
    Setup("an output stored with a dead band", stored, by(TF(poles=1, zeros=0)), None, "dead band"),
    Setup("two records joined end to end", joined, RIGHT2, None, "joined end to end"),
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
    Setup("a short period behind an actuator", flight(), by(SHORT)),
    Setup("the same with an accelerometer", flight(force=True), by(flights.FORCES)),
    Setup("a list of two manoeuvres", lambda s: [flights.flown(2 * s), flights.flown(2 * s + 1)], by(SHORT)),
    Setup("a slow process under steps", heated, by(TF(poles=1, zeros=0))),
    Setup("a Duffing oscillator", nonlinear(spring), by(DUFFING)),
    Setup("two outputs, a band given", of(TWO), by(SEPARATE, harmonics=20)),
]  # fmt: skip
