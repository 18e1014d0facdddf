"""What the plots of used harmonics, residual tests and correlations show."""

import matplotlib
import modfun as mf
import numpy as np
import pytest
from matplotlib.figure import Figure

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def fit():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=1024, nsr=0.1, seed=0
    )
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))


def axes_of(rows):
    return list(Figure(figsize=(6, 2 * rows)).subplots(rows, 1, squeeze=False)[:, 0])


def test_the_line_of_the_noise_stands_where_the_noise_is(fit):
    """Mean square of 700 lines, twice smoothed by the window: 5 % off in one of a hundred records."""
    upper, lower = fit.plot_harmonics(ax=axes_of(2))
    levels = {line.get_label(): line.get_ydata()[0] for line in upper.get_lines()}
    spectrum = fit.records[0].spectrum()
    seen = np.sqrt(np.mean(spectrum["y"][300:] ** 2))
    assert levels["noise of the high band"] == pytest.approx(seen, rel=0.08)
    assert levels["noise of the fit"] == pytest.approx(fit.sigma * np.sqrt(6 / 1024))
    assert len(lower.get_lines()) == 1
    shaded = [patch for patch in upper.patches if patch.get_label() == "used"]
    edges = shaded[0].get_extents().transformed(upper.transData.inverted())
    assert edges.x1 == pytest.approx((fit.lines[0][1] + 0.5) * fit.omega0[0])


def test_cumulated_power_ends_at_one_and_quantiles_are_sorted(fit):
    left, right = fit.plot_residual_tests(ax=axes_of(2))
    power = left.get_lines()[0].get_ydata()
    assert power[-1] == pytest.approx(1)
    assert np.all(np.diff(power) >= 0)
    shown = right.get_lines()[1].get_ydata()
    assert np.array_equal(shown, np.sort(np.concatenate([fit.residuals.real, fit.residuals.imag])))


def test_correlations_are_those_of_the_covariance(fit):
    ax = fit.plot_correlation(ax=axes_of(1)[0])
    shown = np.asarray(ax.collections[0].get_array()).reshape(3, 3)
    errors = fit.bse
    assert np.allclose(shown * np.outer(errors, errors), fit.cov_params())
    assert np.allclose(np.diag(shown), 1)


def test_residuals_of_one_equation_with_two_outputs_are_one_row():
    t = 0.05 * np.arange(401)
    y = np.array([np.sin(t), 2 * np.cos(t)]) + 0.01 * np.random.default_rng(0).normal(size=(2, 401))
    fit = mf.fit(mf.Record(y=y, dt=0.05, outputs=["a", "b"]), mf.Equation("a' = k*b", outputs=["a", "b"]))
    assert fit.row_names == ("equation 1",)
    assert len(fit.plot_residuals(ax=axes_of(2))) == 2
    assert len(fit.plot_residual_tests(ax=axes_of(2))) == 2
    with pytest.raises(mf.SpecError, match="residuals belong to equations"):
        fit.plot_residuals(output="b", ax=axes_of(2))


def test_one_axes_is_refused_where_two_are_drawn(fit):
    with pytest.raises(mf.SpecError, match="give 2"):
        fit.plot_residual_tests(ax=axes_of(1)[0])
