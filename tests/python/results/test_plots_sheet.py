"""A fit on one sheet, records side by side, names of axes: what is there, and in which unit."""

import modfun as mf
import numpy as np
import pytest
from modfun.base.axes import name_y

pytest.importorskip("matplotlib").use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")

TWO = mf.TransferFunction(poles=2, zeros=0)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def rec():
    return mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0
    )


@pytest.fixture(scope="module")
def fit(rec):
    return mf.fit(rec, TWO)


def titles(figure):
    return [here.get_title(loc="left") for here in figure.axes if here.get_title(loc="left")]


ALL = ["Response", "Frequency response", "Residual spectrum", "Poles"]


def test_a_fit_on_one_sheet(fit):
    figure = fit.plot()
    assert titles(figure) == ALL
    assert figure.get_suptitle() == "u → y: TransferFunction(poles=2, zeros=0), ml, ok"
    labels = {here.get_xlabel() for here in figure.axes}
    assert {"time (s)", "frequency (rad/s)", "real part (rad/s)"} <= labels
    lines = next(here for here in figure.axes if here.get_title(loc="left") == "Residual spectrum")
    omega = fit.omega0[0] * np.arange(fit.lines[0][0], fit.lines[0][1] + 1)
    np.testing.assert_allclose(lines.lines[0].get_xdata(), omega - 0.08 * fit.omega0[0])


def test_what_is_no_figure_is_refused(fit):
    with pytest.raises(mf.SpecError, match="figure=3 is not a Figure"):
        fit.plot(figure=3)


def test_hertz_on_every_axis_of_frequencies(fit):
    figure = fit.plot(hz=True)
    labels = [here.get_xlabel() for here in figure.axes if "frequency" in here.get_xlabel()]
    assert set(labels) == {"frequency (Hz)"}
    upper, _ = fit.plot_residuals(hz=True)
    assert upper.get_xlabel() == "frequency (Hz)"


def test_what_a_fit_does_not_have_is_left_out(fit, rec, tmp_path):
    cubic = mf.fit(rec, mf.Equation("y'' + d*y' + a*y + e3*y**3 = b*u"))
    assert titles(cubic.plot()) == ["Response", "Residual spectrum"]
    fit.save(tmp_path / "fit.json")
    assert titles(mf.load(tmp_path / "fit.json").plot()) == ALL[1:]
    assert titles(mf.load(tmp_path / "fit.json").plot(rec)) == ALL
    both = mf.fit([rec.window(0, 5), rec.window(5, 10)], TWO)
    assert titles(both.plot())[0] == "Response of record 0 of 2"


def test_records_side_by_side(rec):
    axes = rec.plot(beside=[rec.window(0, 5), rec.window(5, 10)])
    assert axes.shape == (2, 3)
    assert [one.get_title() for one in axes[0]] == ["record 0", "record 1", "record 2"]
    np.testing.assert_array_equal(axes[1, 2].lines[0].get_ydata(), rec.window(5, 10).u[0])
    assert axes[0, 0].get_ylim() == axes[0, 2].get_ylim()
    assert [one.get_xlabel() for one in axes[1]] == ["time (s)"] * 3
    with pytest.raises(mf.SpecError, match=r"by name, rec\.plot\(beside=\[other\]\)"):
        rec.plot(rec)
    with pytest.raises(mf.SpecError, match="record 1 has the channels y, the first y, u; select"):
        rec.plot(beside=[rec.select(inputs=[])])


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("q (deg/s)", "q (deg/s)"),
        ("pitch_rate_of_the_left_wing_tip (deg/s)", "pitch_rate_of_\nthe_left_wing_\ntip (deg/s)"),
        ("x" * 40, "x" * 15 + "…"),
    ],
)
def test_names_are_not_taller_than_their_panel(name, shown):
    figure, here = plt.subplots(figsize=(6, 1.2))
    name_y(here, name)
    assert here.get_ylabel() == shown
    figure.canvas.draw()
    assert here.yaxis.label.get_window_extent().height < 1.2 * figure.dpi
