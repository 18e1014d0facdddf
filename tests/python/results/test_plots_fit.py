"""Plots of fits: what is drawn, not how it looks."""

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def fit():
    t = np.linspace(0.0, 10.0, 257)
    y = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256, initial_state=[1, 0.5])
    y += 0.05 * np.random.default_rng(0).standard_normal(t.size)
    rec = mf.Record(y=y, u=np.sin(t**2 / 5), dt=10 / 256, outputs="q", inputs="de", units={"q": "deg/s"})
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))


OF_SYSTEMS = ("bode", "impulse", "nyquist", "step")
THINGS = [name for name in mf.plot.__all__ if name not in OF_SYSTEMS]


@pytest.mark.parametrize("other", [5, "fit", None, np.zeros(3)], ids=str)
@pytest.mark.parametrize("name", THINGS)
def test_what_cannot_be_drawn_is_said_with_what_can(name, other):
    with pytest.raises(
        mf.SpecError, match=rf"plot\.{name}: .*is of type {type(other).__name__}; it takes [A-Z]"
    ):
        getattr(mf.plot, name)(other)


@pytest.mark.parametrize("other", [5, "fit", None])
def test_a_bode_plot_of_something_else_is_refused(fit, other):
    with pytest.raises(mf.SpecError, match=r"plot\.bode: .*give a Fit, an LTI or a FrequencyResponse"):
        mf.plot.bode(fit, other)


@pytest.mark.parametrize("ax", [5, "axes", [1, 2]])
def test_what_is_no_axes_is_refused(fit, ax):
    with pytest.raises(mf.SpecError, match="not an Axes"):
        mf.plot.residuals(fit, ax=ax)


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
    limits = {round(line.get_ydata()[0], 2) for line in upper.get_lines()[3:5]}
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


# Several outputs, masked samples -------------------------------------------------------------------


def record_of_two(**words):
    t = 0.05 * np.arange(401)
    u = np.array([np.sin(t**2 / 6), np.cos((20 - t) ** 2 / 5)])
    y = mf.tf([[[1.0, 2.0], [3.0]], [[0.0], [-1.0, 0.7]]], [1, 1.2, 4.0]).simulate(u=u, dt=0.05)
    y += 0.05 * np.random.default_rng(1).standard_normal(y.shape)
    return mf.Record(y=y, u=u, dt=0.05, outputs=["al", "q"], inputs=["de", "da"], units={"q": "1/s"}, **words)


@pytest.fixture(scope="module", params=["common", "separate"])
def two(request):
    tf = mf.TransferFunction(poles=2, zeros=[[1, 0], [None, 1]], denominator=request.param)
    return mf.fit(record_of_two(), tf, band=6.0)


def test_each_output_has_its_response_and_error(two):
    axes = two.plot_response()
    assert axes.shape == (4,)
    assert [here.get_ylabel() for here in axes] == ["al", "error of al", "q (1/s)", "error of q (1/s)"]
    for i in range(2):
        measured, simulated = (line.get_ydata() for line in axes[2 * i].get_lines())
        np.testing.assert_array_equal(measured, two.records[0].y[i])
        np.testing.assert_array_equal(simulated, two.predict().y[i])
        np.testing.assert_array_equal(axes[2 * i + 1].get_lines()[0].get_ydata(), two.errors()[i])
    level = two.score()["signal_to_error"][1]
    assert f"simulated: {level:.1f} dB" in [x.get_label() for x in axes[2].get_lines()]
    alone = two.plot_response(output="q")
    np.testing.assert_array_equal(alone[0].get_lines()[1].get_ydata(), two.predict().y[1])
    here = plt.figure().add_subplot()
    assert two.plot_response(output="q", ax=here) is here


