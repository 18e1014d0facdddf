"""After the flight: the example of docs/flight.md finds the aircraft of its sample."""

import sys
from pathlib import Path

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("sympy")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        import flight_test
    finally:
        sys.path.pop(0)
    return flight_test


@pytest.fixture(scope="module")
def found(example):
    return example.main([])


def test_the_derivatives_are_those_of_the_aircraft(example, found):
    """Five derivatives within three standard errors: false alarm about one in 70, the seed is fixed."""
    derivatives, unseen, _ = found
    truth = np.array(list(example.TRUTH.values()))
    assert derivatives.param_names == ("Za", "Ma", "Mq", "Zde", "Mde")
    names = derivatives.param_names
    off = np.array([derivatives[name] - example.TRUTH[name] for name in names]) / derivatives.bse
    assert np.all(np.abs(off) < 3), off
    assert np.all(derivatives.bse < 0.01 * np.abs(truth).max())
    assert not derivatives.check()
    # White noise of .08 deg and .15 deg/s on about 1.3 deg and 2.8 deg/s rms: simulation leaves the noise.
    level = np.std(derivatives.errors(unseen), axis=1)
    np.testing.assert_allclose(level, np.deg2rad([0.08, 0.15]), rtol=0.15)


def test_the_lower_order_system_has_its_delay(example, found):
    """K, T, omega, zeta, tau within three standard errors; `derived` knows the delay by its name."""
    table = found[2].derived(**example.FORM)
    truth = example.lower_order_truth()
    assert table["name"].tolist() == list(truth)
    off = (table["value"] - np.array(list(truth.values()))) / table["bse"]
    assert np.all(np.abs(off) < 3), off
    assert np.all(table["bse"] / table["value"] < 0.02)


def test_augmentation_is_found(example):
    told = mf.collinearity(example.augmented(), example.short_period)
    assert told.condition > 30
    assert told.findings[0].startswith("Ma, Mq and Mde can hardly be told apart")


def test_a_table_for_the_report(found):
    fit = found[0]
    table = fit.table(0.9, units={"Ma": "1/s^2"})
    assert table.columns == ("parameter", "value", "unit", "se HC3", "se classical", "t", "5 %", "95 %")
    assert table["unit"].tolist() == ["", "1/s^2", "", "", ""]
    np.testing.assert_array_equal(np.column_stack([table["5 %"], table["95 %"]]), fit.conf_int(0.9))
    assert table.to_dict()["value"] == fit.params.tolist()
    assert fit.table() == fit.summary().parameters
    with pytest.raises(mf.SpecError, match="'Mw', which is no parameter"):
        fit.table(units={"Mw": "1/s"})


def test_the_summary_shows_the_equations(found):
    assert "alpha' = Za*alpha + q + Zde*de; q' = Ma*alpha + Mq*q + Mde*de" in str(found[0].summary())


def test_units_follow_what_is_converted():
    rec = mf.Record(y=np.arange(9.0), u=np.ones(9), dt=0.1, outputs="q", inputs="de", units={"q": "deg/s"})
    turned = rec.assign(
        q=lambda r: np.deg2rad(r["q"]), extra=rec["q"], units={"q": "rad/s", "extra": "deg/s"}
    )
    assert turned.units == {"q": "rad/s", "extra": "deg/s"}
    assert rec.assign(units={"de": "deg"}).units == {"q": "deg/s", "de": "deg"}
    assert rec.assign(q=rec["q"]).units == {}
    with pytest.raises(mf.SpecError, match="'Q', which is no channel; did you mean 'q'"):
        rec.assign(units={"Q": "rad/s"})
