"""Clocks of files: units by any name, seconds since 1970, jitter and uneven rows, and cures that work."""

import modfun as mf
import numpy as np
import pytest

LAGGED = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=1))
ROLES = {"outputs": ["y"], "inputs": ["u"]}


def file(path, times, name="Timestamp"):
    """A lag of 1 s behind a delay of 0.3 s, moved by a chirp."""
    at, fine = (times - times[0]) / (1000 if times[1] - times[0] > 50 else 1), 0.01 * np.arange(4100)
    y = np.ravel(
        mf.tf([1], [1, 1], delay=0.3).simulate(u=np.sin(fine**2 / 20), dt=0.01, intersample="smooth")
    )
    y = np.interp(at, fine, y) + 0.01 * np.random.default_rng(3).standard_normal(at.size)
    rows = np.column_stack([times, np.sin(at**2 / 20), y])
    np.savetxt(path, rows, delimiter=",", header=f"{name},u,y", comments="", fmt=["%.3f", "%.6f", "%.6f"])
    return path


@pytest.mark.parametrize("word", ["t", "Timestamp", "timestamp"])
def test_the_unit_of_the_times_is_taken_by_any_name(tmp_path, word):
    """`t` was no channel, and the times stayed a thousand times too long."""
    path = file(tmp_path / "run.csv", 100.0 * np.arange(400))
    rec = mf.read(path, **ROLES, units={word: "ms"})
    assert (rec.t[0], rec.dt) == (0.0, 0.1)
    assert mf.read(path, **ROLES, units={word: "ms"}, dt=0.1).dt == 0.1


def test_a_unit_of_no_column_is_still_refused(tmp_path):
    path = file(tmp_path / "run.csv", 0.1 * np.arange(400))
    with pytest.raises(mf.SpecError, match="units names 'alpha', which is not a channel"):
        mf.read(path, **ROLES, units={"alpha": "deg"})


def test_seconds_since_1970_are_counted_from_the_first(tmp_path):
    """Doubles of 1.7e9 are 2e-7 apart, and so is 40 s from first to last."""
    rec = mf.read(file(tmp_path / "run.csv", 1.7e9 + 0.1 * np.arange(400)), **ROLES)
    assert rec.t[0] == 0
    assert rec.dt == pytest.approx(0.1, rel=1e-8)
    rec = mf.read(file(tmp_path / "run.csv", 1.7e12 + 100 * np.arange(400)), **ROLES, units={"t": "ms"})
    assert rec.t[0] == 0
    assert rec.dt == pytest.approx(0.1, rel=1e-9)
    jump = rec["y"] + 5.0 * (np.arange(400) == 100)
    with pytest.warns(mf.ModfunWarning, match="The sample of y at t = 10 s is far"):
        mf.fit(rec.assign(y=jump), mf.TransferFunction(poles=1, zeros=0))


def test_a_clock_that_jitters_is_read_with_the_step_that_messages_name(tmp_path):
    jitter = 0.002 * np.random.default_rng(1).standard_normal(400)
    path = file(tmp_path / "run.csv", 1.7e9 + 0.1 * np.arange(400) + jitter)
    rec = mf.read(path, **ROLES)
    with pytest.raises(mf.DataError, match=r"give dt=0.1\d* instead of the times") as refused:
        mf.fit(rec, LAGGED)
    step = float(str(refused.value).split("give dt=")[1].split(" ")[0])
    assert mf.fit(mf.read(path, **ROLES, dt=step), LAGGED)["delay"] == pytest.approx(0.3, abs=0.03)


def test_uneven_rows_are_resampled_as_the_message_says(tmp_path):
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(400, 300, replace=False))
    rec = mf.read(file(tmp_path / "run.csv", 1.7e9 + 0.1 * kept + rng.uniform(-0.04, 0.04, 300)), **ROLES)
    assert any("Fits take such times as they are, but no delays." in text for text in rec.check())
    with pytest.raises(mf.DataError, match="steps are uneven; resample it: t = ") as refused:
        mf.fit(rec, LAGGED)
    words = str(refused.value).split("resample it: t = ")[1].removesuffix("; or leave the delay out")
    first, second = words.split(", then ")
    even = eval(second, {"mf": mf, "np": np, "rec": rec, "t": eval(first, {"np": np, "rec": rec})})
    assert even.dt == pytest.approx(0.1335, rel=0.01)
    assert mf.fit(even, LAGGED)["delay"] == pytest.approx(0.3, abs=0.03)
