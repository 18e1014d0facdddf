"""Motions that dry friction slows down: fits name it, not noise inside, and right ones do not."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.dry_friction import dry_friction
from scipy.integrate import solve_ivp

POLES = mf.TransferFunction(poles=2, zeros=0)
WRITTEN = mf.Equation("y'' + d*y' + w2*y = c")
MOTOR = mf.TransferFunction(poles=1, zeros=0)
STIFFNESS, DAMPING = 40.0, 0.8
START, LEVEL, NOISE = 8.0, 20.0, 0.1  # cm


def decay(seed: int, slope, seconds: float = 10.0) -> mf.Record:
    """A mass on a spring that is let go at 8 cm and read from a wall, with noise of 1 mm; `slope` of rate."""
    t = np.arange(0, seconds + 0.01, 0.02)
    y = solve_ivp(
        lambda _, x: [x[1], slope(*x)], (0, t[-1]), [START, 0], t_eval=t,
        method="LSODA", rtol=1e-8, atol=1e-10, max_step=0.005,
    ).y[0]  # fmt: skip
    noise = NOISE * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=y + LEVEL + noise, dt=0.02)


def rubbing(force: float):
    """Slope of the rate with dry friction."""
    return lambda x, v: -STIFFNESS * x - DAMPING * v - force * np.tanh(v / 0.1)


def motor(seed: int, friction: float, *, drag: float = 0.0, load: float = 0.0) -> mf.Record:
    """The speed of a motor under held voltages: w' = -4 w - friction sign(w) + 80 u, noise of 0.5."""
    rng, step, fine = np.random.default_rng(seed), 0.01, 200
    u = np.repeat(rng.choice([-3.0, 3.0], 40), 25)
    h, w, found = step / fine, 0.0, []
    for voltage in u:
        found.append(w)
        shocks = load * np.sqrt(h) * rng.standard_normal(fine) if load else np.zeros(fine)
        for shock in shocks:
            w += h * (80 * voltage - 4 * w - friction * np.sign(w) - drag * w * abs(w)) + shock
    return mf.Record(
        y=np.array(found) + 0.5 * rng.standard_normal(u.size), u=u, dt=step, outputs="w", intersample="zoh"
    )


def gusty(seed: int, level: float) -> mf.Record:
    """The mass on a spring without friction under white noise of a force."""
    rng, h, x, v, y = np.random.default_rng(seed), 0.002, START, 0.0, []
    for k in range(5001):
        if k % 10 == 0:
            y.append(x)
        v += h * (-STIFFNESS * x - DAMPING * v) + level * np.sqrt(h) * rng.standard_normal()
        x += h * v
    return mf.Record(y=np.array(y) + LEVEL + NOISE * rng.standard_normal(501), dt=0.02)


def warned(rec: mf.Record, model, **how) -> str:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        mf.fit(rec, model, **how)
    return "\n".join(str(one.message) for one in found)


def told(rec: mf.Record, model, noise: str):
    """What the look at dry friction says of a fit."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return dry_friction(mf.fit(rec, model, noise=noise))


def follow(text: str, rec: mf.Record) -> tuple[dict, dict]:
    """What the code in a warning finds, and its standard errors."""
    code = text[text.index("mf.rivals.output_error(") : text.index("(rec):")] + "(rec)"
    found = eval(code, {"mf": mf, "rec": rec})
    return dict(found), found.bse


@pytest.mark.parametrize("noise", ["output", "process"])
@pytest.mark.parametrize(("model", "damping"), [(POLES, "a1"), (WRITTEN, "d")])
@pytest.mark.parametrize("force", [0.6, 2.0, 6.0])
def test_a_decay_by_dry_friction_is_named_and_its_advice_is_right(model, damping, noise, force):
    """The advice was noise="process", which left damping 2.7 to 6.8 standard errors off in silence."""
    for seed in range(2):
        rec = decay(seed, rubbing(force))
        text = warned(rec, model, noise=noise)
        assert "Dry friction seems to slow y down" in text
        found, errors = follow(text, rec)
        assert abs(found[damping] - DAMPING) < 3.5 * errors[damping] < 0.1
        assert abs(found["friction"] - force) < 3.5 * errors["friction"] < 1.2


@pytest.mark.parametrize("noise", ["output", "process"])
def test_dry_friction_of_a_motor_is_named(noise):
    rec = motor(0, 40.0)
    text = warned(rec, MOTOR, noise=noise)
    assert "Dry friction seems to slow w down" in text
    found, errors = follow(text, rec)
    for name, value in {"a1": 4.0, "b0": 80.0, "friction": 40.0}.items():
        assert abs(found[name] - value) < 3.5 * errors[name] < 0.02 * value + 1


RIGHT = {
    "no friction": lambda seed: decay(seed, rubbing(0.0)),
    "drag": lambda seed: decay(seed, lambda x, v: -STIFFNESS * x - 0.4 * v - 0.03 * v * abs(v)),
    "a stiffening spring": lambda seed: decay(seed, lambda x, v: -STIFFNESS * x - DAMPING * v - 0.1 * x**3),
    "light gusts": lambda seed: gusty(seed, 1.0),
    "gusts": lambda seed: gusty(seed, 10.0),
}


@pytest.mark.parametrize("kind", RIGHT)
@pytest.mark.parametrize("model", [POLES, WRITTEN])
@pytest.mark.parametrize("noise", ["output", "process"])
def test_free_motions_without_dry_friction_are_not_told_of_it(kind, model, noise):
    for seed in range(3):
        assert told(RIGHT[kind](seed), model, noise) is None


@pytest.mark.parametrize("how", [{}, {"drag": 0.05}, {"load": 30.0}])
def test_motors_without_dry_friction_are_not_told_of_it(how):
    for noise in ("output", "process"):
        assert told(motor(1, 0.0, **how), MOTOR, noise) is None


def test_what_never_turns_round_has_no_friction() -> None:
    """A substrate that an enzyme uses up: "Dry friction seems to slow s down" in 14 to 20 of 20."""
    t = np.linspace(0, 15, 41)
    s = solve_ivp(lambda _, s: -s / (2 + s), (0, 15), [10.0], t_eval=t, rtol=1e-9).y[0]
    for seed in range(4):
        noisy = s + 0.1 * np.random.default_rng(seed).standard_normal(t.size)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            fit = mf.fit(mf.Record(y={"s": noisy}, t=t), mf.Equation("s' = -k*s"))
        assert said
        assert "riction" not in str([*fit.check(), *said])
