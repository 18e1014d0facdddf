"""Parts of results: labels chosen, true values of 0, estimates drawn, estimators without hope."""

import modfun as mf
import numpy as np
import pytest

TWO = mf.TransferFunction(poles=2, zeros=0)


def study(**changes):
    given = {
        "system": {"damped": mf.tf([5], [1, 3, 8]), "free": mf.tf([5], [1, 0, 8])},
        "input": "sin(t**2/5)",
        "duration": 10.0,
        "intervals": 64,
        "nsr": [0.1, 0.4],
        "estimators": ["ls", "ml"],
        "harmonics": 6,
        "seed": 3,
        "metrics": {"first": lambda fit, rec: fit["a1"]},
    } | changes
    return mf.MonteCarlo(**given)


@pytest.fixture(scope="module")
def res():
    return study().run(replicates=40, progress=False, keep="samples")


def test_a_part_has_the_numbers_of_the_whole(res):
    part = res.sel(nsr=0.4, estimator=["ml"], parameter=["b0", "a1"])
    assert part.axes == {
        "system": ("damped", "free"), "nsr": (0.4,), "estimator": ("ml",), "parameter": ("b0", "a1"),
    }  # fmt: skip
    at = np.ix_([0, 1], [1], [1], [2, 0])
    for name in ("truth", "bias", "rmse_mcse", "coverage", "crlb"):
        np.testing.assert_array_equal(getattr(part, name), getattr(res, name)[at])
    np.testing.assert_array_equal(part.samples[:, 0, 0], res.samples[:, 1, 1][..., [2, 0]])
    np.testing.assert_array_equal(part.status["ok"], res.status["ok"][:, [1]][:, :, [1]])
    assert part.metrics["first"].mean[1, 0, 0] == res.metrics["first"].mean[1, 1, 1]
    np.testing.assert_array_equal(part.sel(system="free").crlb, part.crlb[1:])
    rows = res.table()
    wanted = (rows["system"] == "free") & (rows["nsr"] == 0.4) & (rows["estimator"] == "ml")
    own = part.sel(system="free").table()
    assert own["sd"].tolist() == rows["sd"][wanted][[2, 0]].tolist()


def test_one_cell_needs_no_labels_to_be_made_again(res):
    rec, fits = res.sel(system="free", nsr=0.1).replicate(7)
    whole, other = res.replicate(7, system="free", nsr=0.1)
    assert rec == whole
    assert fits["ml"]["a1"] == other["ml"]["a1"]


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ({"sys": "free"}, "no axis 'sys'; did you mean 'system'"),
        ({"nsr": 0.2}, r"nsr=0.2 is not in the study; .*there are: 0.1, 0.4"),
        ({"nsr": []}, r"nsr=\[\] leaves nothing"),
    ],
)
def test_labels_that_are_not_there_are_refused(res, labels, words):
    with pytest.raises(mf.SpecError, match=words):
        res.sel(**labels)


def test_a_true_value_of_zero_leaves_the_others_their_figures(res):
    table = res.relative()
    assert table.title.endswith("; a1 left out where the true value is 0")
    assert np.isfinite(table["bias"]).all()
    others = 100 * res.bias[1, 0, 0, 1:] / res.truth[1, 0, 0, 1:]
    row = (table["system"] == "free") & (table["nsr"] == 0.1) & (table["estimator"] == "ls")
    assert table["bias"][row].item() == pytest.approx(np.sqrt(np.mean(others**2)), rel=1e-12)


def test_histogram_and_quantiles_show_the_kept_estimates(res):
    part = res.sel(system="free", nsr=0.4)
    axes = part.plot_histogram()
    assert [one.get_xlabel() for one in axes] == ["a1", "a2", "b0"]
    assert axes[0].lines[0].get_xdata()[0] == 0.0  # the true value
    (here,) = [part.sel(parameter="a2").plot_quantiles()]
    points = here.lines[2].get_ydata()
    np.testing.assert_allclose(points[[0, -1]], np.quantile(part.samples[0, 0, 1, :, 1], [0.0125, 0.9875]))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda res: res, r"several cells; choose one, as res\.sel\(system='damped'\)"),
        (lambda res: study().run(replicates=2, progress=False), "run it with keep='samples'"),
    ],
)
def test_what_has_no_estimates_to_draw_says_so(res, make, words):
    with pytest.raises(mf.SpecError, match=words):
        make(res).plot_histogram()


def hopeless(rec, rng):
    raise ValueError("no luck")


def test_an_estimator_that_always_fails_stops_the_study():
    words = r"hopeless failed in each of the first 128 replicates.*the first said: ValueError: no luck"
    made = mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64, nsr=[0.1, 0.4],
        estimators={"hopeless": hopeless, "ml": mf.Estimator(TWO, harmonics=6)}, model=TWO,
    )  # fmt: skip
    with pytest.raises(mf.SpecError, match=words):
        made.run(replicates=10_000, progress=False)
