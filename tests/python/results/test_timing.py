"""What one sample of a channel's time does to derivatives is said where a record leaves that time open."""

import warnings

import modfun as mf
import numpy as np
import pytest
from flights import SHORT, flown
from modfun.results.shifts import each_moved
from scipy.signal import butter, lfilter, lsim

STEP, GRAVITY = 0.02, 9.80665 / 77
NUMBERS = {
    "Yb": -0.16, "Lb": -9.0, "Lp": -3.2, "Lr": 1.1, "Nb": 4.2, "Np": -0.12, "Nr": -0.42,
    "Yd": 0.04, "Lda": -12.0, "Ldr": 1.2, "Nda": -0.35, "Ndr": -2.6,
}  # fmt: skip
LATERAL = mf.StateSpace(
    [["Yb", 0.03, -1, GRAVITY], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.03, 0]],
    [[0, "Yd"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]],
    states=["beta", "p", "r", "phi"],
    inputs=["da", "dr"],
)


def moved(t, steps):
    """Surface deflections behind a servo."""
    command = np.radians(3) * sum(sign * (t >= at) for at, sign in steps)
    return lsim(([400], [1, 28, 400]), command, t)[1]


def lateral(seed, late=0):
    """A 3-2-1-1 of the rudder and a doublet of the ailerons; beta late by so many samples."""
    fine = np.arange(0, 18 + STEP / 40, STEP / 20)
    dr = moved(fine, [(1, 1), (3.1, -2), (4.5, 2), (5.2, -2), (5.9, 1)])
    da = moved(fine, [(8.5, 1), (9.2, -2), (9.9, 1)])
    model = LATERAL.model(NUMBERS)
    plant = (np.asarray(model.A), np.asarray(model.B), np.eye(4), np.zeros((4, 2)))
    y = lsim(plant, np.column_stack([da, dr]), fine, X0=[0.005, 0.01, -0.01, 0.03])[1]
    y[:, 0] = np.interp(fine - late * STEP, fine, y[:, 0])
    noise = np.random.default_rng(seed).standard_normal((len(fine[::20]), 4))
    y = y[::20] + np.radians([0.1, 0.2, 0.1, 0.1]) * noise
    u = np.vstack([da, dr])[:, ::20]
    return mf.Record(
        dict(zip(["beta", "p", "r", "phi"], y.T, strict=True)),
        dict(zip(["da", "dr"], u, strict=True)),
        dt=STEP,
        intersample="smooth",
    )


def fitted(rec, model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        return mf.fit(rec, model)


def off(fit, values, errors):
    return {
        name: (value - NUMBERS[name]) / error
        for name, value, error in zip(fit.param_names, values, errors, strict=True)
    }


@pytest.mark.parametrize("late", [0, 1])
def test_a_sample_of_the_vane_is_said_to_move_the_derivatives(late):
    """Of 4 records each: the vane alone is named, by the note or by the doubt of its time."""
    for seed in range(4):
        fit = fitted(lateral(seed, late), LATERAL)
        found = fit.check()
        said = [text for text in found if "beta" in text]
        if said:
            assert late
            assert "beta seems to be recorded" in said[0]
            continue
        assert "If beta was recorded one sample (0.02 s) late or early, Y" in found.note
        assert "The same holds" not in found.note
        assert found.note in str(found)
        assert found.note in str(fit.summary())
        assert "If beta was recorded" in fit.summary()._repr_html_()


@pytest.mark.parametrize("late", [0, 1])
def test_with_the_time_as_an_unknown_the_derivatives_are_right(late):
    """Late by one sample they are more than 12 standard errors off, and less than 3.5 so; 4 records each."""
    for seed in range(4):
        fit = fitted(lateral(seed, late), LATERAL)
        beta = next(one for one in each_moved(fit) if one.channel == "beta")
        values = fit.params + beta.slopes * beta.late
        errors = np.hypot(fit.bse, beta.slopes * beta.error)
        assert max(np.abs(list(off(fit, values, errors).values()))) < 3.5
        wrong = off(fit, fit.params, fit.bse)
        assert (wrong["Yb"] > 10) == bool(late)


def test_estimates_follow_a_shift_as_its_slopes_say():
    fit = fitted(lateral(1), LATERAL)
    beta = next(one for one in each_moved(fit) if one.channel == "beta")
    rec = lateral(1)
    sooner = fitted(rec.assign(beta=np.interp(rec.t + STEP, rec.t, rec["beta"])), LATERAL)
    found = (sooner.params - fit.params) / fit.bse
    assert np.abs(found).max() > 12
    assert np.abs(found - beta.slopes * STEP / fit.bse).max() < 1.0


def test_nothing_is_said_where_the_record_tells_the_time():
    """At 2 % noise a shift of one sample would be seen, whatever it moves."""
    for seed in range(5):
        found = fitted(flown(seed, nsr=0.02), SHORT).check()
        assert "one sample" not in found.note


def test_nothing_is_said_beside_a_prior():
    """Which holds the estimates, so that a shift moves them less."""
    held = LATERAL._like(params={"Yb": mf.Free(-0.16, sd=0.01)})
    assert "one sample" not in fitted(lateral(0), held).check().note


def warned_of(rec, model):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", mf.ModfunWarning)
        fit = mf.fit(rec, model)
    return fit, " ".join(str(one.message) for one in caught)


@pytest.mark.parametrize("seed", range(2))
def test_filtered_outputs_ask_for_one_delay_of_all_inputs(seed):
    """A filter of 5 Hz on the outputs alone: 4 to 15 standard errors off with a delay of one input."""
    rec = lateral(seed)
    b, a = butter(2, 0.2)
    filtered = {name: lfilter(b, a, rec[name] - rec[name][0]) + rec[name][0] for name in rec.outputs}
    rec = rec.assign(**filtered)
    text = warned_of(rec, LATERAL)[1]
    assert "one of all inputs, delay=['h', 'h'] and params={'h': mf.Free(min=0, max=...)}" in text
    late = LATERAL._like(delay=["h", "h"], params={"h": mf.Free(min=0, max=0.2)})
    fit, text = warned_of(rec, late)
    assert "First try a delay" not in text
    assert max(abs(fit[name] - value) / fit.bse[name] for name, value in NUMBERS.items()) < 3.5


@pytest.mark.parametrize("channel", ["da", "dr"])
def test_a_delay_of_one_input_is_said_of_that_one(channel):
    rec = lateral(0)
    early = np.interp(rec.t + 2 * STEP, rec.t, rec[channel])
    text = warned_of(rec.assign(**{channel: early}), LATERAL)[1]
    assert f"{channel} seems to act 0.0" in text
    assert "of all inputs" not in text
