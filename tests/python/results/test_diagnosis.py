"""Tests of a fit say of right models what their p-values promise: with white noise, levels not known."""

from types import SimpleNamespace

import modfun as mf
import numpy as np
import pytest
from modfun._core import noise_level
from modfun.results import diagnosis
from modfun.results.diagnosis import diagnose, high_band_df, level_p
from modfun.results.line_tests import correlation_of_lines
from scipy.special import chdtrc, fdtrc

# One record in sixty is warned of its standard errors.
pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
TWO = mf.TransferFunction(poles=2, zeros=0)


def records(count, seed, outputs=1, mixed=None):
    """The report's example (24) in white noise of 10 %: 256 intervals; a second output is the derivative."""
    plant = mf.ss([[0, 1], [-8, -3]], [[0], [5]], np.eye(2)[:outputs], np.zeros((outputs, 1)))
    clean = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0, seed=0)
    size = 0.1 * np.sqrt(np.mean(clean.y**2, axis=1))[:, None]
    rng = np.random.default_rng(seed)
    for _ in range(count):
        e = rng.standard_normal(clean.y.shape)
        yield mf.Record(y=clean.y + size * (e if mixed is None else mixed @ e), u=clean.u, dt=clean.dt)


def test_the_level_of_a_right_model_is_rejected_at_the_stated_rate():
    """1,000 fits, four standard errors; with the level taken for certain 9.4 % and 4 % are rejected."""
    p = np.array([level_p(mf.fit(rec, TWO, harmonics=12)) for rec in records(1000, 0)])
    assert 0.022 < np.mean(p < 0.05) < 0.078
    assert np.mean(p < 0.01) < 0.023
    assert 0.022 < np.mean(p > 0.95) < 0.078


def test_two_outputs_whose_noise_is_one_are_one_output():
    """600 fits, four standard errors; counted as two 11.8 % and 3.5 % are rejected."""
    mixed = np.linalg.cholesky([[1.0, 0.9], [0.9, 1.0]])
    model = mf.TransferFunction(poles=2, zeros=1, denominator="common")
    p = np.array([level_p(mf.fit(rec, model, harmonics=12)) for rec in records(600, 1, 2, mixed)])
    assert 0.014 < np.mean(p < 0.05) < 0.086
    assert np.mean(p < 0.01) < 0.027


def test_a_few_lines_may_have_any_level():
    """With M = 6 a ratio beyond 1.5 either way is found in 58 of 500 right models, 6 are beyond chance."""
    said = sum("unused high band" in mf.fit(rec, TWO, harmonics=6).check() for rec in records(500, 2))
    assert said <= 22


def test_a_model_too_simple_is_rejected_still():
    fit = mf.fit(next(records(1, 0)), mf.TransferFunction(poles=1, zeros=0), harmonics=12)
    assert level_p(fit) < 1e-6
    assert "times the noise level of the unused high band" in fit.check()


def test_a_level_that_was_given_does_not_scatter():
    rec = next(records(1, 3))
    known = mf.fit(rec, TWO, harmonics=12, noise=mf.Noise(y=0.04))
    assert level_p(known) == pytest.approx(chdtrc(known.df_resid, known.chi2))
    seen = mf.fit(rec, TWO, harmonics=12)
    free, ratio = high_band_df(seen), seen.chi2 / seen.df_resid
    assert diagnose(seen).chi2_p == pytest.approx(fdtrc(seen.df_resid, free, ratio))
    assert level_p(seen.without_samples()) == level_p(seen)


def planned(order, *intervals):
    return SimpleNamespace(layout=SimpleNamespace(orders=(order,)), intervals=intervals)


@pytest.mark.parametrize(
    ("order", "intervals", "runs", "within"),
    [(1, 40, 4000, 0.1), (2, 256, 4000, 0.1), (5, 1000, 4000, 0.1), (2, 131_072, 60, 0.6)],
)
def test_the_levels_degrees_of_freedom_are_those_of_its_scatter(order, intervals, runs, within):
    """2 mean²/variance of n levels is known to √(2/n), 2.2 and 18 %; pieces not counted make four times."""
    noise = np.random.default_rng(0).standard_normal((runs, intervals + 1))
    power = noise_level(noise, order) ** 2
    assert np.mean(power) == pytest.approx(1.0, abs=0.05)
    assert 2 * power.mean() ** 2 / power.var() == pytest.approx(
        high_band_df(planned(order, intervals)), rel=within
    )


