"""Step, impulse and Nyquist plots, and grids of Bode plots: lines and bands, not looks."""

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")

TRUTH = mf.tf([[[5], [2, 1]], [[1, 0], [3]]], [1, 1, 8])


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def fit():
    rec = mf.simulate(
        TRUTH, input=["sin(t**2/5)", "sin(3*t)*cos(0.3*t**2)"], duration=20.0, intervals=512, nsr=0.3,
        seed=0, outputs=["q", "theta"], inputs=["de", "da"],
    )  # fmt: skip
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="common"))


@pytest.fixture(scope="module")
def one():
    rec = mf.simulate(
        mf.tf([5], [1, 1, 8]), input="sin(t**2/5)", duration=20.0, intervals=256, nsr=0.3, seed=0
    )
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))


@pytest.mark.parametrize(("plot", "response"), [(mf.plot.step, "step"), (mf.plot.impulse, "impulse")])
def test_responses_in_time_have_the_band_of_the_delta_method(one, plot, response):
    here = plot(one, duration=4.0)
    t, y = getattr(one.model, response)(4.0, 400)
    np.testing.assert_array_equal(here.lines[0].get_ydata(), y)
    slopes = []
    for k in range(3):
        h = 1e-5 * np.eye(3)[k] * one.params[k]
        near = [mf.tf([p[2]], [1, p[0], p[1]]) for p in (one.params + h, one.params - h)]
        after, before = (getattr(system, response)(4.0, 400)[1] for system in near)
        slopes.append((after - before) / (2 * h[k]))
    error = np.sqrt(np.einsum("pt,pq,qt->t", slopes, one.cov_params(), slopes))
    upper = here.collections[0].get_paths()[0].vertices
    at = int(np.argmax(error))
    drawn = upper[np.isclose(upper[:, 0], t[at])][:, 1].max()
    assert drawn == pytest.approx(y[at] + one.interval(np.zeros(1), error[at : at + 1])[1][0], rel=1e-4)


def test_paths_have_panels_of_their_own(fit):
    axes = mf.plot.step(fit, TRUTH, labels=["fit", "truth"])
    assert [one.get_title() for one in axes] == ["de → q", "da → q", "de → theta", "da → theta"]
    assert [text.get_text() for text in axes[0].get_legend().get_texts()] == ["fit", "truth"]


def test_nyquist_marks_the_point_and_draws_regions_around_the_gains(one):
    here = mf.plot.nyquist(one, band=(0.1, 30.0))
    z = here.lines[0].get_xdata() + 1j * here.lines[0].get_ydata()
    assert z[0] == pytest.approx(one.model(0.1j))
    assert here.lines[-1].get_xdata() == [-1]
    assert len(here.patches) > 15
    for patch in here.patches:
        middle = patch.get_xy()[:-1].mean(axis=0) @ [1, 1j]
        assert np.abs(z - middle).min() < 0.02


def test_a_grid_of_bode_plots(fit):
    axes = mf.plot.bode(fit, TRUTH, grid=True, labels=["fit", "truth"])
    assert axes.shape == (4, 2)
    assert [one.get_title() for one in axes[::2].ravel()] == ["de → q", "da → q", "de → theta", "da → theta"]
    assert axes[3, 0].get_xlabel() == "frequency (rad/s)"
    sparse = mf.plot.bode(mf.tf([[[1], [0]], [[1], [1]]], [1, 1]), grid=True)
    assert sparse[0, 1].get_title() == "no path"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda fit: mf.plot.step(), "give at least one fit or system"),
        (lambda fit: mf.plot.step(fit, mf.tf([1], [1, 1])), r"\(2, 2\) and \(1, 1\) outputs and inputs"),
        (lambda fit: mf.plot.nyquist(5), "5 is not a linear system with inputs"),
        (lambda fit: mf.plot.impulse(fit, labels=["a", "b"]), "2 labels for 1 systems"),
    ],
)
def test_bad_use_is_refused(fit, make, words):
    with pytest.raises(mf.SpecError, match=words):
        make(fit)


def test_several_systems_are_told_apart_and_measured_phases_stand_on_their_branch() -> None:
    system = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    upper, lower = mf.plot.bode(fit, mf.frf(rec, band=7.0), fit.model)
    words = [text.get_text() for text in upper.get_legend().get_texts()]
    assert [word.split(" u")[0] for word in words] == ["2 poles", "measured", "system"]
    first = [line.get_ydata()[0] for line in lower.get_lines()]
    assert len(first) >= 3
    assert np.nanmax(np.abs(first)) < 90.0  # at the lowest frequencies: no whole turns apart


def test_a_lag_stands_on_its_own_branch_beside_one_with_a_delay() -> None:
    late, alone = mf.tf([1], [1, 1], delay=8.0), mf.tf([1], [1, 1])
    _, lower = mf.plot.bode(late, alone, band=(0.01, 10.0))
    phases = [line.get_ydata() for line in lower.get_lines()]
    assert phases[-1][0] == pytest.approx(-0.57, abs=0.1)
    assert phases[-1][-1] == pytest.approx(-84.3, abs=0.1)  # -444.3 before
    rec = mf.simulate(late, input="sin(t**2/200)", duration=200.0, intervals=2000, nsr=0.05, seed=0)
    right = mf.fit(rec, mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=12)))
    with pytest.warns(mf.ModfunWarning, match="First try a delay"):
        wrong = mf.fit(rec, mf.TransferFunction(poles=1, zeros=0))
    _, lower = mf.plot.bode(right, wrong, band=(0.01, 3.0))
    assert min(line.get_ydata()[0] for line in lower.get_lines()) > -90.0  # of both, and their bands


def test_a_bode_plot_needs_two_axes() -> None:
    figure, ax = plt.subplots()
    with pytest.raises(mf.SpecError, match="a single Axes; give two, for magnitude and phase"):
        mf.plot.bode(mf.tf([5], [1, 3, 8]), ax=ax)
    plt.close(figure)
