"""What the records' own check says, where it bears on a fit: in the check of the fit, once."""

import warnings

import modfun as mf
import numpy as np
import pytest

PLANT = mf.tf([5], [1, 3, 8])
MODEL = mf.TransferFunction(poles=2, zeros=0)
REC = mf.simulate(PLANT, input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.02, seed=0)


def warned(rec, model=MODEL):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fit = mf.fit(rec, model)
    return fit, [str(one.message) for one in said]


def test_clipped_outputs_are_the_first_cause_where_residuals_show_them():
    rec = REC.assign(y=REC["y"].clip(-0.5, 0.45))
    fit, said = warned(rec)
    assert len(said) == 1
    assert "Output 'y' may be clipped" in said[0]
    assert said[0] == "fit: " + next(iter(fit.check()))
    assert str(fit.check()).count("may be clipped") == 1
    cured, said = warned(rec.weigh(mask=(rec["y"] != 0.45) & (rec["y"] != -0.5)))
    assert not said
    assert "clipped" not in str(cured.check())
    assert np.max(np.abs(cured.params - [3, 8, 5]) / cured.bse) < 3.5
    assert np.max(np.abs(fit.params - [3, 8, 5]) / cured.bse) > 20


def test_a_little_clipping_is_a_doubt_without_a_warning():
    y = REC["y"]
    fit, said = warned(REC.assign(y=y.clip(None, np.sort(y)[-9])))
    assert not said
    assert str(fit.check()).count("may be clipped: 9 samples") == 1


def test_doubtful_inputs_are_said_by_the_fit():
    rec = mf.Record(y=REC.y, u=REC.u, dt=REC.dt)
    fit, said = warned(rec)
    assert not said
    assert "Input 'u' is assumed smooth" in str(fit.check())
    assert "1 doubt in check()" in repr(fit)
    assert "Input" not in str(mf.fit(REC, MODEL).check())  # declared


def test_the_cure_of_the_residuals_replaces_the_remark_on_the_input():
    steps = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 65), 4)[:257]
    made = mf.simulate(PLANT, input=steps, intersample="zoh", duration=10.0, intervals=256, nsr=0.01, seed=1)
    fit, said = warned(mf.Record(y=made.y, u=made.u, dt=made.dt, intersample="smooth"))
    assert "intersample='zoh'" in said[0]
    assert str(fit.check()).count("intersample=") == 1


@pytest.mark.parametrize("records", [1, 3])
def test_missing_rows_are_said_once(records):
    there = np.ones(REC.t.size, bool)
    there[200:205] = False
    rec = mf.Record(y=REC.y[:, there], u=REC.u[:, there], t=REC.t[there], intersample="smooth")
    fit, said = warned([rec] + [REC.assign(y=REC["y"] * (1 + k)) for k in range(1, records)])
    assert not said or "share" not in said[0]
    assert str(fit.check()).count("5 rows of 513 are missing") == 1
