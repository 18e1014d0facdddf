"""Signals of channels at different times, y(t) y(t - h): formed in time, with the noise of both times."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

DT, COUNT, FINE = 0.1, 400, 100
T = np.arange(COUNT) * DT


def first(t):
    return 1 + 0.5 * np.sin(0.8 * t) + 0.3 * np.sin(1.7 * t + 1)


def second(t):
    return np.cos(0.5 * t) + 0.4 * np.sin(1.1 * t)


def integrated(rate):
    """∫ rate at the samples, from a grid a hundred times as fine."""
    t = np.arange((COUNT - 1) * FINE + 1) * DT / FINE
    return cumulative_simpson(rate(t), x=t, initial=0)[::FINE]


FORMS = {
    "y*y(t - {h})": lambda y, late, v, vl, t: y * late,
    "y(t - {h})**2": lambda y, late, v, vl, t: late**2,
    "v*y(t - {h})": lambda y, late, v, vl, t: v * late,
    "sin(t)*y(t - {h})": lambda y, late, v, vl, t: np.sin(t) * late,
    "t*v(t - {h})": lambda y, late, v, vl, t: t * vl,
    "exp(-t/10)*y(t - {h})": lambda y, late, v, vl, t: np.exp(-t / 10) * late,
    "v*(y - y(t - {h}))": lambda y, late, v, vl, t: v * (y - late),
    "sin(y)*y(t - {h})": lambda y, late, v, vl, t: np.sin(y) * late,
    "y/y(t - {h})": lambda y, late, v, vl, t: y / late,
    "y*y(t - {h})**2": lambda y, late, v, vl, t: y * late**2,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("h", [1.0, 0.33])
def test_products_of_two_times_are_formed_in_time(form, h):
    """Without noise: 0.92 for y*y(t - 1) where both factors were delayed; 0.33 s is 3.3 samples."""
    rate = integrated(lambda t: FORMS[form](first(t), first(t - h), second(t), second(t - h), t))
    driven = {"u": second(T), "inputs": ["v"], "intersample": "smooth"} if "v" in form else {}
    rec = mf.Record(y=np.array([rate, first(T)]), t=T, outputs=["w", "y"], **driven)
    outputs = ["w", "y"] if "y" in form else ["w"]
    model = mf.Equation([f"w' = k*{form.format(h=h)}"], outputs=outputs, inputs=["v"] if driven else [])
    assert mf.fit(rec, model)["k"] == pytest.approx(1.0, abs=3e-6)


def test_two_delays_in_one_signal():
    rec = mf.Record(y=np.array([integrated(lambda t: first(t - 1) * first(t - 2)), first(T)]), t=T)
    fit = mf.fit(rec, mf.Equation(["y1' = k*y2(t - 1)*y2(t - 2)"]))
    assert fit["k"] == pytest.approx(1.0, abs=3e-6)


@pytest.mark.parametrize("h", [1.4, 1.43])
def test_the_delayed_logistic_equation_fits_its_own_simulation(h):
    model = mf.Equation(f"y' = r*y*(1 - y(t - {h})/K)")
    own = mf.simulate(model.model({"r": 1.3, "K": 1.0}), duration=30.0, intervals=300, initial_state=[0.5])
    fit = mf.fit(own, model)
    assert fit.status == "ok"
    assert [fit["r"], fit["K"]] == pytest.approx([1.3, 1.0], abs=2e-5)


@pytest.mark.statistics
def test_noise_of_both_times_counts():
    """Standard errors beside the scatter of 200 records, which is uncertain by 5 %: false alarm 1e-4.

    With the slope of one time only, the errors would be 1.3 times too small.
    """
    clean = np.array([integrated(lambda t: first(t) * first(t - 1)), first(T)])
    model = mf.Equation(["w' = k*y*y(t - 1)"], outputs=["w", "y"])
    found = []
    for seed in range(200):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(clean.shape) * [[0.1], [1.0]]
        fit = mf.fit(mf.Record(y=clean + noise, t=T, outputs=["w", "y"]), model, cov_type="nonrobust")
        found.append((fit["k"], fit.bse[0]))
    values, errors = np.array(found).T
    assert abs(values.mean() - 1) < 4 * values.std() / np.sqrt(200)
    assert values.std() / np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.2)


def test_what_has_no_form_is_refused():
    rec = mf.Record(y=first(T), t=T)
    free = mf.Equation("y' = r*y*(1 - b*y(t - h))", params={"h": mf.Free(0.5, min=0.2, max=2.0)})
    with pytest.raises(mf.SpecError, match="at different times, and the delay h is a parameter"):
        mf.fit(rec, free)
    with pytest.raises(mf.SpecError, match="mixes channels at different times and has no exact form"):
        mf.fit(rec, mf.Equation("y'' + a*y(t - 0.5)*y' + b*y = 0"))
