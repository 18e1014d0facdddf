"""Gaps between few samples under doses, where all is known: least squares needs no sums over them."""

import modfun as mf
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")

ORAL = mf.Equation(
    ["g' = -ka*g + u", "c' = ka*g/V - ke*c"],
    outputs=["c"],
    hidden=["g"],
    params={"V": mf.Free(15, min=1), "ka": mf.Free(1, min=0.01), "ke": mf.Free(0.2, min=0)},
)
TRUTH = {"V": 20.0, "ka": 1.2, "ke": 0.25}
DAY = (0, 0.25, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 24)
TWICE = (0, 0.25, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 12.25, 12.5, 13, 14, 16, 20, 24, 36)
ACCEPTED = {"initial_state": "zero", "noise": "log-normal"}


def taken(hours, seed, doses=(0,), **more):
    """Samples of tablets of 100 mg, each of which lasts until an instant that is masked."""
    ends = [dose + 0.01 for dose in doses]
    t = np.sort(np.r_[hours, ends])
    u = np.where(np.isin(t, doses), 100 / 0.01, 0.0)
    c = ORAL.model(TRUTH).simulate(u=u, t=t, intersample="zoh")
    c = c * np.exp(0.1 * np.random.default_rng(seed).standard_normal(t.size))
    words = {"intersample": "zoh", "mask": ~np.isin(t, ends)} | more
    return mf.Record(y=c, u=u, t=t, outputs=["c"], **words)


@pytest.mark.parametrize(("hours", "doses"), [(DAY, (0,)), ((*DAY[:-1], 36), (0,)), (TWICE, (0, 12))])
def test_a_night_without_samples_is_fitted_as_it_is(hours, doses):
    """Refused in 60 of 60; the cut that was named left out the sample that tells most of ke.

    χ² with 9 degrees of freedom, nearly: beyond 30 in one of 2,000.
    """
    off = []
    for seed in (3, 5):
        fit = mf.fit(taken(hours, seed, doses), ORAL, **ACCEPTED)
        assert fit.success
        assert fit.by_response
        assert fit.bse["ke"] < 0.012
        off.append([(fit[name] - value) / fit.bse[name] for name, value in TRUTH.items()])
    assert np.sum(np.square(off)) < 30


def test_the_check_of_a_record_says_which_fits_take_it():
    rec = taken(DAY, 0)
    assert "longest of 12 at t = 12 where 0.75 is usual. Fits of an mf.Equation take" in str(rec.check())
    smooth = taken(DAY, 0, intersample="smooth")
    assert "Fits refuse it" in str(smooth.check())


@pytest.mark.parametrize(
    ("rec", "model", "options", "said"),
    [
        (taken(DAY, 0), mf.TransferFunction(poles=2, zeros=0), {}, "as all inputs are known there, write"),
        (taken(DAY, 0), ORAL, {"robust": True}, 'in noise="output" or "log-normal"'),
        (taken(DAY, 0, intersample="smooth"), ORAL, {}, "if u stood still between samples, say so"),
    ],
)
def test_what_tells_nothing_of_a_gap_is_refused_with_a_cure(rec, model, options, said):
    with pytest.raises(
        mf.DataError, match=r"no samples between t = 12 and 24, 50 % of its length; "
    ) as found:
        mf.fit(rec, model, **options)
    assert said in str(found.value)


def test_sums_that_fail_beside_a_gap_are_no_end():
    """A step at first and then none of 121 samples: sums told of no parameters ("nonfinite")."""
    t = np.r_[np.arange(0, 6, 0.05), 12]
    model = mf.Equation("c' = u/V - ke*c", outputs=["c"], inputs=["u"])
    u = np.where(t < 2, 50.0, 0.0)
    clean = model.model({"V": 20.0, "ke": 0.3}).simulate(u=u, t=t, intersample="zoh")
    y = clean + 0.08 * np.random.default_rng(0).standard_normal(t.size)
    rec = mf.Record(y=y, u=u, t=t, outputs=["c"], intersample="zoh")
    for start in ("zero", "unknown"):
        fit = mf.fit(rec, model, initial_state=start)
        assert fit.by_response
        assert np.all(np.abs(fit.params - [20.0, 0.3]) < 4 * fit.bse)
