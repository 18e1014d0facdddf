"""A delay of an input that may as well be a lag of its actuator, and where the record tells the two apart."""

import re

import modfun as mf
import numpy as np
import pytest
from flights import warned

TRUTH = {"Za": -0.85, "Ma": -4.2, "Mq": -1.1, "Zde": -0.09, "Mde": -6.3}
TAU = 0.05
MATRICES = [["Za", 1], ["Ma", "Mq"]], [["Zde"], ["Mde"]]
SHORT = mf.StateSpace(*MATRICES, states=["alpha", "q"], inputs=["de"])
LATE = SHORT._like(delay="tau", params={"tau": mf.Free(min=0, max=0.3)})
WRITTEN = mf.Equation(
    ["alpha' = Za*alpha + q + Zde*de(t - tau) + c1", "q' = Ma*alpha + Mq*q + Mde*de(t - tau) + c2"],
    outputs=["alpha", "q"],
    inputs=["de"],
    params={"tau": mf.Free(min=0, max=0.3)},
)
SERVO = mf.StateSpace(
    [["Za", 1, "Zde"], ["Ma", "Mq", "Mde"], [0, 0, -1 / TAU]],
    [[0], [0], [1 / TAU]],
    [[1, 0, 0], [0, 1, 0]],
    [[0], [0]],
    states=["a", "r", "d"],
    inputs=["de"],
    outputs=["alpha", "q"],
)


def command(t):
    """A 3-2-1-1 of 2 degrees with edges of 0.15 s."""
    moves = [(1, 2.5, 1), (2.5, 3.5, -1), (3.5, 4, 1), (4, 4.5, -1), (7, 7.6, 1), (7.6, 8.2, -1)]
    return sum(sign * (np.tanh((t - a) / 0.06) - np.tanh((t - b) / 0.06)) for a, b, sign in moves)


def flown(seed, kind, nsr=0.05):
    """A manoeuvre whose command is recorded, and whose surface follows it by a lag, or as much later."""
    t = np.arange(601) * 0.02
    u = command(t)
    model, given, start = (
        (SERVO, u, [0.2, -0.3, 0]) if kind == "lag" else (SHORT, command(t - TAU), [0.2, -0.3])
    )
    rec = mf.simulate(
        model.model(TRUTH), input=given, duration=12, intervals=600, intersample="smooth", nsr=nsr, seed=seed,
        initial_state=start,
    )  # fmt: skip
    return rec.select(outputs=["alpha", "q"], inputs=["de"]).assign(de=u)


def worst(fit):
    return max(abs(fit[name] - value) / fit.bse[fit.param_names.index(name)] for name, value in TRUTH.items())


def advised(text):
    """The model of a message."""
    return eval(
        re.search(r"mf\.(?:StateSpace|TransferFunction)\(.*?\)(?=: BIC|\. BIC|\.$|$)", text)[0], {"mf": mf}
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_lag_fitted_as_a_delay_is_named_and_its_code_runs(seed):
    """Mde was 5 to 10 of its errors off, and nothing was found."""
    rec = flown(seed, "lag")
    fit, text = warned(rec, LATE)
    assert worst(fit) > 4.9
    assert "The delay tau seems to be a lag: Mde is -6." in text
    assert "in place of the delay tau, as a state: de_moved' = (de - de_moved)/lag, mf.StateSpace(" in text
    assert len([own for own in fit.check() if "lag" in own]) == 1
    better, again = warned(rec, advised(text))
    assert not again
    assert worst(better) < 3
    assert abs(better["lag"] - TAU) < 0.003


@pytest.mark.parametrize("seed", range(4))
def test_a_delay_stays_one(seed):
    fit, text = warned(flown(seed, "delay"), LATE)
    assert not text
    assert "lag" not in str(fit.check())
    assert worst(fit) < 3


@pytest.mark.parametrize(("seed", "kind"), [(0, "lag"), (3, "lag"), (1, "delay")])
def test_what_a_record_leaves_open_is_noted(seed, kind):
    """At 10 % noise a short manoeuvre leaves it open now and then, and an estimate is 3 errors off."""
    fit, text = warned(flown(seed, kind, nsr=0.1), LATE)
    assert not text
    note = fit.check().note
    far = re.search(r"The delay tau may as well be a lag: then Mde is \S+ ± \S+, (\S+) standard errors", note)
    assert float(far[1]) > 2
    assert re.search(rf"\(BIC [0-9.]+ {'lower' if kind == 'lag' else 'higher'}\)\. If you know", note)
    assert note in str(fit.summary())
    assert isinstance(advised(note), mf.StateSpace)


def test_equations_and_transfer_functions_are_looked_at_too():
    rec = flown(0, "lag")
    _, text = warned(rec, WRITTEN)
    assert "The delay tau seems to be a lag: Mde is -6.1" in text
    assert "\"lag*de_moved' + de_moved = de\" with params={'lag': mf.Free(0.05" in text
    _, text = warned(rec.select(outputs=["q"]), mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(max=0.3)))
    assert re.search(
        r"The delay seems to be a lag: .* First try one more pole in place of the delay, a lag", text
    )
    assert "mf.TransferFunction(poles=3, zeros=1): BIC" in text


