"""Inputs say by their samples whether they were held, straight or smooth; what is declared always wins."""

import modfun as mf
import numpy as np
import pytest
from modfun import Record

SIZES = [64, 200, 1001]


def word(u):
    return Record(y=np.sin(0.1 * np.arange(len(u))), u=u, dt=0.05).intersample[0]


def at(n):
    """Time from 0 to 1 and a generator of its own."""
    return np.linspace(0, 1, n), np.random.default_rng(n)


def multisine(n):
    t, rng = at(n)
    return sum(np.sin(2 * np.pi * k * t + rng.uniform(0, 6)) for k in (1, 2, 3, 5))


def staircase(n):
    return np.repeat(np.random.default_rng(n).normal(size=n // 5 + 1), 5)[:n]


def prbs(n):
    return np.random.default_rng(n).choice([-1.0, 1.0], n)


def step(n):
    return np.where(at(n)[0] > 0.3, 2.0, 0.0)


def doublet(n):
    t, _ = at(n)
    return np.where((t > 0.2) & (t <= 0.4), 1.0, 0.0) - np.where((t > 0.4) & (t <= 0.6), 1.0, 0.0)


def pulse(n):
    t, _ = at(n)
    return np.where((t > 0.7) & (t < 0.8), 0.5, 0.0)


def triangle(n):
    return np.interp(at(n)[0], [0, 0.25, 0.75, 1], [0, 1, -1, 0])


def ramps_and_jumps(n):
    t, _ = at(n)
    return np.where(t < 0.5, 2 * t, 2 * t - 1.7)


def noisy(n):
    return multisine(n) + 0.05 * np.random.default_rng(n + 1).normal(size=n)


def quantised(n):
    return np.round(20 * np.sin(2 * np.pi * 2 * at(n)[0])) / 20


def saturated(n):
    return np.clip(1.5 * np.sin(2 * np.pi * 2 * at(n)[0]), -1, 1)


CASES = [
    (staircase, "zoh"),
    (prbs, "zoh"),
    (step, "zoh"),
    (doublet, "zoh"),
    (pulse, "zoh"),
    (triangle, "foh"),
    (multisine, "smooth"),
    (noisy, "smooth"),
    (quantised, "smooth"),
    (saturated, "smooth"),
]


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize(("make", "wanted"), CASES, ids=lambda x: getattr(x, "__name__", x))
def test_samples_say_how_the_input_went(make, wanted, n):
    assert word(make(n)) == wanted


@pytest.mark.parametrize("n", SIZES)
def test_lines_that_jump_are_not_held(n):
    assert word(ramps_and_jumps(n)) != "zoh"


@pytest.mark.parametrize("n", [21, 200, 1001])
def test_what_changes_at_every_sample_is_smooth_and_doubted(n):
    """Held for one sample each, or a motion with power up to the highest frequencies: nobody can tell."""
    u = np.random.default_rng(1).normal(size=n)
    assert word(u) == "smooth"
    assert "power up to the highest frequencies" in str(Record(y=u, u=u, dt=0.1).check())


def test_an_input_at_rest_is_smooth():
    assert word(np.full(64, 3.0)) == "smooth"


def test_printing_says_what_was_seen():
    u = np.array([staircase(200), multisine(200)])
    seen = str(Record(y=multisine(200), u=u, dt=0.05))
    assert "input, zoh (seen)" in seen
    assert "input, smooth (seen)" in seen
    said = str(Record(y=multisine(200), u=u, dt=0.05, intersample=["zoh", "auto"]))
    assert "input, zoh " in said
    assert "zoh (seen)" not in said
    assert "input, smooth (seen)" in said


@pytest.mark.parametrize("declared", ["smooth", "zoh", "foh"])
def test_what_is_declared_wins(declared):
    for make, _ in CASES:
        rec = Record(y=multisine(200), u=make(200), dt=0.05, intersample=declared)
        assert rec.intersample == (declared,)
        assert "seen" not in str(rec)


def test_inputs_left_out_of_a_mapping_are_seen():
    u = np.array([staircase(200), staircase(200)])
    rec = Record(y=multisine(200), u=u, dt=0.05, inputs=["a", "b"], intersample={"a": "smooth"})
    assert rec.intersample == ("smooth", "zoh")


def test_pieces_of_a_record_agree():
    """A piece in which the control rests, or is one ramp, keeps the word of the whole."""
    rec = Record(y=multisine(1001), u=doublet(1001), dt=0.01)
    pieces = [rec.window(0, 1.5), rec.window(1.5, 5), rec.window(7, 10)]
    assert [piece.intersample for piece in pieces] == [("zoh",)] * 3


def test_records_fitted_together_agree():
    """One rests, one moves; the word is that of the one that moves, or what either declares."""
    moved = mf.simulate(
        TRUTH, input=held(), intersample="zoh", duration=10.0, intervals=200, nsr=0.01, seed=1
    )
    active = Record(y=moved.y, u=moved.u, dt=moved.dt)
    free = TRUTH.simulate(u=np.zeros(201), dt=0.05, initial_state=[1.0, 0.0])
    still = Record(y=free + 0.001 * np.random.default_rng(2).normal(size=201), u=np.zeros(201), dt=0.05)
    assert (active.intersample, still.intersample) == (("zoh",), ("smooth",))
    fit = mf.fit([active, still], STRUCTURE)
    assert fit.params == pytest.approx(mf.fit([moved, still], STRUCTURE).params, rel=1e-12)


TRUTH = mf.tf([5], [1, 3, 8])
STRUCTURE = mf.TransferFunction(poles=2, zeros=0)


def held():
    """Four samples at each of random levels, at 20 Hz for 10 s."""
    return np.repeat(np.random.default_rng(0).normal(size=51), 4)[:201]


def far_off(**words):
    """|mean error| of 50 fits of a held 20 Hz input, in standard errors of the mean, by parameter."""
    errors = []
    for seed in range(50):
        made = mf.simulate(
            TRUTH, input=held(), intersample="zoh", duration=10.0, intervals=200, nsr=0.02, seed=seed
        )
        fit = mf.fit(Record(y=made.y, u=made.u, dt=made.dt, **words), STRUCTURE)
        errors.append([fit["a1"] - 3, fit["a2"] - 8, fit["b0"] - 5])
    return np.abs(np.mean(errors, axis=0)) / (np.std(errors, axis=0, ddof=1) / np.sqrt(50))


@pytest.mark.filterwarnings("ignore:fit. Input .u. has a new value only every")  # the wrong word, rightly
def test_a_held_input_at_20_hz_costs_no_bias_with_nothing_declared():
    """Three parameters beyond four standard errors: false alarm 2e-4 for normal errors, seeds are fixed."""
    assert np.all(far_off() < 4)
    assert np.all(far_off(intersample="smooth") > 4)  # what the test would see of the error it is for
