"""Intervals cover what they claim, whatever the colour of the noise."""

import modfun as mf
import numpy as np
import pytest
from core_fit import fit_many
from sample_records import THETA24, eq24, white
from scipy.signal import lfilter
from scipy.stats import t as student

COUNT = 4_000  # coverage has a standard error of .0035 at .95


def coverage(y, record, kind, harmonics):
    found = fit_many(y, record.u, record.dt, 2, [0], harmonics=harmonics)
    assert not np.any(found["status"])
    degrees = found["df_spectral" if kind == "spectral" else "df_resid"]
    limit = student.ppf(0.975, degrees) * found[f"bse_{kind}"]
    return np.mean(np.abs(found["theta"] - THETA24) <= limit, axis=0)


def coloured(record, nsr, count, seed):
    """Outputs with first-order noise, pole .95, of stationary sd `nsr` times the rms of the output."""
    rng = np.random.default_rng(seed)
    white_part = rng.normal(size=(count, record.y.size))
    white_part[:, 0] /= np.sqrt(1 - 0.95**2)  # stationary from the start
    noise = lfilter([1.0], [1.0, -0.95], white_part) * np.sqrt(1 - 0.95**2)
    return record.y + nsr * np.sqrt(np.mean(record.y**2)) * noise


@pytest.mark.statistics
@pytest.mark.parametrize("harmonics", [6, 9, 20, None])
def test_hc3_intervals_cover_under_white_and_coloured_noise(harmonics):
    """93 to 98 %, with two standard errors of 4,000 records above: narrow bands leave 12 degrees of freedom.

    Independent values of 6,000 records: .958 to .976 (white), .952 to .981 (coloured): false alarm near 5 %
    for the largest, the seeds are fixed.
    """
    record = eq24()
    for noisy in (white, coloured):
        found = coverage(noisy(record, 0.1, COUNT, 31), record, "hc3", harmonics)
        print(noisy.__name__, harmonics, found)
        assert np.all((found >= 0.93) & (found <= 0.985)), noisy.__name__


@pytest.mark.statistics
@pytest.mark.parametrize("harmonics", [6, 9, 20])
def test_classical_intervals_cover_under_white_noise_and_lie_under_coloured(harmonics):
    """Nominal 95 %, four standard errors of 4,000 records either side: false alarm under 1 in 1,000."""
    record = eq24()
    found = coverage(white(record, 0.1, COUNT, 32), record, "nonrobust", harmonics)
    print(harmonics, found)
    assert np.all((found >= 0.936) & (found <= 0.964))
    if harmonics == 20:  # why they are not the default
        assert np.min(coverage(coloured(record, 0.1, COUNT, 33), record, "nonrobust", harmonics)) < 0.9


@pytest.mark.statistics
@pytest.mark.parametrize("harmonics", [6, 20, 60])
@pytest.mark.parametrize("noisy", ["white", "coloured"])
def test_spectral_intervals_cover_whatever_the_colour(noisy, harmonics):
    """Between 93 and 97.5 %; of true 95 % each bound is 5.7 standard errors of 4,000 records away.

    On 8 lines AR(.95) noise leaves little to estimate a spectrum from: up to 97.5 %.
    """
    record = eq24()
    noise = {"white": white, "coloured": coloured}[noisy]
    found = coverage(noise(record, 0.1, COUNT, 35), record, "spectral", harmonics)
    print(noisy, harmonics, found)
    assert np.all((found >= 0.93) & (found <= 0.975))


def test_sigma_is_the_noise_on_y():
    record = eq24()
    found = fit_many(white(record, 0.2, COUNT, 34), record.u, record.dt, 2, [0], harmonics=20)
    sigma = np.sqrt(found["cost"] / found["df_resid"])
    assert np.mean(sigma**2) == pytest.approx(0.04 * np.mean(record.y**2), rel=0.02)  # standard error .4 %


def test_the_noise_spectrum_is_told():
    """AR(.95) noise: twice the white level or more at the lowest lines, half or less at line 40; white: 1."""
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    rng = np.random.default_rng(8)
    two = mf.TransferFunction(poles=2, zeros=0)
    for pole, low, high in ((0.95, 2.0, 0.5), (0.0, 1.0, 1.0)):
        noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(557))[300:]
        fit = mf.fit(rec.assign(y=rec["y"] + 0.05 * noise), two, harmonics=38)
        told = fit.noise_spectrum()
        assert told["omega"][0] == pytest.approx(2 * np.pi / 10.0)
        assert np.all((told["low"] < told["level"]) & (told["level"] < told["high"]))
        if pole:
            assert told["level"][0] > low
            assert told["level"][-1] < high
        else:
            assert np.mean((told["low"] < 1) & (told["high"] > 1)) > 0.7
    assert len(fit.plot_residuals()[0].lines) == 7
    with pytest.raises(mf.SpecError, match="between 0 and 1"):
        fit.noise_spectrum(level=2)


def test_the_constant_of_an_equation_has_an_interval():
    """Line 0, of which it hangs, leaves no residual; it had 0.1 degrees of freedom and an interval of 1e11.

    The interval covers in 95 % of records or a little less: below 86 of 100 once in 1,000 tests.
    """
    text, true = "y'' + a*y' + b*y = k*u + c", {"a": 1.4, "b": 4.0, "k": 5.0, "c": 0.5}
    plant = mf.Equation(text, params=true).model({})
    covered = 0
    for seed in range(100):
        rec = mf.simulate(plant, input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.1, seed=seed)
        found = mf.fit(rec, mf.Equation(text))
        assert found.df_spectral[-1] in (2, found.df_resid)  # the latter where white noise makes more
        low, high = found.conf_int()[-1]
        assert high - low < 10 * found.bse[-1]
        covered += low < true["c"] < high
    assert covered >= 86
