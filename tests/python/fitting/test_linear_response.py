"""Responses of linear equations between samples: exact, as integration in steps finds them."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from modfun.fitting import linear_response
from modfun.fitting.finer import finer
from modfun.fitting.signs import _is_gain
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options

LAGS = ["T1*a' + a = K1*u1(t - d1)", "T2*b' + b = K2*u2(t - d2) + 2", "T = a + b"]
TRUE = {"T1": 38.0, "K1": 0.42, "d1": 9.3, "T2": 14.0, "K2": -0.9, "d2": 3.0}
BETWEEN = 4  # parts of a sample


def exchanger(forms: tuple[str, str], noise: float = 0.1) -> mf.Record:
    """Two inputs that step, behind a lag and a delay each."""
    rng = np.random.default_rng(1)
    u = np.array([np.repeat(rng.normal(size=n), 600 // n) for n in (8, 15)])
    plants = [mf.tf([k], [late, 1], delay=d) for late, k, d in ((38, 0.42, 9.3), (14, -0.9, 3.0))]
    y = sum(
        plant.simulate(u=own, dt=1.0, intersample=form)
        for plant, own, form in zip(plants, u, forms, strict=True)
    )
    y = y + 5 + noise * rng.standard_normal(u.shape[1])
    return mf.Record(y=y, u=u, dt=1.0, outputs="T", inputs=["u1", "u2"], intersample=forms)


def model() -> mf.Equation:
    params = {name: mf.Free(min=0, max=25) for name in ("d1", "d2")}
    return mf.Equation(LAGS, outputs="T", inputs=["u1", "u2"], params=params)


@pytest.mark.parametrize(("forms", "trend"), [(("zoh", "zoh"), "constant"), (("zoh", "foh"), "linear")])
def test_it_is_that_of_an_integration_in_steps(forms: tuple[str, str], trend: str) -> None:
    rec = exchanger(forms)
    fit = mf.fit(rec, model(), trend=trend)
    assert list(fit.params) == pytest.approx(
        [TRUE[n] for n in fit.param_names], abs=5 * fit.bse.max(), rel=0.1
    )
    fine = finer(rec, BETWEEN)
    at = np.arange(0, fine.t.size, BETWEEN)
    there, start = fit.simulate(rec)
    told = np.zeros((1, fine.t.size), bool)
    told[:, at] = True
    y = np.zeros(told.shape)
    y[:, at] = there
    exact = linear_response.linear_response(fit, rec, fine, at)
    assert exact is not None
    np.testing.assert_allclose(exact, fit.simulate(fine._like(y=y, mask=told), start)[0], atol=1e-6)


def test_without_trend_the_initial_state_alone_is_free() -> None:
    """The output has a part of the input at once, and jumps at samples."""
    u = np.repeat([1.0, -1.0, 0.0, 1.0], 50)
    system = mf.tf([1, 3, 13], [1, 3, 8])
    y = system.simulate(u=u, dt=0.05, intersample="zoh", initial_state=[0.5, -1.0])
    rec = mf.Record(y=y, u=u, dt=0.05, intersample="zoh")
    text = "y'' + a1*y' + a2*y = b0*u'' + b1*u' + b2*u"
    fit = fit_quietly((rec,), mf.Equation(text), Options(band=(0.0, 10.0)))
    fine = finer(rec, BETWEEN)
    exact = linear_response.linear_response(fit, rec, fine, np.arange(0, fine.t.size, BETWEEN))
    assert exact is not None
    assert exact[0, ::BETWEEN] == pytest.approx(y, abs=1e-3)


def test_equations_that_bend_or_change_in_time_are_left_to_integration() -> None:
    rec = exchanger(("zoh", "zoh")).select(inputs=["u1"])
    fine = finer(rec, BETWEEN)
    at = np.arange(0, fine.t.size, BETWEEN)
    for text in ("T' + a*T + b*T**3 = c*u1", "T' + (a + b*t)*T = c*u1", "T' + a*T(t - 2) = c*u1"):
        found = fit_quietly((rec,), mf.Equation(text), Options(trend="constant", band=(0.0, 0.1)))
        assert linear_response.linear_response(found, rec, fine, at) is None


def test_gains_are_told_from_time_constants() -> None:
    terms = model().compiled(("T",), ("u1", "u2")).terms
    assert [name for name in TRUE if name[0] != "d" and _is_gain(name, terms)] == ["K1", "K2"]
    text, late = "y' = -y/T + K/T*u(t - d)", {"d": mf.Free(min=0, max=9)}
    tank = mf.Equation(text, params=late).compiled(("y",), ("u",)).terms
    assert [name for name in ("T", "K") if _is_gain(name, tank)] == ["K"]
