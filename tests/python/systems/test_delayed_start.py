"""Inputs behind a delay before the first sample: zero from a zero state, their first value from rest."""

import modfun as mf
import numpy as np
import pytest

DT, COUNT = 0.02, 400


def delayed(late):
    return mf.tf([8.0], [1, 3, 8.0], delay=late)


@pytest.mark.parametrize("kind", ["zoh", "foh", "smooth"])
@pytest.mark.parametrize("late", [0.2, 0.213])
def test_samples_are_zero_before_the_first_as_in_a_step(kind, late):
    """After 0.1 s the response to samples was 0.072, that to a step 0."""
    system, u = delayed(late), np.full(COUNT, 2.0)
    step = 2 * system.step(DT * (COUNT - 1), COUNT - 1)[1]
    assert system.simulate(u=u, dt=DT, intersample=kind) == pytest.approx(step, abs=1e-12)
    rec = mf.simulate(system, input=u, duration=DT * (COUNT - 1), intervals=COUNT - 1, intersample=kind)
    assert rec.y[0] == pytest.approx(step, abs=1e-12)


def test_inputs_that_move_from_another_value():
    """Beside the same input from far before, of which the time before t = 0 is zero."""
    system, t = delayed(0.213), DT * np.arange(COUNT)
    u, before = 1.5 + np.sin(t), 50
    for kind in ("zoh", "foh"):
        if kind == "foh":  # that line from 0 to the first value is none of the record's
            early = np.full(before, u[0])
            held = np.concatenate([np.full(before, -u[0]), np.zeros(COUNT)])
            whole = system.simulate(u=np.concatenate([early, u]), dt=DT, intersample=kind)
            whole = whole + system.simulate(u=held, dt=DT, intersample="zoh")
        else:
            whole = system.simulate(u=np.concatenate([np.zeros(before), u]), dt=DT, intersample=kind)
        assert system.simulate(u=u, dt=DT, intersample=kind) == pytest.approx(whole[before:], abs=1e-12)


def plant(seed, noise=0.01):
    """What a plant does that was at zero before its input came on at the first sample."""
    now = mf.tf([8.0], [1, 3, 8.0]).simulate(u=np.full(COUNT, 2.0), dt=DT, intersample="zoh")
    y = np.concatenate([np.zeros(10), now[:-10]])
    y = y + noise * np.random.default_rng(seed).standard_normal(COUNT)
    return mf.Record(y=y, u=np.full(COUNT, 2.0), dt=DT, intersample="zoh")


def test_a_fit_from_zero_takes_the_input_as_zero_before():
    """a2 was 5.9±0.25. Four standard errors of three parameters: false alarm 2e-4."""
    model = mf.TransferFunction(poles=2, zeros=0, delay=0.2)
    fit = mf.fit(plant(0), model, initial_state="zero")
    assert np.all(np.abs(fit.params - [3, 8, 8]) < 4 * fit.bse)
    clean = plant(0, 0.0)
    predicted = fit.predict(clean, initial_state="zero").y[0]
    assert predicted[:11] - predicted[0] == pytest.approx(0, abs=1e-12)  # it may have an offset
    bound = mf.crlb(delayed(0.2), clean, sigma=0.01, initial_state="zero", trend="constant").sd
    assert fit.bse == pytest.approx(bound, rel=0.5)
    many = mf.fit_many([plant(0), plant(0)], model, initial_state="zero")
    assert many.params[0] == pytest.approx(np.asarray(fit.params), rel=1e-9)
    study = mf.MonteCarlo(
        system=delayed(0.2),
        input=np.where(np.arange(COUNT) < 200, 2.0, 3.0),
        duration=DT * (COUNT - 1),
        intervals=COUNT - 1,
        intersample="zoh",
        nsr=0.05,
        replicates=4,
        estimators={"ml": mf.Estimator(model, initial_state="zero")},
    ).run(progress=False)
    assert not np.any(study.failures)
    assert study.replicate(0)[1]["ml"].params == pytest.approx([3, 8, 8], rel=0.2)


def test_a_prediction_from_rest_holds_the_first_value():
    t = DT * np.arange(COUNT)
    u = np.where(t < 2, 5.0, 7.0)
    y = 3 + delayed(0.2).simulate(u=u - 5, dt=DT, intersample="zoh")
    rec = mf.Record(
        y=y + 1e-4 * np.random.default_rng(1).standard_normal(COUNT), u=u, dt=DT, intersample="zoh"
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, delay=0.2), initial_state="rest")
    assert fit.params == pytest.approx([3, 8, 8], rel=5e-3)
    assert fit.predict(rec, initial_state="rest").y[0] == pytest.approx(y, abs=1e-3)