def test_bode_draws_the_paths_of_all_outputs_and_no_others(two):
    upper, _ = two.plot_bode(band=(1.0, 5.0))
    names = [text.get_text() for text in upper.get_legend().get_texts()]
    assert names == ["de → al", "da → al", "da → q"]
    dashed = [line for line in upper.get_lines() if line.get_linestyle() == "--"]
    omega = dashed[0].get_xdata()
    want = two.model.frequency_response(omega).response
    for line, (i, k) in zip(dashed, [(0, 0), (0, 1), (1, 1)], strict=True):
        np.testing.assert_allclose(line.get_ydata(), 20 * np.log10(np.abs(want[i, k])), atol=1e-9)
    # The band at one frequency against the covariance of the gain itself.
    gain, gradient = two.frequency_response([omega[200]])
    relative = (gradient[:, 1, 1, 0] / gain[1, 1, 0]).real
    half = 20 / np.log(10) * two.interval(0.0, np.sqrt(relative @ two.cov_params() @ relative))[1]
    edge = upper.collections[2].get_paths()[0].vertices
    at = edge[np.isclose(edge[:, 0], omega[200]), 1]
    assert at.max() - at.min() == pytest.approx(2 * half, rel=1e-6)


def test_residuals_of_each_output(two):
    axes = two.plot_residuals()
    assert axes.shape == (4,)
    for i, name in enumerate(["al", "q"]):
        assert axes[2 * i].get_ylabel() == f"whitened residual of {name}"
        np.testing.assert_array_equal(axes[2 * i].get_lines()[0].get_ydata(), two.residuals[i].real)
    (upper, _) = two.plot_residuals(output="q")
    np.testing.assert_array_equal(upper.get_lines()[1].get_ydata(), two.residuals[1].imag)


def test_poles_of_separate_denominators_have_their_own_colours(two):
    marks = [line for line in two.plot_poles().get_lines() if line.get_marker() == "x"]
    if two.layout.common:
        assert len(marks) == 1
        return
    assert [line.get_label() for line in marks] == ["al", "q"]
    assert marks[0].get_color() != marks[1].get_color()
    for i, line in enumerate(marks):
        found = np.sort_complex(line.get_xdata() + 1j * line.get_ydata())
        np.testing.assert_allclose(found, np.sort_complex(np.roots(two.polynomials(i)[0])))


def test_masked_samples_are_drawn_apart_and_have_no_error():
    ok = np.ones((2, 401), bool)
    ok[0, 100:112] = False
    fit = mf.fit(record_of_two(mask=ok), mf.TransferFunction(poles=2, denominator="common"), band=6.0)
    al, error, q, _ = fit.plot_response()
    lines = {line.get_label(): line for line in al.get_lines()}
    np.testing.assert_array_equal(np.isnan(lines["measured"].get_ydata()), ~ok[0])
    np.testing.assert_array_equal(np.flatnonzero(~np.isnan(lines["masked"].get_ydata())), np.r_[99:113])
    np.testing.assert_array_equal(np.isnan(error.get_lines()[0].get_ydata()), ~ok[0])
    assert "masked" not in [line.get_label() for line in q.get_lines()]


@pytest.mark.parametrize(
    ("call", "cure"),
    [
        (lambda fit: fit.plot_response(ax=plt.figure().add_subplot()), "choose one output"),
        (lambda fit: fit.plot_residuals(ax=plt.figure().subplots(2, 1)), "4 are needed"),
        (lambda fit: fit.plot_response(output="Q"), "did you mean 'q'"),
        (lambda fit: fit.plot_residuals(output="de"), "no output 'de'"),
    ],
)
def test_bad_use_with_several_outputs_is_refused(two, call, cure):
    with pytest.raises(mf.SpecError, match=cure):
        call(two)


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


def test_bode_puts_phases_of_one_path_on_one_branch():
    """180 and -180 degrees are the same angle: what begins at either must be drawn side by side."""
    omega = np.geomspace(0.5, 8, 40)
    gain = mf.tf([-5, -1], [1, 3, 8]).frequency_response(omega).response[0, 0]
    above, below = (
        mf.FrequencyResponse(omega=omega, response=gain / gain[0] * np.exp(1j * angle))
        for angle in (np.pi - 0.01, np.pi + 0.01)
    )
    lower = mf.plot.bode(above, below, band=(0.5, 8.0))[1]
    first, second = (np.asarray(line.get_ydata()) for line in lower.lines)
    np.testing.assert_allclose(second - first, np.degrees(0.02), rtol=1e-6)