def test_levels_of_several_records_are_a_mean():
    """Of a short and a long record the short one's scatter rules: at most four times its own."""
    short, long = high_band_df(planned(2, 128)), high_band_df(planned(2, 4096))
    both = high_band_df(planned(2, 128, 4096))
    assert both == pytest.approx(4 / (1 / short + 1 / long))
    assert high_band_df(planned(2, 256, 256)) == pytest.approx(2 * high_band_df(planned(2, 256)))


@pytest.mark.parametrize("sizes", [(14,), (9, 6, 5)])
def test_ljung_box_of_independent_lines_has_its_mean(sizes):
    """The mean of 5,000, four standard errors; counted as real numbers it is 7 % more."""
    rng = np.random.default_rng(0)

    def test():
        return correlation_of_lines([rng.standard_normal(n) + 1j * rng.standard_normal(n) for n in sizes])

    found = [(a.statistic, r.size) for a, r in (test() for _ in range(5000))]
    lags = found[0][1]
    assert np.mean([q for q, _ in found]) / lags == pytest.approx(1.0, abs=4 * np.sqrt(2.2 / lags / 5000))


@pytest.mark.parametrize("delay", [0.0, 0.125])
def test_kinks_of_held_inputs_are_no_noise(delay):
    """The level of the high band was twice the noise of 1 %, and 8 times that of 0.2 %.

    A level has some 50 degrees of freedom, and so an error of 10 %; the mean of ten records 3.2 %.
    """
    plant = mf.tf([-4, -3], [1, 1.8, 5], delay=delay)
    t = 0.05 * np.arange(241)
    u = np.select([t < 1, t < 2.5, t < 3.5, t < 4, t < 4.5], [0.0, 1.0, -1.0, 1.0, -1.0], 0.0)
    y = plant.simulate(u=u, dt=0.05, intersample="zoh").ravel()
    structure = mf.TransferFunction(poles=2, zeros=1, delay=delay)
    for level in (0.01, 0.002):
        sd = level * y.std()
        found = []
        for seed in range(10):
            noise = sd * np.random.default_rng(seed).standard_normal(t.size)
            fit = mf.fit(mf.Record(y=y + noise, u=u, dt=0.05, intersample="zoh"), structure)
            found.append(fit.high_band_sigma / sd)
        assert np.sqrt(np.mean(np.square(found))) == pytest.approx(1.0, abs=0.13)


def test_an_estimate_on_a_bound_is_checked():
    """A delay that ends at 0, here or in a fit beside it, has no error to divide by: LinAlgError."""
    plant = mf.tf([3], [1, 2, 0])
    u = np.zeros(301)
    u[20:36], u[36:52] = 1.0, -1.0
    y = plant.simulate(u=u, dt=0.05, intersample="zoh").ravel()
    late = mf.TransferFunction(poles=2, zeros=0, params={"a2": 0.0}, delay=mf.Free(min=0, max=0.5))
    ended = 0
    for seed in range(8):
        noise = 0.02 * y.std() * np.random.default_rng(seed).standard_normal(301)
        rec = mf.Record(y=y + noise + 0.2, u=u, dt=0.05)
        for start in ("unknown", "rest"):
            fit = mf.fit(rec, late, initial_state=start)
            said = str(fit.check())
            ended += fit.at_bound == ("delay",)
            assert ("delay ended on a bound" in said) == (fit.at_bound == ("delay",))
            if fit.at_bound:  # whose error was 0
                twice, root = fit.derived(twice="2*delay", gain="b0/a1").rows
                assert np.isnan(twice["bse"])
                assert root["bse"] > 0
    assert ended >= 1


@pytest.mark.parametrize(("outputs", "each", "df"), [(3, [7.5, 7.5, 7.5], 160), (1, [9.8, 20.0], 30)])
def test_level_of_several_short_records_has_its_own_law(outputs, each, df):
    """Of 100,000 means of ratios 1 % and 10 % are beyond these p-values, within a third of that."""
    rng = np.random.default_rng(0)
    part = df / (outputs * len(each))
    ratios = [
        (rng.chisquare(part, (100_000, outputs)) / part) / (rng.chisquare(nu, (100_000, outputs)) / nu)
        for nu in each
    ]
    means = np.sort(np.mean(np.concatenate(ratios, axis=1), axis=1))
    for p in (0.01, 0.1, 0.5):
        beyond = float(means[round((1 - p) * means.size)])
        assert diagnosis._above(beyond, df, outputs, each) == pytest.approx(p, rel=0.34)
