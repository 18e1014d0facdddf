"""Units of channels: factors beside those of scipy.constants, and what cannot be converted."""

import sys

import modfun as mf
import numpy as np
import pytest
from modfun.base.units import _pint, any_scale, scale
from scipy import constants as known

FACTORS = {
    ("deg/s", "rad/s"): known.degree,
    ("deg/s^2", "rad/s**2"): known.degree,
    ("rpm", "deg/s"): 6.0,
    ("Hz", "rad/s"): 2 * np.pi,
    ("kt", "m/s"): known.knot,
    ("ft/s²", "m/s2"): known.foot,
    ("ft/min", "fpm"): 1.0,
    ("g", "m/s^2"): known.g,
    ("mph", "km/h"): 1.609344,
    ("lbf ft", "N m"): known.lbf * known.foot,
    ("slug*ft^2", "kg m²"): known.slug * known.foot**2,
    ("psi", "kPa"): known.psi / 1e3,
    ("inHg", "Pa"): known.inch / 1e-3 * known.mmHg,
    ("hp", "kW"): known.hp / 1e3,
    ("m s^-1", "m/s"): 1.0,
    ("%", "1"): 0.01,
}


@pytest.mark.parametrize("pair", FACTORS, ids=" to ".join)
def test_factors_are_those_of_scipy(pair):
    assert scale("x", *pair).factor == pytest.approx(FACTORS[pair], rel=1e-6)
    assert scale("x", *reversed(pair)).factor == pytest.approx(1 / FACTORS[pair], rel=1e-6)


@pytest.mark.parametrize(("old", "value"), [("°C", 20.0), ("°F", 68.0), ("K", 293.15), ("degC", 20.0)])
def test_temperatures_have_zeros_of_their_own(old, value):
    to = scale("x", old, "C")
    assert to.factor * value + to.offset == pytest.approx(20.0)


def test_units_beyond_the_table_are_those_of_pint():
    pytest.importorskip("pint", reason="needs pint")
    flow = any_scale("x", "gal/min", "m^3/s")
    assert flow.factor == pytest.approx(known.gallon / known.minute, rel=1e-12)
    assert flow.offset == 0.0
    assert any_scale("x", "degR", "°C").offset == pytest.approx(-known.zero_Celsius)


def test_without_pint_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pint", None)
    _pint.cache_clear()
    with pytest.raises(mf.SpecError, match=r"unit 'gal/min' is not known; .*pip install 'modfun\[units\]'"):
        any_scale("x", "gal/min", "m^3/s")


@pytest.fixture
def rec():
    q, de = np.sin(np.arange(20.0)), np.cos(np.arange(20.0))
    good = np.arange(20) != 5
    units = {"q": "deg/s", "de": "deg", "v": "kt"}
    return mf.Record(
        y=q, u=de, dt=0.1, outputs="q", inputs="de", keep={"v": 100 + q, "on": q > 0}, units=units, mask=good
    )


def test_channels_of_all_roles_are_converted(rec):
    other = rec.convert(q="rad/s", de="rad", v="m/s")
    assert other.units == {"q": "rad/s", "de": "rad", "v": "m/s"}
    np.testing.assert_allclose(other.y, np.deg2rad(rec.y), rtol=1e-15)
    np.testing.assert_allclose(other.u, np.deg2rad(rec.u), rtol=1e-15)
    np.testing.assert_allclose(other["v"], rec["v"] * 1852 / 3600, rtol=1e-14)
    assert (other.mask == rec.mask).all()
    back = other.convert(q="deg/s", de="deg", v="kn")
    np.testing.assert_allclose(back["v"], rec["v"], rtol=1e-14)


@pytest.mark.parametrize(
    ("units", "words"),
    [
        ({"Q": "rad/s"}, "no channel 'Q'; did you mean 'q'"),
        ({"on": "1"}, r"unit of 'on' is not known; say it first, rec\.assign\(units="),
        ({"q": "rad"}, "deg/s and rad differ in kind"),
        ({"q": "furlong/s"}, "deg/s and furlong/s differ in kind"),
        ({"q": "blub/s"}, "unit 'blub/s' is not known; did you mean"),
        ({"q": "rad/("}, r"unit 'rad/\(' is not known"),
    ],
)
def test_what_cannot_be_converted_is_refused(rec, units, words):
    with pytest.raises(mf.SpecError, match=words):
        rec.convert(**units)


def test_units_may_be_a_dict(rec):
    assert rec.convert({"q": "rad/s"}, de="rad") == rec.convert(q="rad/s", de="rad")


def test_records_of_other_units_than_the_fit_are_refused():
    made = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1)
    degrees = mf.Record(y=made.y, u=made.u, dt=made.dt, inputs="de", units={"de": "deg"})
    radians = degrees.convert(de="rad")
    structure = mf.TransferFunction(poles=2, zeros=0)
    fit = mf.fit(degrees, structure)
    for use in (fit.predict, fit.score):
        with pytest.raises(
            mf.SpecError, match=r"has de in rad, the fit in deg; take rec.convert\(de='deg'\)"
        ):
            use(radians)
    with pytest.raises(mf.SpecError, match=r"record 1: the record has de in rad, record 0 in deg"):
        mf.fit([degrees, radians], structure)
    same = degrees.assign(units={"de": "°"})
    assert fit.score(same)["r2"][0] == fit.score()["r2"][0]
    assert fit.score(degrees.assign(units={"de": "counts"}))["r2"][0] == fit.score()["r2"][0]


def test_expressions_and_units_without_a_name_are_shown_with_one():
    made = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1)
    fit = mf.fit(made, mf.TransferFunction(poles=2, zeros=0))
    with pytest.raises(
        mf.SpecError, match=r"1 argument is given without a name.*derived\(name='sqrt\(a2\)'\)"
    ):
        fit.derived("sqrt(a2)")
