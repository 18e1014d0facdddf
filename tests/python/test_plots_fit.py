"""Plots of fits: what is drawn, not how it looks."""

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def fit():
    t = np.linspace(0.0, 10.0, 257)
    y = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256, x0=[1, 0.5])
    y += 0.05 * np.random.default_rng(0).standard_normal(t.size)
    rec = mf.Record(y=y, u=np.sin(t**2 / 5), dt=10 / 256, outputs="q", inputs="de", units={"q": "deg/s"})
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def test_response_draws_the_record_the_simulation_and_the_error(fit):
    upper, lower = fit.plot_response()
    measured, simulated = (line.get_ydata() for line in upper.get_lines())
    np.testing.assert_allclose(measured, fit.records[0].y[0], atol=1e-12)
    np.testing.assert_array_equal(simulated, fit.predict().y[0])
    np.testing.assert_array_equal(lower.get_lines()[0].get_ydata(), fit.errors()[0])
    assert upper.get_ylabel() == "q (deg/s)"


def test_bode_draws_gain_and_a_band_that_is_the_delta_method(fit):
    upper, lower = mf.plot.bode(fit, band=(1.0, 5.0))
    line = next(x for x in upper.get_lines() if x.get_linestyle() == "--")
    omega, db = line.get_data()
    expected = fit.model.frequency_response(omega).response[0, 0]
    np.testing.assert_allclose(db, 20 * np.log10(np.abs(expected)), atol=1e-9)
    edge = upper.collections[0].get_paths()[0].vertices
    k = 200
    at = edge[np.isclose(edge[:, 0], omega[k]), 1]
    step = 1e-6
    gradient = []
    for i in range(3):
        theta = fit.params.copy()
        theta[i] += step
        den, nums = fit.layout.polynomials(theta)
        g = np.polyval(nums[0], 1j * omega[k]) / np.polyval(den, 1j * omega[k])
        gradient.append((20 * np.log10(abs(g)) - db[k]) / step)
    error = np.sqrt(np.array(gradient) @ fit.cov_params() @ np.array(gradient))
    _, high = fit.interval(np.array(0.0), np.array(error))
    assert at.max() - db[k] == pytest.approx(float(high), rel=1e-3)
    assert np.diff(lower.get_lines()[0].get_ydata()).max() < 0


def test_bode_takes_fits_systems_and_responses_and_hertz(fit):
    truth = mf.tf([5], [1, 3, 8])
    response = truth.frequency_response(np.linspace(0.5, 10, 50))
    upper, lower = mf.plot.bode(fit, truth, response, hz=True, labels=["fit", "truth", "points"])
    assert len(upper.get_lines()) == 4
    assert "Hz" in lower.get_xlabel()
    assert [text.get_text() for text in upper.get_legend().get_texts()] == ["fit de → q", "truth", "points"]
    assert upper.get_lines()[-1].get_xdata()[0] == pytest.approx(0.5 / (2 * np.pi))
    response.plot()


def test_residuals_draws_every_line_and_the_limits(fit):
    upper, lower = fit.plot_residuals()
    re, im = upper.get_lines()[:2]
    np.testing.assert_array_equal(re.get_ydata(), fit.residuals.real)
    np.testing.assert_array_equal(im.get_ydata(), fit.residuals.imag)
    limits = {round(line.get_ydata()[0], 2) for line in upper.get_lines()[3:]}
    assert limits == {-1.96, 1.96}
    assert len(lower.patches) >= 2


def test_poles_lie_in_their_ellipses(fit):
    axes = fit.plot_poles()
    marks = axes.get_lines()[0]
    np.testing.assert_allclose(
        np.sort_complex(marks.get_xdata() + 1j * marks.get_ydata()), np.sort_complex(fit.model.poles())
    )
    assert len(axes.patches) == 2
    # Half the height of the ellipse is sqrt(2 F) standard errors of the imaginary part.
    from scipy.stats import f

    edge = axes.patches[0].get_path().vertices
    step = fit.derived(im="sqrt(a2 - a1**2/4)")["bse"][0] * np.sqrt(2 * f.ppf(0.95, 2, fit.df_resid))
    assert np.ptp(edge[:, 1]) / 2 == pytest.approx(step, rel=1e-3)


def test_given_axes_are_used(fit):
    figure, axes = plt.subplots(2, 1)
    assert list(mf.plot.response(fit, ax=axes)) == list(axes)
    assert mf.plot.poles(fit, fit, labels=["a", "b"], ax=axes[0]) is axes[0]
    assert figure.axes == list(axes)


@pytest.mark.parametrize(
    ("call", "cure"),
    [
        (lambda fit: mf.plot.bode(), "at least one"),
        (lambda fit: mf.plot.poles(), "at least one"),
        (lambda fit: mf.plot.bode(fit, band=(0.0, 1.0)), "0 < lower"),
        (lambda fit: mf.plot.bode(fit, labels=["a", "b"]), "give one each"),
        (lambda fit: mf.plot.poles(fit, labels=[]), "give one each"),
        (lambda fit: mf.plot.response(fit, ax=np.array([None])), "Axes"),
    ],
)
def test_bad_use_is_refused(fit, call, cure):
    with pytest.raises(mf.SpecError, match=cure):
        call(fit)