def test_without_a_delay_the_actuator_is_written_out():
    rec = flown(0, "lag")
    _, text = warned(rec, SHORT)
    assert "First try a lag of the actuator of de (0.05" in text
    assert "as a state: de_moved' = (de - de_moved)/lag, mf.StateSpace([['Za', 1, 'Zde']" in text
    better, again = warned(rec, advised(text))
    assert not again
    assert worst(better) < 3


def test_a_lag_that_is_none_is_to_be_taken_out():
    """It ended on its least value, and the advice was to widen that."""
    model = advised(warned(flown(0, "lag"), SHORT)[1])
    rec = flown(0, "delay").assign(de=command(np.arange(601) * 0.02 - TAU))
    fit, text = warned(rec, model)
    assert fit.at_bound == ("lag",)
    assert "the record shows no lag" in text
    assert "First take lag out, with de in place of the state de_moved." in text


ROLL = mf.StateSpace([["Lp"]], [["Lda"]], states=["p"], inputs=["da"])
ROLL_LATE = ROLL._like(delay="h", params={"h": mf.Free(min=0, max=0.3)})


def rolled(seed, lag, late):
    """Roll of a small aircraft by held commands, behind a servo with a lag and a delay of whole steps."""
    count, step = 1251, 0.02
    u = np.zeros(count)
    for at, width, height in [
        (100, 25, 150),
        (300, 20, -200),
        (500, 35, 120),
        (700, 15, -220),
        (900, 25, 180),
    ]:
        u[at : at + width], u[at + width : at + 2 * width] = height, -height
    roll = mf.tf([-0.035], [1, 9])
    plant = roll * mf.tf([1], [lag, 1]) if lag else roll
    rec = mf.simulate(
        plant, input=np.r_[np.zeros(late), u[: count - late]], duration=(count - 1) * step,
        intervals=count - 1, intersample="zoh", nsr=0, seed=seed,
    )  # fmt: skip
    y = rec.y[0] + 0.02 * np.random.default_rng(seed).normal(size=count)
    return mf.Record(y=y, u=u, dt=step, outputs="p", inputs="da")


@pytest.mark.parametrize("model", [ROLL, ROLL_LATE])
def test_a_lag_beside_a_delay_is_named_with_it(model):
    """Lp of -9 was -7 ± 0.1 with the delay alone, to which the first advice led."""
    rec = rolled(0, 0.06, 1)
    fit, text = warned(rec, model)
    assert abs(fit["Lp"] + 9) > 10 * fit.bse[0]
    assert "First try a lag of the actuator of da (0.0" in text
    assert ("beside the delay h, as" if model is ROLL_LATE else "beside a delay (h = 0.0") in text
    better, again = warned(rec, advised(text))
    assert not again
    assert abs(better["Lp"] + 9) < 3 * better.bse[0]
    assert abs(better["lag"] - 0.06) < 0.02


@pytest.mark.parametrize("seed", range(2))
def test_a_true_delay_has_no_lag_beside_it(seed):
    fit, text = warned(rolled(seed, 0, 3), ROLL_LATE)
    assert not text
    assert "lag" not in str(fit.check())


def test_a_lag_alone_is_named_alone():
    """Held commands were read as straight lines, which made up for half a sample, and a delay stayed."""
    _, text = warned(rolled(0, 0.06, 0), ROLL_LATE)
    assert "The delay h seems to be a lag" in text
    assert "in place of the delay h" in text
