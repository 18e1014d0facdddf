"""Samples at uneven times brought to an even grid: late readings, and rows written when a value changed."""

import re

import modfun as mf
import numpy as np
import pytest
from modfun import DataError, SpecError

LAG, GAIN, LATE = 60.0, 0.8, 25.0
TRUE = {"a1": 1 / LAG, "b0": GAIN / LAG, "delay": LATE}
MODEL = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=60))


def moves(rng, length, apart):
    """Times and levels of a command that is moved on a grid of 10 s."""
    times = np.cumsum(np.r_[0, 10 * rng.integers(apart // 20, apart * 3 // 20, length // apart)])
    return times, rng.permutation(np.resize([-5.0, 0.0, 5.0, 2.0, -3.0], times.size))


def response(t, times, levels):
    """Exact output of the lag at times t."""
    steps = np.diff(levels, prepend=levels[0])
    after = t[:, None] - LATE - times
    return GAIN * (levels[0] + np.where(after > 0, 1 - np.exp(-np.maximum(after, 0) / LAG), 0) @ steps)


def held(t, times, levels):
    return levels[np.searchsorted(times, t, side="right") - 1]


def read_late(seed, length=3000):
    """Readings due every 10 s, each of them up to 2 s late; the command moves as it is read."""
    rng = np.random.default_rng(seed)
    times, levels = moves(rng, length, 200)
    due = np.arange(0, length, 10.0)
    t = due + rng.uniform(0, 2, due.size)
    at = t[np.searchsorted(due, times[times < length])]
    y = response(t, at, levels[: at.size]) + 0.1 * rng.standard_normal(t.size)
    return mf.Record(y=y, u=held(t, at, levels), t=t, intersample="zoh")


def by_exception(seed, length=6000, apart=400, band=0.2, noise=0.01):
    """Rows of a scan of 1 s at which the output has changed by the band since the last, or the command."""
    rng = np.random.default_rng(seed)
    times, levels = moves(rng, length, apart)
    t = np.arange(float(length))
    y, u = response(t, times, levels) + noise * rng.standard_normal(t.size), held(t, times, levels)
    rows = [0]
    for k in range(1, t.size):
        if abs(y[k] - y[rows[-1]]) > band or u[k] != u[k - 1]:
            rows.append(k)
    return mf.Record(y=y[rows], u=u[rows], t=t[rows], intersample="zoh")


def errors(fit):
    both = zip(fit.param_names, fit.params, fit.bse, strict=True)
    return np.array([(value - TRUE[name]) / se for name, value, se in both])


def advised(rec):
    """The record that the refusal of a fit says to take."""
    with pytest.raises(DataError, match=r"rec\.resample") as refused:
        mf.fit(rec, MODEL)
    step = re.search(r"rec\.resample\(([0-9.e-]+)\)", str(refused.value))
    return rec.resample(float(step[1]))


def test_readings_that_are_late_keep_their_delay():
    """12 numbers within 4 standard errors and their mean within 3/sqrt(4): by chance 1 of 300 fails."""
    found = np.array([errors(mf.fit(advised(read_late(seed)), MODEL)) for seed in range(4)])
    assert np.abs(found).max() < 4
    assert np.abs(found.mean(axis=0)).max() < 1.75


def test_rows_written_at_changes_end_in_a_fit_at_the_first_advice():
    rec = by_exception(1)
    assert rec.dt is None
    (said,) = [text for text in rec.check() if "only when a value changed" in text]
    assert "'y' by 0.2 or more: no row means no change" in said
    assert "rec.resample(2)" in said  # a tenth of the mean step, in steps of the scan
    assert not any("split" in text for text in rec.check())
    with pytest.warns(mf.ModfunWarning, match="do not count that dead band") as warned:
        even = advised(rec)
    assert warned[0].filename == __file__
    fit = mf.fit(even, MODEL)
    assert fit["delay"] == pytest.approx(LATE, abs=2.0)
    assert 1 / fit["a1"] == pytest.approx(LAG, rel=0.05)


def uneven(kind, rng):
    t = np.cumsum(rng.exponential(4.0, 300))
    u = np.sign(np.sin(t / 70))
    y = response(t, *moves(rng, 1200, 200))
    if kind == "ramp":
        return t, t / 50, u
    if kind == "rounded":
        return t, np.round(y / 0.2) * 0.2, u
    if kind == "input moves":
        return t, np.cumsum(0.2 + 0.01 * rng.uniform(size=t.size)), np.sin(t / 9)
    return t, y + 0.1 * rng.standard_normal(t.size), u


@pytest.mark.parametrize("kind", ["noisy", "ramp", "rounded", "input moves"])
@pytest.mark.parametrize("seed", range(5))
def test_other_uneven_records_are_not_taken_for_these(kind, seed):
    t, y, u = uneven(kind, np.random.default_rng(seed))
    assert "only when a value changed" not in str(mf.Record(y=y, u=u, t=t, intersample="zoh").check())


def test_inputs_go_on_as_declared_and_outputs_count_where_they_were_measured():
    t = np.array([0.0, 1.1, 2.0, 2.9, 4.1, 5.0, 6.2, 6.96, 7.04, 8.1])
    u = {"held": t > 2.5, "straight": t, "smooth": np.sin(t), "known": "sin(9*t)"}
    words = {"held": "zoh", "straight": "foh", "smooth": "smooth"}
    rec = mf.Record(y=t**2, u=u, t=3 + t, intersample=words, keep={"mark": t > 4}, units={"y": "K"})
    even = rec.resample(0.1)
    assert (even.dt, even.t[0], even.intersample, even.units) == (0.1, 3.0, rec.intersample, rec.units)
    assert np.array_equal(even["held"], even.t > 5.85)
    assert even["straight"][:63] == pytest.approx(even.t[:63] - 3)
    assert even["smooth"][:70] == pytest.approx(np.sin(even.t[:70] - 3), abs=0.05)
    assert even["known"] == pytest.approx(np.sin(9 * even.t))
    assert even.mask.sum() == 9  # two samples at 7 s, of which the later one is kept
    assert even["y"][70] == pytest.approx(7.04**2)
    assert np.argmax(even["mark"]) == 41


@pytest.mark.parametrize(("step", "kind", "words"), [(0, SpecError, "above 0"), (9, DataError, "leave 3 of")])
def test_steps_that_make_no_record_are_refused(step, kind, words):
    t = np.array([0.0, 1.1, 2.0, 2.9, 4.1, 5.0, 6.2, 7.0, 8.1, 19.0])
    with pytest.raises(kind, match=words):
        mf.Record(y=t, t=t).resample(step)


def test_even_samples_are_left_as_they_are():
    with pytest.raises(SpecError, match=r"even already, dt=0\.1 s"):
        mf.Record(y=np.arange(9.0), dt=0.1).resample(0.05)
