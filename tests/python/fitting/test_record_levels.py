"""Several records as one problem, each with a noise level of its own."""

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
MODEL = mf.TransferFunction(poles=2, zeros=0)
TRUE = np.array([3.0, 8.0, 5.0])
DUFFING = "y'' + 0.3*y' + y + 0.5*y**3 = u"
FREE = mf.Equation("y'' + a*y' + b*y + c*y**3 = u")


def record(nsr, seed):
    chirp = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
    return mf.simulate(SYSTEM, **chirp, nsr=nsr, seed=seed)


def swinging(nsr, seed):
    sweep = {"input": "2*sin(t**2/20)", "duration": 40.0, "intervals": 400}
    return mf.simulate(mf.Equation(DUFFING).model({}), **sweep, nsr=nsr, seed=seed)


def pair(seed, sizes=(0.02, 0.4), **words):
    """Two outputs in two records, the noise of the second larger."""
    t = 0.05 * np.arange(301)
    u = np.array([np.sin(t**2 / 6), np.cos((15 - t) ** 2 / 5)])
    y = mf.tf([[[1.0, 2.0], [3.0]], [[0.5], [-1.0, 0.7]]], [1.0, 1.2, 4.0]).simulate(u=u, dt=0.05)
    rng = np.random.default_rng(seed)
    root = np.array([[0.5, 0.0], [0.3, 0.2]])
    return [
        mf.Record(y=y + size * root @ rng.standard_normal(y.shape), u=u, dt=0.05, **words) for size in sizes
    ]


def rms(errors):
    return np.sqrt(np.mean(np.square(errors), axis=0))


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
@pytest.mark.parametrize("words", [{}, {"harmonics": 20}, {"noise": "coloured"}, {"method": "awls"}])
def test_a_noisy_record_does_not_spoil_a_good_one(words):
    """Standard deviations over those of the good record alone: below 1.01 in 400 records."""
    both, alone = [], []
    for seed in range(60):
        records = [record(0.02, 2 * seed), record(0.4, 2 * seed + 1)]
        both.append(mf.fit(records, MODEL, **words).params - TRUE)
        alone.append(mf.fit(records[0], MODEL, **words).params - TRUE)
    assert np.all(rms(both) < 1.02 * rms(alone)), rms(both) / rms(alone)


def test_levels_are_those_of_the_records():
    records = [record(0.02, 1), record(0.4, 2)]
    fit = mf.fit(records, MODEL)
    told = [np.std(rec.y - SYSTEM.simulate(u=rec.u, dt=rec.dt)) for rec in records]
    assert fit.noise_levels.shape == (2, 1)
    assert fit.noise_levels[:, 0] == pytest.approx(told, rel=0.25)
    assert fit.sigma == pytest.approx(np.sqrt(np.prod(fit.noise_levels)), rel=0.02)
    assert f"record 0: {fit.noise_levels[0, 0]:.4g}; record 1: " in str(fit.summary())


def test_records_of_one_noise_lose_nothing():
    """Levels that are estimated beside levels that are known to be one: below 1.01 in 400 records."""
    own, one = [], []
    for seed in range(60):
        records = [record(0.1, 3 * seed + k) for k in range(3)]
        own.append(mf.fit(records, MODEL).params - TRUE)
        one.append(mf.fit(records, MODEL, noise=mf.Noise(y=0.04)).params - TRUE)
    assert np.all(rms(own) < 1.02 * rms(one)), rms(own) / rms(one)


@pytest.mark.parametrize("by", [1e-3, 10.0])
def test_the_unit_of_a_record_does_not_matter(by):
    """A linear system in other units of one record: the same estimate, but for what levels are shrunk by."""
    first, second = record(0.1, 3), record(0.1, 4)
    other = mf.Record(y=by * second.y, u=by * second.u, dt=second.dt)
    fit, scaled = mf.fit([first, second], MODEL, harmonics=20), mf.fit([first, other], MODEL, harmonics=20)
    assert np.all(np.abs(scaled.params - fit.params) < 0.2 * fit.bse)
    ratio = scaled.noise_levels[1] / scaled.noise_levels[0]
    assert ratio == pytest.approx(by, rel=0.3)


@pytest.mark.parametrize("masked", [False, True])
def test_several_outputs(masked):
    model = mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="common")
    truth = np.array([1.2, 4.0, 1.0, 2.0, 3.0, 0.5, -1.0, 0.7])
    mask = np.ones((2, 301), bool)
    mask[0, 100:110] = not masked
    both, alone = [], []
    for seed in range(30):
        records = pair(seed, mask=mask) if masked else pair(seed)
        fit = mf.fit(records, model, harmonics=25)
        both.append(fit.params - truth)
        alone.append(mf.fit(records[0], model, harmonics=25).params - truth)
    assert np.all(rms(both) < 1.03 * rms(alone)), rms(both) / rms(alone)
    assert fit.noise_levels == pytest.approx(np.outer([0.02, 0.4], [0.5, 0.36]), rel=0.25)


def test_equations():
    both, alone = [], []
    truth = np.array([0.3, 1.0, 0.5])
    for seed in range(30):
        records = [swinging(0.02, 2 * seed), swinging(0.2, 2 * seed + 1)]
        fit = mf.fit(records, FREE)
        both.append(fit.params - truth)
        alone.append(mf.fit(records[0], FREE).params - truth)
    assert np.all(rms(both) < 1.03 * rms(alone)), rms(both) / rms(alone)
    assert fit.noise_levels[1] / fit.noise_levels[0] == pytest.approx(10.0, rel=0.25)


def test_what_was_told_of_the_noise_wins():
    records = [record(0.02, 1), record(0.4, 2)]
    fit = mf.fit(records, MODEL, noise=mf.Noise(y=0.1))
    assert np.ptp(fit.noise_levels) == 0.0
    own = [
        mf.Record(y=r.y, u=r.u, dt=r.dt, sigma=np.ones(r.y.shape[1]), intersample="smooth") for r in records
    ]
    assert np.ptp(mf.fit(own, MODEL).noise_levels) == 0.0


def test_levels_are_kept_in_a_file(tmp_path):
    for fit in (
        mf.fit([record(0.02, 1), record(0.4, 2)], MODEL),
        mf.fit([swinging(0.02, 1), swinging(0.2, 2)], FREE),
    ):
        fit.save(tmp_path / "fit.json")
        assert np.array_equal(mf.load(tmp_path / "fit.json").noise_levels, fit.noise_levels)


def test_a_bootstrap_draws_each_record_with_its_own_noise():
    """Intervals of both records together are those of the good one, not of both alike."""
    fit = mf.fit([record(0.02, 1), record(0.4, 2)], MODEL, harmonics=20)
    for kind, errors in (("parametric", "nonrobust"), ("wild", "HC3")):
        drawn = mf.bootstrap(fit, kind=kind, replicates=200, seed=1)
        # 200 replicates know a standard deviation to 5 %.
        expected = np.sqrt(np.diag(fit.cov_params(errors)))
        assert drawn.params.std(axis=0) == pytest.approx(expected, rel=0.3), kind


def test_the_bound_counts_levels():
    fit = mf.fit([record(0.02, 1), record(0.4, 2)], MODEL)
    alone = mf.fit(record(0.02, 1), MODEL)
    level = fit.noise_levels[0, 0] / alone.sigma
    assert np.all(mf.crlb(fit).sd < 1.01 * level * mf.crlb(alone).sd)
