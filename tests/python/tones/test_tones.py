"""`mf.sinusoids`: right without noise, the minimiser of its criterion, honest errors, words for bad input."""

import json
import pickle

import modfun as mf
import numpy as np
import pytest
from oracle import tones as oracle
from places import measured

TWO = {"omega": [0.9, 1.3], "amplitude": [1.0, 0.6], "phase": [0.4, -2.0]}


def record(n=128, noise=0.0, seed=1, dt=1.0, offset=0.0, damping=None, **tones):
    tones = tones or TWO
    y = oracle.waves(**tones, n=n, damping=damping) + offset
    return mf.Record(y=y + noise * np.random.default_rng(seed).standard_normal(n), dt=dt)


def close_pair(records, n, frequencies, decibels, seed=7):
    """(samples, phases, variance) of equal tones with random phases in white noise."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(-np.pi, np.pi, (records, 2))
    omega, variance = 2 * np.pi * np.array(frequencies), 0.5 / 10 ** (decibels / 10)
    clean = np.array([oracle.waves(omega, [1, 1], p, n) for p in phases])
    return clean + np.sqrt(variance) * rng.standard_normal((records, n)), phases, variance, omega


# Right ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("trend", [None, "constant", "linear", "auto"])
def test_exact_without_noise(trend):
    found = mf.sinusoids(record(), 2, trend=trend)
    assert found.success
    assert found.status == "ok"
    for kind in ("omega", "amplitude", "phase"):
        assert getattr(found, kind) == pytest.approx(TWO[kind], rel=1e-9)
    assert np.all(found.damping == 0)
    assert found.sigma < 1e-12


def test_tones_on_lines_of_the_record_are_no_special_case():
    """There A is zero on a line, which the lines' form has to weigh and the samples' form does not see."""
    omega = 2 * np.pi * np.array([5, 9]) / 64
    found = mf.sinusoids(record(64, omega=omega, amplitude=[1, 2], phase=[0, 1]), 2)
    assert found.omega == pytest.approx(omega, rel=1e-12)
    assert found.amplitude == pytest.approx([1, 2], rel=1e-12)


def test_damped_tones_without_noise():
    tones = {"omega": [0.5, 1.1, 2.0], "amplitude": [1.0, 2.0, 0.5], "phase": [0.1, 2.0, -1.0]}
    damping = [0.01, 0.08, -0.005]
    found = mf.sinusoids(record(200, damping=damping, **tones), 3, damped=True)
    assert found.damping == pytest.approx(damping, rel=1e-7)
    for kind, value in tones.items():
        assert getattr(found, kind) == pytest.approx(value, rel=1e-7)


def test_units_and_offset_and_scale():
    for dt, size in ((0.01, 1.0), (5.0, 1e140), (1.0, 1e-140)):
        y = size * record(offset=3.0, noise=0.01).y
        found = mf.sinusoids(mf.Record(y=y, dt=dt), 2)
        plain = mf.sinusoids(record(offset=3.0, noise=0.01), 2)
        assert found.omega * dt == pytest.approx(plain.omega, rel=1e-10)
        assert found.amplitude / size == pytest.approx(plain.amplitude, rel=1e-9)
        assert found.bse[:2] * dt == pytest.approx(plain.bse[:2], rel=1e-6)
        assert found.sigma / size == pytest.approx(plain.sigma, rel=1e-9)


def test_complex_exponentials():
    k = np.arange(60)
    omega, amplitude, phase = [-2.1, 0.3, 0.42], [0.5, 1.0, 1.0], [1.0, -0.5, 2.0]
    y = sum(a * np.exp(1j * (w * k + p)) for w, a, p in zip(omega, amplitude, phase, strict=True))
    found = mf.sinusoids(y, 3, dt=1.0)
    assert found.omega == pytest.approx(omega, rel=1e-9)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-9)
    assert found.phase == pytest.approx(phase, rel=1e-8)
    assert found.predict() == pytest.approx(y, abs=1e-9)
    decaying = mf.sinusoids(y * np.exp(-0.02 * k) + (2 + 1j), 3, dt=1.0, damped=True, trend="constant")
    assert decaying.damping == pytest.approx([0.02] * 3, rel=1e-6)
    assert decaying.offset == pytest.approx([2, 1], rel=1e-6)


def test_the_minimum_that_scipy_finds_from_the_truth():
    for seed in range(8):
        rec = record(96, noise=0.3, seed=seed, offset=1.0)
        found = mf.sinusoids(rec, 2)
        truth = np.concatenate([TWO["omega"], TWO["amplitude"], TWO["phase"]])
        expected, cost = oracle.refined(rec.y[0], truth)
        assert found.cost == pytest.approx(cost, rel=1e-9)
        assert found.params == pytest.approx(expected, rel=2e-6)


def test_damped_minimum_and_covariance_are_those_of_scipy_and_the_bound():
    damping = [0.02, 0.05]
    rec = record(150, noise=0.05, damping=damping, **TWO)
    found = mf.sinusoids(rec, 2, damped=True)
    truth = np.concatenate([TWO["omega"], damping, TWO["amplitude"], TWO["phase"]])
    expected, cost = oracle.refined(rec.y[0], truth, damped=True)
    assert found.cost == pytest.approx(cost, rel=1e-9)
    assert found.params == pytest.approx(expected, rel=1e-5)
    w, d, a, p = found.params.reshape(4, 2)
    bound = oracle.bound(w, a, p, found.sigma**2, 150, damping=d, offset=True)
    assert found.cov == pytest.approx(bound, rel=1e-5, abs=1e-6 * bound.max())
    assert found.bse == pytest.approx(np.sqrt(np.diag(bound)), rel=1e-6)


def test_masked_samples_count_for_nothing_and_sigma_weighs():
    rec = record(128, noise=0.2)
    good = np.ones(128, bool)
    good[[3, 50, *range(80, 95)]] = False
    spoilt = np.where(good, rec.y, np.nan)
    found = mf.sinusoids(mf.Record(y=spoilt, dt=1.0, mask=good), 2)
    truth = np.concatenate([TWO["omega"], TWO["amplitude"], TWO["phase"]])
    expected, cost = oracle.refined(rec.y[0], truth, weights=good.astype(float))
    assert found.cost == pytest.approx(cost, rel=1e-9)
    assert found.params == pytest.approx(expected, rel=2e-6)
    assert np.isnan(found.errors()).sum() == 17
    assert found.df_resid == 111 - 7
    sigma = np.where(np.arange(128) < 64, 1.0, 5.0)
    weighed = mf.sinusoids(mf.Record(y=rec.y, dt=1.0, sigma=sigma), 2)
    expected, _ = oracle.refined(rec.y[0], truth, weights=1 / sigma)
    assert weighed.params == pytest.approx(expected, rel=2e-6)


def test_no_pair_on_a_fine_grid_is_better():
    """The search against all pairs, where tones are 1.3 bins apart and noise is as strong."""
    y, *_ = close_pair(12, 64, (0.2, 0.22), 0)
    found = mf.sinusoids(mf.Batch(y=y, dt=1.0), 2, progress=False)
    for row, cost in zip(y, found.cost, strict=True):
        assert cost <= oracle.best_pair(row, 128)[1] * (1 + 1e-6)


# The report's form ----------------------------------------------------------------------------------------


def test_the_q_difference_is_the_transient_among_the_unknowns():
    """Weighted lines with T fitted; rows differenced by the product of (S - W^p) with their covariance."""
    y = record(40, noise=0.3).y[0]
    m = np.arange(-12, 13)
    for x in ([1.2, 0.5], [1.9, -0.4]):
        z = np.exp(2j * np.pi * m / 40)
        weight = 1 / oracle.symmetric(x, z) ** 2
        one, other = oracle.by_transient(y, m, 2, weight), oracle.by_difference(y, m, 2, weight)
        assert one == pytest.approx(other, rel=1e-8)


def test_the_transient_is_exact_for_samples():
    """A(z)Y of a sum of sinusoids is a polynomial in z on the lines, however coarse the samples are."""
    y = record(24, omega=[1.9, 2.8], amplitude=[1, 2], phase=[0.3, 1]).y[0]
    m = np.arange(-12, 12)
    Y, z = oracle.lines(y, m)
    rows = oracle.symmetric(2 * np.cos([1.9, 2.8]), z) * Y
    powers = z[:, None] ** oracle.transient_powers(2)
    t = np.linalg.lstsq(powers, rows, rcond=None)[0]
    assert np.abs(rows - powers @ t).max() < 1e-11
    assert np.abs(t.imag).max() < 1e-11


def test_the_cost_of_the_samples_is_that_of_all_lines():
    """Parseval: min over T of the sum of |AY - T|²/|A|² over all lines, at the tones that were found."""
    y = record(50, noise=0.4).y[0]
    found = mf.sinusoids(mf.Record(y=y, dt=1.0), 2, trend=None)
    m = np.arange(50)
    Y, z = oracle.lines(y, m)
    whitened = (z[:, None] ** oracle.transient_powers(2)) / oracle.symmetric(2 * np.cos(found.omega), z)[
        :, None
    ]
    left = Y - whitened @ np.linalg.lstsq(whitened, Y, rcond=None)[0]
    assert np.sum(np.abs(left) ** 2) / 50 == pytest.approx(found.cost, rel=1e-9)


@pytest.mark.parametrize("damping", [None, [0.02, 0.05]])
def test_awls_is_exact_without_noise(damping):
    rec = record(120, damping=damping)
    found = mf.sinusoids(rec, 2, method="awls", trend=None, damped=damping is not None)
    assert found.success
    assert found.omega == pytest.approx(TWO["omega"], rel=1e-9)
    assert found.amplitude == pytest.approx(TWO["amplitude"], rel=1e-8)
    if damping:
        assert found.damping == pytest.approx(damping, rel=1e-7)


def test_awls_is_the_slow_reweighting_of_the_oracle():
    for seed in range(5):
        rec = record(100, noise=0.3, seed=seed)
        start = mf.sinusoids(rec, 2, trend=None).omega
        found = mf.sinusoids(rec, 2, method="awls", lines=5, trend=None)
        expected = oracle.awls(rec.y[0], start, oracle.around(start, 5, 100))
        assert found.omega == pytest.approx(expected, rel=1e-7)


def test_ml_on_lines_is_the_least_squares_of_these_lines():
    for seed in range(4):
        rec = record(100, noise=0.3, seed=seed)
        start = mf.sinusoids(rec, 2, trend=None)
        found = mf.sinusoids(rec, 2, lines=4, trend=None)
        expected, cov = oracle.refined_on(rec.y[0], start.params, oracle.around(start.omega, 4, 100))
        assert found.params == pytest.approx(expected, rel=1e-6)
        assert found.bse == pytest.approx(np.sqrt(np.diag(cov)), rel=0.5), "one noise level, not that near by"
        assert found.df_resid == 2 * oracle.around(start.omega, 4, 100).size - 6


def test_lines_of_complex_records():
    k = np.arange(64)
    noise = np.random.default_rng(2).standard_normal((2, 64)) / 20
    y = np.exp(0.3j * k) + np.exp(-3.1j * k + 1j) + noise[0] + 1j * noise[1]
    found = mf.sinusoids(y, 2, dt=1.0, lines=6)
    assert np.all(np.abs(found.omega - [-3.1, 0.3]) < 5 * found.bse[:2])
    assert np.all(found.bse[:2] < 1.3 * mf.sinusoids(y, 2, dt=1.0).bse[:2])


@pytest.mark.statistics
def test_intervals_of_lines_cover_in_coloured_noise():
    """AR(1) noise, 18 dB apart at the two tones; 400 records: coverage has an sd of .011, 4 of them."""
    rng = np.random.default_rng(4)
    e = 0.3 * rng.standard_normal((400, 356))
    for j in range(1, 356):
        e[:, j] += 0.8 * e[:, j - 1]
    batch = mf.Batch(y=oracle.waves([0.3, 2.5], [1, 1], [0, 1], 256) + e[:, 100:], dt=1.0)

    def covered(found):
        return np.mean(np.abs(found.omega - [0.3, 2.5]) < 1.96 * found.bse[:, :2], axis=0)

    white = covered(mf.sinusoids(batch, 2, progress=False))
    assert white[0] < 0.8, "noise is not white over all samples"
    assert np.all(np.abs(covered(mf.sinusoids(batch, 2, lines=9, progress=False)) - 0.95) < 0.045)


# Honest ---------------------------------------------------------------------------------------------------


@pytest.mark.statistics
def test_errors_reach_the_bound_and_intervals_cover():
    """600 records: rms errors over the bound have a standard deviation of .03, coverage one of .009."""
    y, phases, variance, omega = close_pair(600, 256, (0.10, 0.12), 10)
    many = mf.sinusoids(mf.Batch(y=y, dt=1.0), 2, progress=False)
    assert many.success.all()
    bounds = [np.diag(oracle.bound(omega, [1, 1], p, variance, 256, offset=True)) for p in phases]
    truth = np.column_stack([np.tile(omega, (600, 1)), np.ones((600, 2)), phases])
    errors = many.params - truth
    errors[:, 4:] = np.angle(np.exp(1j * errors[:, 4:]))
    ratio = np.sqrt(np.mean(errors**2, axis=0) / np.mean(bounds, axis=0))
    assert np.all(np.abs(ratio - 1) < 4 * 0.03)
    assert np.abs(np.mean(np.abs(errors) < 1.96 * many.bse, axis=0) - 0.95).max() < 4 * 0.009


@pytest.mark.statistics
def test_the_number_of_tones_is_found():
    """Three tones at 10 dB in 200 records, and none in 200: wrong in less than 1 % of each."""
    y, *_ = close_pair(200, 128, (0.10, 0.12), 10)
    y += np.cos(1.9 * np.arange(128))
    many = mf.sinusoids(mf.Batch(y=y, dt=1.0), progress=False)
    assert np.mean(many.count == 3) > 0.96
    noise = np.random.default_rng(3).standard_normal((200, 128))
    assert np.mean(mf.sinusoids(mf.Batch(y=noise, dt=1.0), progress=False).count == 0) > 0.96


def test_as_an_estimator_of_a_study():
    def generate(cell, rng):
        t = np.arange(64)
        noise = cell["noise"] * rng.standard_normal(64)
        return mf.Record(y=np.cos(0.8 * t + rng.uniform(0, 6)) + noise, dt=1.0)

    study = mf.MonteCarlo(
        generate=generate,
        truth={"omega1": 0.8, "amplitude1": 1.0},
        grid={"noise": [0.1]},
        estimators={"ml": lambda rec, rng: mf.sinusoids(rec, 1).estimates()},
        replicates=40,
        seed=1,
    )
    table = study.run(progress=False).table()
    assert np.all(np.abs(table["bias"]) < 0.02)


# The same numbers -----------------------------------------------------------------------------------------


def test_a_batch_and_any_number_of_threads_give_the_same_bits():
    y, *_ = close_pair(20, 64, (0.2, 0.22), 5)
    one = mf.sinusoids(mf.Batch(y=y, dt=0.5), 2, threads=1, progress=False)
    three = mf.sinusoids(mf.Batch(y=y, dt=0.5), 2, threads=3, progress=False)
    assert np.array_equal(one.params, three.params)
    assert np.array_equal(one.bse, three.bse)
    for k in (0, 11):
        single = mf.sinusoids(mf.Record(y=y[k], dt=0.5), 2)
        assert np.array_equal(single.params, one.params[k])
        assert np.array_equal(single.bse, one.bse[k])


def test_a_spoilt_record_of_a_batch_leaves_the_others_alone():
    y, *_ = close_pair(4, 64, (0.2, 0.25), 10)
    alone = mf.sinusoids(mf.Batch(y=y, dt=1.0), 2, progress=False)
    y[1, 5] = np.nan
    y[2] = 7.0
    found = mf.sinusoids(mf.Batch(y=y, dt=1.0), 2, progress=False)
    assert found.status.tolist() == ["ok", "nonfinite", "rank", "ok"]
    assert np.isnan(found.params[1:3]).all()
    assert np.array_equal(found.params[[0, 3]], alone.params[[0, 3]])
    assert "2 of 4" in repr(found)
    assert "<table" in found._repr_html_()


# What is shown --------------------------------------------------------------------------------------------


def test_names_summary_and_plot():
    found = mf.sinusoids(record(noise=0.1, dt=0.1), 2, damped=True)
    assert found.param_names[:4] == ("omega1", "omega2", "damping1", "damping2")
    assert found["amplitude2"] == found.amplitude[1] == found.estimates()["amplitude2"]
    table = found.summary()
    assert list(table["tone"]) == [1, 2]
    assert table["omega_bse"][0] == found.bse[0]
    assert "noise sd" in repr(found)
    assert "<table" in found._repr_html_()
    assert found.conf_int().shape == (8, 2)
    assert len(found) == 2
    assert pickle.loads(pickle.dumps(found)).params == pytest.approx(found.params)
    pytest.importorskip("matplotlib").use("Agg")
    axes = found.plot(hz=True)
    assert axes.get_xlabel() == "frequency (Hz)"
    assert axes is mf.plot.sinusoids(found, ax=axes)


def test_prediction_leaves_the_noise():
    rec = record(noise=0.1, offset=2.0)
    found = mf.sinusoids(rec, 2, trend="linear")
    assert np.sum(found.errors() ** 2) == pytest.approx(found.cost, rel=1e-9)
    assert found.sigma == pytest.approx(0.1, rel=0.2)


def test_a_band_keeps_others_out():
    rec = record(omega=[0.5, 2.0], amplitude=[0.3, 1.0], phase=[0, 0], noise=0.02)
    assert mf.sinusoids(rec, 1).omega == pytest.approx([2.0], abs=0.01)
    assert mf.sinusoids(rec, 1, band=1.0).omega == pytest.approx([0.5], abs=0.02)


# Bad input ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: mf.sinusoids(mf.Record(y=np.ones(50), dt=1.0), 1), "no tone in it"),
        (lambda: mf.sinusoids(record(16), 6), "fewer tones"),
        (lambda: mf.sinusoids(mf.Record(y=np.eye(2, 50), dt=1.0), 1), "one at a time"),
        (lambda: mf.sinusoids(mf.Record(y=np.sin(np.arange(9)), t=np.arange(9) ** 2), 1), "uneven"),
        (lambda: mf.sinusoids(np.ones((3, 50)), 1, dt=1.0), "many records are a Batch"),
        (lambda: mf.sinusoids([0.0, 1.0, np.nan] * 5, 1, dt=1.0), "sample 2 is nan"),
        (lambda: mf.sinusoids([1.0, 2.0], 1, dt=1.0), "too few"),
        (lambda: mf.sinusoids(["a", "b"], 1, dt=1.0), "array of numbers"),
    ],
)
def test_data_that_cannot_be_used_is_refused_in_words(make, words):
    with pytest.raises(mf.DataError, match=words):
        make()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"count": 0}, "count=0"),
        ({"count": True}, "count=True"),
        ({"count": 1.5}, "count=1.5"),
        ({"most": 0}, "most=0"),
        ({"trend": "quadratic"}, "trend='quadratic'"),
        ({"band": (2.0, 1.0)}, "rad/s"),
        ({"band": 4.0}, "half the sampling rate"),
        ({"dt": 1.0}, "for arrays"),
        ({"threads": 0}, "threads=0"),
        ({"method": "ls"}, "method='ls'"),
        ({"lines": 1}, "lines=1"),
        ({"lines": 2.5}, "lines=2.5"),
    ],
)
def test_options_that_do_not_exist_are_refused_in_words(options, words):
    with pytest.raises(mf.SpecError, match=words):
        mf.sinusoids(record(), **options)


def test_what_lines_cannot_do_is_said():
    gaps = mf.Record(y=record().y, dt=1.0, mask=np.arange(128) % 9 > 0)
    with pytest.raises(mf.DataError, match="masked"):
        mf.sinusoids(gaps, 2, lines=4)
    with pytest.raises(mf.SpecError, match="real records"):
        mf.sinusoids(np.exp(1j * np.arange(40)), 1, dt=1.0, method="awls")
    few = mf.sinusoids(record(24, noise=0.1), 3, lines=2)
    assert few.status in ("ok", "rank", "maxiter")


def test_an_array_needs_its_step():
    with pytest.raises(mf.SpecError, match="sampling interval"):
        mf.sinusoids(np.sin(np.arange(20)), 1)


@pytest.mark.parametrize("omega", [0.0, np.pi])
def test_a_tone_at_the_ends_of_the_spectrum_is_no_silent_nonsense(omega):
    """Its amplitude and phase are one unknown: not ok, in words, or an error bar that says so."""
    y = np.cos(omega * np.arange(64)) + 0.1 * np.random.default_rng(1).standard_normal(64)
    found = mf.sinusoids(mf.Record(y=y, dt=1.0), 1, trend=None)
    assert not found.success
    assert "half the sampling rate" in found.message
    if omega == 0.0:  # an offset, by default, and no tone
        assert len(mf.sinusoids(mf.Record(y=y, dt=1.0))) == 0


# Data -----------------------------------------------------------------------------------------------------


def test_the_stored_bound_of_two_close_tones():
    """10 sin(.24 pi t + p1) + 5 sin(.26 pi t + p2): stored are rms bounds over some 50 phases at random."""
    path = measured("sinusoids/definition.json")
    stored = json.loads(path.read_text())
    omega = np.array(stored["true_w"])
    assert omega == pytest.approx(np.pi * np.array([0.24, 0.26]))
    phases = np.random.default_rng(1).uniform(-np.pi, np.pi, (1000, 2))
    drawn = np.array([np.diag(oracle.bound(omega, [10, 5], p, 1.0, 64))[:2] for p in phases])
    spread = drawn.std(axis=0) / drawn.mean(axis=0) / np.sqrt(50)
    for name, values in stored["sqrt_CRB_rad_computed_here"].items():
        ratio = np.square(values) / (float(name.partition("=")[2]) * drawn.mean(axis=0))
        assert np.all(np.abs(ratio - 1) < 4 * spread), "6 in 100,000 draws"
        assert np.all(4 * spread < 0.6)


def test_a_tone_without_noise_is_one_tone():
    t = 0.01 * np.arange(256)
    for y in (np.cos(60 * t), 1e100 * np.cos(60 * t), 3 + np.cos(60 * t) + 0.2 * np.sin(110 * t)):
        found = mf.sinusoids(y, dt=0.01)
        assert len(found) == (2 if y[0] == 4 else 1)
        assert found.status == "ok"
