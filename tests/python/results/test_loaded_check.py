"""A fit that was saved and loaded is doubted as it was before."""

import warnings

import modfun as mf
import numpy as np
import pytest

pytestmark = pytest.mark.unit

PLANT, MODEL = (
    mf.tf([2], [100, 25, 1], delay=7.4),
    mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=20)),
)


def record(seed, noise, gaps=0, push=0.0):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 10)
    y = np.ravel(PLANT.simulate(u=u, dt=1.0, intersample="zoh"))
    y = y + noise * y.std() * rng.standard_normal(y.size)
    y[500:505] += push * y.std()
    mask = np.ones(y.size, bool)
    for k in rng.choice(900, gaps, replace=False) + 30:
        mask[k : k + 25] = False
    return mf.Record(y=y, u=u, dt=1.0, intersample="zoh", mask=mask)


def loaded(fit, tmp_path):
    fit.save(tmp_path / "fit.json")
    return mf.load(tmp_path / "fit.json")


def test_what_stands_in_gaps_is_no_event_of_a_loaded_fit(tmp_path):
    fit = mf.fit(record(9, 0.1, gaps=4), MODEL)
    again = loaded(loaded(fit, tmp_path), tmp_path)
    assert list(fit.check()) == list(again.check()) == []


def test_an_event_is_at_its_time(tmp_path):
    """A loaded fit had told it 20 s early, by the longest delay."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(record(0, 0.02, push=0.3), MODEL)
    assert "at about t = 496.27 s" in next(iter(fit.check()))
    assert list(loaded(fit, tmp_path).check()) == list(fit.check())


def test_modes_of_a_state_space_with_a_delay_on_its_bound_are_told(tmp_path):
    """Differences beside a delay of 0 s asked for a negative one, and a part of the check failed."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 20)
    y = mf.tf([-0.4], [1, 9]).simulate(u=u, dt=0.02, intersample="zoh")
    rec = mf.Record(
        y=y + 0.002 * rng.standard_normal(y.size), u=u, dt=0.02, outputs="p", inputs="da", intersample="zoh"
    )
    late = {"h": mf.Free(0.02, min=0, max=0.2)}
    model = mf.StateSpace([["Lp"]], [["Lda"]], states=["p"], inputs=["da"], delay="h", params=late)
    with pytest.warns(mf.ModfunWarning, match="h ended on a bound"):
        fit = mf.fit(rec, model)
    assert not any("failed" in text for text in fit.check())
    fit.save(tmp_path / "fit.json")
    assert mf.load(tmp_path / "fit.json").damp()["omega"] == pytest.approx(9.0, rel=0.03)
