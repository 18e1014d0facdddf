"""What a stranger tried to break: ranges of numbers, sizes, rounding of delays, silent failures."""

import os
import subprocess
import sys
import warnings

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
STRUCTURE = mf.TransferFunction(poles=2, zeros=0)
RECORD = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)


@pytest.mark.parametrize(("y_unit", "u_unit"), [(1e150, 1.0), (1e-150, 1.0), (1e-100, 1e-100), (1e80, 1e80)])
def test_units_of_any_size_keep_estimates_and_errors(y_unit, u_unit):
    fit = mf.fit(RECORD, STRUCTURE)
    scaled = mf.fit(mf.Record(y=RECORD.y * y_unit, u=RECORD.u * u_unit, dt=RECORD.dt), STRUCTURE)
    by = np.array([1.0, 1.0, y_unit / u_unit])
    np.testing.assert_allclose(scaled.params / by, fit.params, rtol=1e-9)
    np.testing.assert_allclose(scaled.bse / by, fit.bse, rtol=1e-7)


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_a_large_offset_leaks_into_wide_bands():
    """The limit that docs/accuracy.md states, in classical standard errors."""
    rec = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05, seed=1)

    def moved(times, **options):
        plain, lifted = (
            mf.fit(one, STRUCTURE, cov_type="nonrobust", **options)
            for one in (rec, rec.assign(y=rec["y"] + times * rec["y"].std()))
        )
        return np.abs((lifted.params - plain.params) / plain.bse).max()

    assert moved(3) < 0.01
    assert 0.05 < moved(3000) < 0.2
    assert 0.5 < moved(3000, harmonics=20) < 1.5
    assert moved(3, harmonics=60) < 0.01
    assert moved(3000, harmonics=60) > 100


@pytest.mark.parametrize("delay", [3 * 0.1, 0.1 + 0.2, 1e-12])
def test_a_delay_a_hair_off_a_sample_is_that_sample(delay):
    system = mf.tf([5], [1, 3, 8], delay=round(delay, 6))
    rec = mf.simulate(system, input="sin(t**2/5)", duration=25.6, intervals=256, nsr=0.1, seed=0)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, delay=delay))
    near = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, delay=round(delay, 6)))
    np.testing.assert_allclose(fit.params, near.params, rtol=1e-6)
    assert "a1" in str(fit.summary())
    assert len(fit.score()) == 1


REFUSED = {
    "too many poles": (lambda: mf.TransferFunction(poles=10**9), mf.SpecError, "more than 100"),
    "more parameters than samples": (
        lambda: mf.fit(
            mf.Record(y=RECORD.y[0, :40], u=RECORD.u[0, :40], dt=0.1), mf.TransferFunction(poles=30)
        ),
        mf.DataError,
        "take fewer poles",
    ),
    "a step beyond reason": (
        lambda: mf.Record(y=RECORD.y, u=RECORD.u, dt=1e300),
        mf.SpecError,
        "another unit",
    ),
    "a rate beyond reason": (lambda: mf.Record(y=RECORD.y, fs=1e-320), mf.SpecError, "another unit"),
    "units of time beyond the numbers": (
        lambda: mf.fit(mf.Record(y=RECORD.y, u=RECORD.u, dt=1e-100), STRUCTURE),
        mf.DataError,
        "time in another unit",
    ),
    "masked samples": (
        lambda: mf.Record(y=np.ma.masked_array(RECORD.y[0], mask=np.arange(257) == 50), dt=0.1),
        mf.DataError,
        "1 masked samples",
    ),
    "harmonics beyond reason": (
        lambda: mf.fit(RECORD, STRUCTURE, harmonics=10**30),
        mf.SpecError,
        "whole number from",
    ),
    "no intersample": (
        lambda: mf.Record(y=RECORD.y, u=RECORD.u, dt=0.1, intersample=None),
        mf.SpecError,
        "smooth",
    ),
    "replicates beyond memory": (
        lambda: mf.MonteCarlo(
            system=SYSTEM,
            input="sin(t)",
            duration=10.0,
            intervals=100,
            nsr=0.1,
            estimators=["ls"],
            replicates=10**12,
        ),
        mf.SpecError,
        "replicates",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_before_the_work(case):
    call, kind, words = REFUSED[case]
    with pytest.raises(kind, match=words):
        call()


def test_a_function_that_always_fails_is_said():
    study = mf.MonteCarlo(
        system=SYSTEM,
        input="sin(t**2/5)",
        duration=10.0,
        intervals=64,
        nsr=0.1,
        estimators={"mine": lambda rec, rng: 1 / 0},
        replicates=5,
    )
    with pytest.warns(mf.ModfunWarning, match="mine failed in every replicate.*division"):
        study.run(threads=1, progress=False)


def test_a_directory_is_not_called_missing(tmp_path):
    with pytest.raises(mf.DataError, match="not a regular file"):
        mf.read(tmp_path, outputs=["y"])


@pytest.mark.process
def test_a_terminal_without_greek_letters_gets_question_marks(tmp_path):
    words = ["reproduce", "report", "--quick", "--out", str(tmp_path / "figures")]
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    done = subprocess.run(
        [sys.executable, "-m", "modfun", *words], env=ascii_only, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "?s" in done.stdout  # µs


def test_an_offset_beyond_reason_is_said():
    quiet = mf.fit(RECORD, STRUCTURE)
    offset = 5e3 * RECORD.y.std()
    with pytest.warns(mf.ModfunWarning, match=r"'y' stands at .*, 5e\+03 times less.*; subtract it first"):
        mf.fit(mf.Record(y=RECORD.y + offset, u=RECORD.u, dt=RECORD.dt), STRUCTURE)
    moderate = mf.fit(mf.Record(y=RECORD.y + offset / 10, u=RECORD.u, dt=RECORD.dt), STRUCTURE)  # no warning
    np.testing.assert_allclose(moderate.params, quiet.params, atol=0.1 * quiet.bse.min())
    cubic = mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        mf.fit(mf.Record(y=RECORD.y + offset, u=RECORD.u, dt=RECORD.dt), cubic)
    assert any("write the equation for deviations from it" in str(w.message) for w in told)
