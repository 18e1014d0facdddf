"""Simulated manoeuvres of a short period, for tests of what fits say of flight records."""

import warnings

import modfun as mf
import numpy as np

TRUTH = {"Za": -0.9, "Ma": -5.2, "Mq": -1.4, "Zd": -0.12, "Md": -7.5}
SPEED = 60.0
SHORT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
FORCES = SHORT._like(
    C=[[1, 0], [0, 1], [f"{SPEED}*Za", 0]], D=[[0], [0], [f"{SPEED}*Zd"]], outputs=["alpha", "q", "az"]
)
WRITTEN = mf.Equation(
    ["alpha' = Za*alpha + q + Zd*de + c1", "q' = Ma*alpha + Mq*q + Md*de + c2"],
    outputs=["alpha", "q"],
    inputs=["de"],
)
FINE = 4  # steps of the simulation in one of the record


def elevator(t, seed):
    """Two doublets of their own size and time."""
    rng = np.random.default_rng(1000 + seed)
    a, b, late = 0.05 * rng.uniform(0.7, 1.3), 0.04 * rng.uniform(0.7, 1.3), rng.uniform(-0.3, 0.3)
    first = 1.0 * (t > 1) - 2 * (t > 1.9) + (t > 2.5 + late / 3)
    second = 1.0 * (t > 7 + late) - 2 * (t > 8 + late) + (t > 9 + late)
    return a * first + b * second


def flown(
    seed,
    *,
    truth=TRUTH,
    nsr=0.05,
    dt=0.02,
    duration=16.0,
    lag=0.0,
    force=False,
    colour=0.0,
    gust=0.0,
    forces=lambda t, rng: np.zeros((2, t.size)),
    trim=(0.01, 0.0),
    **scales,
):
    """A record of a surface behind an actuator.

    `lag` of the vane, s; `force`: with an accelerometer; `colour`: pole of the sensors' noise, a sample;
    `gust`: of 1 s, rad rms; `forces` in both equations; channels times `scales`.
    """
    t, rng = np.arange(0, duration + dt / 8, dt / FINE), np.random.default_rng(seed)
    actuator = mf.ss([[-20]], [[20]], [[1]])
    u = np.ravel(actuator.simulate(u=elevator(t, seed), dt=dt / FINE, intersample="zoh"))
    w = coloured(rng.standard_normal(t.size), np.exp(-dt / FINE), gust)
    plant = mf.ss(
        [[truth["Za"], 1], [truth["Ma"], truth["Mq"]]],
        [[truth["Zd"], truth["Za"], 1, 0], [truth["Md"], truth["Ma"], 0, 1]],
        np.eye(2),
        np.zeros((2, 4)),
    )
    driven = np.vstack([u, w, forces(t, rng)])
    rows = plant.simulate(u=driven, dt=dt / FINE, intersample="foh", initial_state=list(trim))
    az = SPEED * (truth["Za"] * (rows[0] + w) + truth["Zd"] * u)
    if lag:
        rows[0] = np.ravel(mf.tf([1], [lag, 1]).simulate(u=rows[0], dt=dt / FINE, intersample="smooth"))
    y = np.vstack([rows, az])[: 2 + force, ::FINE]
    noise = np.array([coloured(own, colour) for own in rng.standard_normal(y.shape)])
    y = y + nsr * y.std(axis=1, keepdims=True) * noise
    names = ("alpha", "q", "az")[: len(y)]
    outputs = {name: scales.get(name, 1) * row for name, row in zip(names, y, strict=True)}
    return mf.Record(outputs, {"de": u[::FINE]}, dt=dt, intersample="smooth")


def coloured(white, pole, size=1.0):
    """Noise of first order and that standard deviation."""
    found, gain = np.zeros(white.size), size * np.sqrt(1 - pole**2)
    last = 0.0
    for k, own in enumerate(white):
        found[k] = last = pole * last + gain * own
    return found


def warned(records, model, **options):
    """A fit and its warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", mf.ModfunWarning)
        fit = mf.fit(records, model, **options)
    assert len(caught) <= 1
    return fit, " ".join(str(one.message) for one in caught)


def off(fit):
    """Standard errors between the worst derivative and its true value."""
    return max(abs(fit[name] - value) / fit.bse[name] for name, value in TRUTH.items())
