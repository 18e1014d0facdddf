"""What nonlinear equations lack is named: a product, a sine, a delay of an input that stands in products."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

PUSHED = "y'' + d*y' + a*sin(y) = g*u1 + h*u2"
INPUT = "sin(0.7*t) + sin(1.3*t + 1) + 0.7*sin(2.1*t + 2)"


def _record(text, truth, start, late=0, scale=1.0, offset=0.0, nsr=0.05):
    model = mf.Equation(text).model(truth)
    u = f"{offset} + {scale}*({INPUT})"
    rec = mf.simulate(model, input=u, duration=40.0, intervals=256, initial_state=start)
    noise = nsr * np.std(rec["y"]) * np.random.default_rng(0).normal(size=rec.t.size)
    y, held = rec["y"] + noise, rec["u"]
    n = rec.t.size - late
    return mf.Record(y=y[:n], u=held[late:], dt=rec.dt)


MISSING = {
    "y**2*y'": ("y'' - m*(1 - y**2)*y' + a*y = u", {"m": 0.8, "a": 1.0}, [0.5, 0.0], "y'' - m*y' + a*y = u"),
    "sin(y)": ("y'' + d*y' + a*sin(y) = u", {"d": 0.3, "a": 2.0}, [0.3, 0.0], "y'' + d*y' + a*y = u"),
    "y*abs(y)": ("y' + a*y*abs(y) = b*u", {"a": 0.4, "b": 0.5}, [0.3], "y' + a*y = b*u"),
    "y*u": ("y' = -a*y + b*u + c*u*y", {"a": 0.8, "b": 0.6, "c": 0.4}, [0.3], "y' = -a*y + b*u + k"),
}  # fmt: skip


@pytest.mark.parametrize("term", MISSING)
def test_a_product_that_is_missing_is_named(term):
    text, truth, start, fitted = MISSING[term]
    rec = _record(text, truth, start)
    with pytest.warns(mf.ModfunWarning) as caught:
        mf.fit(rec, mf.Equation(fitted))
    assert f"First try a term in {term} (coefficient" in str(caught[0].message)
    mf.fit(rec, mf.Equation(text))  # in silence


@pytest.mark.parametrize(
    ("text", "truth", "offset"),
    [
        ("y' = -v*y/(k + y) + b*u", {"v": 1.0, "k": 0.8, "b": 0.5}, 1.0),
        ("y' = -a*y + b*u + c*u*y", {"a": 0.8, "b": 0.6, "c": 0.4}, 0.0),
    ],
)
def test_an_input_in_products_that_acts_late_has_its_delay_named(text, truth, offset):
    rec = _record(text, truth, [0.8], late=4, scale=0.2, offset=offset)
    with pytest.warns(mf.ModfunWarning) as caught:
        mf.fit(rec, mf.Equation(text))
    assert "First try a delay of u, u(t - 0.625): BIC" in str(caught[0].message)
    late = mf.fit(rec, mf.Equation(text.replace("u", "u(t - 0.625)")))  # as it says, in silence
    for name, error in zip(late.param_names, late.bse, strict=True):
        assert abs(late[name] - truth[name]) < 4 * error


def test_an_input_that_acts_by_a_product_only_is_named_where_the_model_lacks_it():
    prey = ["x' = a*x - b*x*y - x*u", "y' = c*x*y - d*y"]
    truth, rng = {"a": 1.1, "b": 0.4, "c": 0.1, "d": 0.4}, np.random.default_rng(1)
    slow = "0.08*(sin(0.25*t) + sin(0.5*t + 1) + sin(0.8*t + 2))"
    model = mf.Equation(prey, outputs=["x", "y"]).model(truth)
    rec = mf.simulate(model, input=slow, duration=40.0, intervals=256, initial_state=[10.0, 5.0])
    rec = rec.assign(**{name: rec[name] + 0.2 * rng.normal(size=rec.t.size) for name in ("x", "y")})
    with pytest.warns(mf.ModfunWarning, match="Input 'u' is in the record and not in the model"):
        mf.fit(rec, mf.Equation([prey[0].replace(" - x*u", ""), prey[1]], outputs=["x", "y"]))


def test_one_delay_of_all_inputs_is_named():
    model = mf.Equation(PUSHED).model({"d": 0.3, "a": 4.0, "g": 1.0, "h": 0.7})
    seen = mf.simulate(
        model, input=[f"2*({INPUT})", "2*sin(0.9*t) + 2*sin(2.9*t + 1)"], duration=30.0, intervals=256,
        initial_state=[0.3, 0.0],
    )  # fmt: skip
    y = seen["y"] + 0.05 * np.std(seen["y"]) * np.random.default_rng(0).normal(size=seen.t.size)
    rec = mf.Record(y=y[:-4], u={name: seen[name][4:] for name in ("u1", "u2")}, dt=seen.dt)
    with pytest.warns(mf.ModfunWarning, match=r"First try a delay of u1, u2, u1\(t - h\), u2\(t - h\) with"):
        mf.fit(rec, mf.Equation(PUSHED))


def test_forgotten_radiation_is_named_and_no_sine_of_a_temperature():
    model = mf.Equation("T' = p*P - h*(T - 293) - r*(T**4 - 293**4)", outputs="T", inputs="P")
    power = np.repeat(np.random.default_rng(3).choice([0.0, 150.0, 300.0, 450.0], 30), 24)
    rec = mf.simulate(
        model.model({"p": 2e-3, "h": 8e-4, "r": 1.5e-12}),
        input=power,
        duration=5.0 * (power.size - 1),
        intervals=power.size - 1,
        initial_state=[300.0],
        intersample="zoh",
    )
    warm = rec.assign(T=rec["T"] + np.random.default_rng(3).standard_normal(rec.t.size))
    with pytest.warns(mf.ModfunWarning):
        fit = mf.fit(warm, mf.Equation("T' = p*P - h*(T - 293)", outputs="T", inputs="P"))
    assert "a term in T**4 (coefficient -1." in str(fit.check())
    assert "sin(T)" not in str(fit.check())


def test_terms_that_bend_alike_are_named_together():
    """Over a small range y**3, sin(y) and y*abs(y) differ by less than noise of 10 %, by more than 1 %."""
    t = np.linspace(0, 30, 301)

    def rates(s, x):
        return [x[1], -0.3 * x[1] - x[0] - 0.1 * x[0] ** 3 + np.sin(1.1 * s) + 0.5 * np.sin(2.3 * s)]

    y = solve_ivp(rates, (0, 30), [1, 0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    model = mf.Equation("y'' + d*y' + a*y = b*u")
    for nsr in (0.01, 0.1):
        for seed in range(4):
            noisy = y + nsr * y.std() * np.random.default_rng(seed).standard_normal(t.size)
            rec = mf.Record(noisy, np.sin(1.1 * t) + 0.5 * np.sin(2.3 * t), t=t)
            with pytest.warns(mf.ModfunWarning, match="First try a term in") as caught:
                mf.fit(rec, model)
            text = str(caught[0].message)
            assert ("hardly tells apart" in text) == (nsr == 0.1)
            assert "a term in y**3 (" in text or " or in y**3" in text or "or y**3" in text


PREY = mf.Equation(["H' = a*H - b*H*L", "L' = -c*L + d*H*L"], outputs=["H", "L"])


def _noisy(model, start, duration, noise):
    """A free motion of two species with noise."""
    rec = mf.simulate(model, duration=duration, intervals=300, initial_state=start)
    return rec.assign(**{name: rec[name] + own for name, own in zip(("H", "L"), noise(rec), strict=True)})


@pytest.mark.parametrize("seed", range(3))
def test_several_equations_that_lack_saturation_are_refuted(seed):
    """Residuals were 20 times the noise without a warning, in 5 of 5 records."""
    model = mf.Equation(
        ["H' = H*(1 - H/3) - 1.2*H*L/(1 + 0.9*H)", "L' = 0.7*H*L/(1 + 0.9*H) - 0.35*L"], outputs=["H", "L"]
    ).model({})
    white = np.random.default_rng(seed).standard_normal((2, 301))
    rec = _noisy(
        model, [1.0, 0.4], 60.0, lambda rec: 0.03 * np.sqrt(np.mean(rec.y**2, axis=1))[:, None] * white
    )
    with pytest.warns(mf.ModfunWarning, match="Part of the response is missing: the residuals are [12][0-9]"):
        mf.fit(rec, PREY)


def test_right_equations_in_slow_noise_are_not():
    """AR(0.9) noise of 10 %: 0 of 30 others warned."""
    model = PREY.model({"a": 1.0, "b": 0.5, "c": 0.8, "d": 0.4})
    for seed in range(6):
        white = np.random.default_rng(seed).standard_normal((2, 401))
        slow = lfilter([np.sqrt(0.19)], [1, -0.9], white, axis=1)[:, 100:]
        rec = _noisy(model, [2.0, 1.0], 20.0, lambda rec, e=slow: 0.1 * rec.y.std(axis=1, keepdims=True) * e)
        with warnings.catch_warnings():
            warnings.simplefilter("error", mf.ModfunWarning)
            mf.fit(rec, PREY)
