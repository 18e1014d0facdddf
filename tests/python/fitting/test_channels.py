"""Which channels of a record a model takes; bands in the wrong unit; parameters by name."""

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
EQUATION = mf.Equation("y'' + a*y' + b*y = c*u")


@pytest.fixture(scope="module")
def plain():
    return mf.simulate(SYSTEM, input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.1, seed=0)


@pytest.fixture(scope="module")
def rich(plain):
    more = plain.assign(z=2 * plain["y"], w=plain["u"] ** 2, mark=0 * plain["u"])
    return more.select(outputs=["z", "y"], inputs=["w", "u"])


@pytest.mark.parametrize("fit", [mf.fit, lambda rec, model: mf.fit_many([rec], model)], ids=["fit", "many"])
def test_equations_leave_out_what_they_do_not_name(plain, rich, fit):
    assert np.array_equal(fit(rich, EQUATION).params, fit(plain, EQUATION).params)


def test_fits_take_their_channels_of_any_record(plain, rich):
    for model in (EQUATION, mf.TransferFunction(poles=2, zeros=0)):
        fit = mf.fit(plain, model)
        assert np.array_equal(fit.predict(rich).y, fit.predict(plain).y)
        assert fit.score(rich) == fit.score(plain)


def test_a_channel_that_is_missing_is_named(plain):
    fit = mf.fit(plain, EQUATION)
    with pytest.raises(mf.DataError, match=r"record has outputs \['q'\] .*the fit needs \['y'\]"):
        fit.predict(mf.Record(y=plain.y, u=plain.u, dt=plain.dt, outputs="q"))


def test_a_parameter_named_as_a_kept_channel_is_refused(rich):
    model = mf.Equation("y'' + a*y' + b*y = c*u + mark")
    with pytest.raises(mf.SpecError, match=r"'mark' is a parameter .*inputs=\['w', 'u', 'mark'\]"):
        mf.fit(rich, model)


def test_a_band_in_hertz_is_guessed(plain):
    model = mf.TransferFunction(poles=2, zeros=0)
    with pytest.warns(mf.ModfunWarning, match="unstable"):
        fit = mf.fit(plain, model, band=1.0)
    assert (
        "below 98 % of the power of the outputs. If the edge was meant in Hz, give band=6.283" in fit.check()
    )
    for band in (3.0, 6.283, 12.0):
        assert "in Hz" not in mf.fit(plain, model, band=band).check()
    with pytest.raises(mf.DataError, match=r"real equations .*rad/s: 0\.5 Hz would be 3\.142 rad/s"):
        mf.fit(plain, model, band=0.5)


def test_estimates_errors_and_p_values_by_name(plain):
    fit = mf.fit(plain, mf.TransferFunction(poles=2, zeros=1))
    assert [fit.params[name] for name in fit.param_names] == fit.params.tolist()
    table = fit.table(pvalues=True)
    assert fit.bse["b0"] == table["se"][2]
    from scipy.stats import t

    wanted = 2 * t.sf(np.abs(fit.params / fit.bse), fit.degrees)
    np.testing.assert_allclose(table["p"], wanted, rtol=1e-10)
    assert table["p"][2] > 0.01 > table["p"][3]  # b0 is 0, b1 is 5
    assert fit.table(pvalues=True, initial=True)["p"].size == 7
