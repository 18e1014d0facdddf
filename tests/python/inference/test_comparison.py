"""Models beside each other: scores, records left out, names, refusals, plots."""

import pickle
import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.stats import chi2, kstest

TF1, TF2 = mf.TransferFunction(poles=1, zeros=0), mf.TransferFunction(poles=2, zeros=0)


def record(seed, nsr=0.1):
    plant = mf.tf([5], [1, 3, 8])
    return mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=seed)


@pytest.fixture(scope="module")
def fits():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the first order does not suit
        rec = record(0)
        return [mf.fit(rec, structure) for structure in (TF1, TF2)]


def test_a_comparison_holds_the_scores_of_each_fit(fits):
    table = mf.compare({"one": fits[0], "two": fits[1]}, record(1))
    assert table["model"].tolist() == ["one", "two"]
    assert table["parameters"].tolist() == [2, 3]
    for k, fit in enumerate(fits):
        (row,) = fit.score(record(1)).rows
        assert {name: table[name][k] for name in row} == row
    assert table["fit_percent"][1] > table["fit_percent"][0]
    assert pickle.loads(pickle.dumps(table)) == table
    assert "<table>" in table._repr_html_()


def test_without_a_record_the_common_one_is_taken(fits):
    assert mf.compare(fits) == mf.compare(fits, fits[0].records[0])
    other = mf.fit(record(1), TF2)
    with pytest.raises(mf.DataError, match="do not share"):
        mf.compare([fits[1], other])
    with pytest.raises(mf.DataError, match="do not share"):
        mf.compare([fits[1].without_samples()])


def test_models_that_run_away_have_rows_without_scores(fits):
    """One had ended the whole comparison in a DataError."""
    wild = mf.tf([1], [1, -3000])
    table = mf.compare({"two": fits[1], "wild": wild})
    assert table["model"].tolist() == ["two", "wild"]
    assert table.title == "Too unstable to be simulated over 10 s: 'wild'."
    assert np.isnan([table[score][1] for score in ("signal_to_error", "fit_percent", "r2", "theil")]).all()
    assert table["fit_percent"][0] == mf.compare([fits[1]])["fit_percent"][0] > 80
    assert pickle.loads(pickle.dumps(table)) == table
    labels = table.plot().get_legend_handles_labels()[1]
    assert [label.split(":")[0] for label in labels] == ["y measured", "two"]
    assert mf.compare([fits[1]]).title is None
    with pytest.raises(mf.DataError, match="outputs"):
        mf.compare([fits[1]], mf.Record(y=record(0).y, u=record(0).u, dt=0.04, outputs="q"))


@pytest.mark.parametrize("pole", [12.0, 60.0])
def test_responses_beyond_all_outputs_have_no_scores(fits, pole):
    """They are finite: fit_percent was -4e272, with warnings of NumPy's about squares that overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        table = mf.compare({"two": fits[1], "wild": mf.tf([1], [1, 2 - pole, -2 * pole])})
    assert table.title == "Too unstable to be simulated over 10 s: 'wild'."
    assert np.isnan(table["fit_percent"][1])


def test_the_criteria_of_a_fit_name_the_comparison(fits):
    """Fits of one and two poles have bands of their own, so that their own BIC do not compare."""
    one, two = fits
    assert one.band != two.band
    said = dict(two.summary().facts)["BIC"]
    assert said == f"{two.bic:.5g} on this band; mf.compare puts models on one band"
    for name in ("aic", "bic"):
        assert "`mf.compare`" in getattr(type(two), name).__doc__
    with pytest.warns(mf.ModfunWarning):  # the first order does not suit
        wide = mf.fit(record(0), TF1, band=two.band[1] * (1 + 1e-9))
    assert mf.compare(fits)["bic"][0] == pytest.approx(wide.bic, rel=1e-9)
    assert wide.bic < one.bic - 5  # more lines, and no better fit
    assert mf.compare(fits)["aic"][0] == pytest.approx(wide.aic, rel=1e-9)


def test_nested_models_are_tested_by_the_likelihood_ratio():
    """A parameter held at its true value: of 300 p-values 15 are below 5 %, 28 or more in 1 of 1,000 trials.

    By chi-square some 30 are.
    """
    tests, held = [], mf.TransferFunction(poles=2, zeros=0, params={"a2": 8.0})
    for seed in range(300):
        rec = record(seed)
        fits = {"held": mf.fit(rec, held), "free": mf.fit(rec, TF2)}
        tests.append(mf.compare(fits).likelihood_ratio("held", "free"))
    ratios, found = np.array([(t["minus_2_log"][0], t["p_value"][0]) for t in tests]).T
    assert min(ratios) > -0.01
    assert 4 <= np.sum(found < 0.05) <= 27
    assert np.sum(chi2.sf(ratios, 1) < 0.05) > 27
    assert kstest(found, "uniform").pvalue > 1e-3


def test_the_likelihood_ratio_of_two_outputs_counts_equations_of_each():
    """Of 100 p-values 5 are below 5 %, 13 or more in 1 of 1,000 trials."""
    free, found = pitch(), []
    system = free.model({"za": -0.8, "zq": 0.9, "ma": -5.0, "mq": -1.2, "zd": -0.1, "md": -4.0})
    for seed in range(100):
        rec = mf.simulate(system, input="sin(t**2/5)", duration=10, intervals=300, nsr=0.1, seed=seed)
        fits = {"held": mf.fit(rec, pitch(zd=-0.1, za=-0.8)), "free": mf.fit(rec, free)}
        test = mf.compare(fits).likelihood_ratio("held", "free")
        found.append(test["p_value"][0])
    assert 1 <= np.sum(np.array(found) < 0.05) <= 12
    assert kstest(found, "uniform").pvalue > 1e-3
    assert test["df_resid"][0] == fits["free"].df_resid / 2


def pitch(**held):
    return mf.StateSpace(
        [["za", "zq"], ["ma", "mq"]], ["zd", "md"], states=["a", "q"], inputs=["u"], params=held
    )


def test_the_likelihood_ratio_is_that_of_the_criteria(fits):
    table = mf.compare({"one": fits[0], "two": fits[1]})
    test = table.likelihood_ratio("one", "two")
    smaller, larger = table["aic"] - 2 * table["parameters"]
    assert test["minus_2_log"][0] == pytest.approx(smaller - larger)
    n = np.exp(2 + (table["bic"][1] - table["aic"][1]) / 3)
    assert test["df_resid"][0] == pytest.approx(n - 3)
    assert test["F"][0] == pytest.approx(np.expm1((smaller - larger) / n) * (n - 3))
    assert test["df"].tolist() == [1]
    assert test["p_value"][0] < 1e-6
    assert pickle.loads(pickle.dumps(table)).likelihood_ratio("one", "two") == test


def test_what_is_not_nested_is_not_tested(fits):
    table = mf.compare({"one": fits[0], "two": fits[1], "published": mf.tf([5], [1, 3, 8])}, record(0))
    for names, said in [
        (("two", "one"), "'one' has 2 parameters, 'two' 3; give the model with fewer first"),
        (("one", "three"), "no model 'three'; there are ['one', 'two', 'published']"),
        (("published", "two"), "the aic of 'published' and 'two' are [nan"),
    ]:
        with pytest.raises(mf.SpecError) as error:
            table.likelihood_ratio(*names)
        assert said in str(error.value)


def test_a_linear_system_stands_beside_fits(fits):
    """With the numbers of a fit it has the scores of that fit, and no BIC; its name may be another."""
    table = mf.compare(
        {"two": fits[1], "its numbers": fits[1].model, "published": mf.tf([5], [1, 3, 8])}, record(1)
    )
    assert table["parameters"].tolist() == [3, 0, 0]
    for score in ("signal_to_error", "fit_percent", "r2", "theil"):
        assert table[score][1] == pytest.approx(table[score][0], rel=1e-9)
    assert table["fit_percent"][2] > 85
    assert np.isfinite(table["bic"][0])
    assert np.all(np.isnan(table["bic"][1:]))
    assert pickle.loads(pickle.dumps(table)) == table


def test_systems_alone_are_compared_on_a_record():
    """An offset and a start that is not at rest belong to the record; a static gain has an offset alone."""
    rec = record(1, nsr=0.0).assign(y=lambda r: r["y"] + 3.0).window(1.0, 10.0)
    table = mf.compare([mf.tf([5], [1, 3, 8]), mf.ss([[-1]], [[1]], [[1]]), mf.tf([0.5], [1])], rec)
    assert table["model"].tolist() == ["LTI", "LTI (2)", "LTI (3)"]
    assert table["fit_percent"][0] == pytest.approx(100, abs=1e-3)
    left = rec.y[0] - 0.5 * rec.u[0]
    assert table["fit_percent"][2] == pytest.approx(100 * (1 - left.std() / rec.y[0].std()))
    with pytest.raises(mf.DataError, match="do not share"):
        mf.compare([mf.tf([5], [1, 3, 8])])


def test_a_system_of_several_channels_is_matched_by_names_or_refused(fits):
    control = pytest.importorskip("control")
    plant = mf.tf([[[5]], [[5, 0]]], [1, 3, 8])
    rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    rec = mf.Record(rec.y, u=rec.u, dt=rec.dt, outputs=["q", "a"], inputs=["de"])
    swapped = control.tf([[[5, 0]], [[5]]], [[[1, 3, 8]]] * 2, inputs=["de"], outputs=["a", "q"])
    table = mf.compare({"by name": swapped}, rec)
    assert table["output"].tolist() == ["a", "q"]
    assert np.all(table["fit_percent"] > 85)
    with pytest.raises(mf.SpecError, match=r"'one' has 1 output\(s\) and 1 input\(s\).*rec\.select"):
        mf.compare({"one": mf.tf([5], [1, 3, 8])}, rec)


def test_uneven_samples_are_simulated_too():
    t = np.sort(np.r_[0, 10, np.random.default_rng(0).uniform(0, 10, 400)])
    rec = mf.Record(np.exp(-t) + 2, u=np.zeros(t.size), t=t)
    assert mf.compare({"lag": mf.tf([1], [1, 1])}, rec)["fit_percent"][0] == pytest.approx(100, abs=1e-6)


def test_a_list_is_named_by_poles_and_zeros(fits):
    table = mf.compare([*fits, fits[1]], record(1))
    assert table["model"].tolist() == ["1 pole, 0 zeros", "2 poles, 0 zeros", "2 poles, 0 zeros (2)"]


def test_each_record_is_left_out_once():
    records = [record(seed) for seed in range(3)]
    table = mf.cross_validate(records, {"one": TF1, "two": mf.Estimator(TF2, band=10.0)})
    assert table["record"].tolist() == [0, 1, 2] * 2
    fit = mf.fit([records[0], records[2]], TF2, band=10.0)
    assert table["r2"][4] == fit.score(records[1])["r2"][0]
    short = table.summary()
    assert short["fit_percent"][1] == np.median(table["fit_percent"][3:])
    assert short["worst_fit_percent"][0] == table["fit_percent"][:3].min()
    assert pickle.loads(pickle.dumps(table)) == table


def test_what_cannot_be_scored_is_nan_and_says_why():
    t = np.linspace(0, 10, 201)
    moving = mf.simulate(mf.tf([1], [1, -2]), input="sin(t)", duration=4.0, intervals=100)
    long = mf.Record(y=np.sin(t), u=np.sin(t), dt=8.0)
    table = mf.cross_validate([moving, long], [TF1])
    assert table["status"][1] == "overflow"
    assert np.isnan(table["fit_percent"][1])
    assert table.summary()["worst_fit_percent"][0] == -np.inf


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: mf.compare({}), "nothing"),
        (lambda: mf.compare("fit"), "by name"),
        (lambda: mf.compare([TF2], record(0)), "not a Fit"),
        (lambda: mf.cross_validate([record(0), record(1)], {"x": 3}), "not an Estimator"),
    ],
)
def test_what_is_no_fit_or_estimator_is_refused(call, text):
    with pytest.raises(mf.SpecError, match=text):
        call()


def test_one_record_is_too_few(fits):
    with pytest.raises(mf.DataError, match="split"):
        mf.cross_validate([record(0)], [TF2])
    with pytest.raises(mf.SpecError, match="rec is"):
        mf.compare(fits, 3)


def test_plots(fits):
    pytest.importorskip("matplotlib").use("Agg")
    pytest.importorskip("matplotlib.pyplot")
    table = mf.compare({"one": fits[0], "two": fits[1]}, record(1))
    ax = table.plot()
    drawn = ax.get_lines()
    (_, *others) = mf.compare({"numbers": fits[1].model, "two": fits[1]}, record(1)).plot().get_lines()
    np.testing.assert_allclose(others[0].get_ydata(), others[1].get_ydata(), rtol=1e-9)
    np.testing.assert_array_equal(drawn[0].get_ydata(), record(1).y[0])
    np.testing.assert_array_equal(drawn[2].get_ydata(), fits[1].predict(record(1)).y[0])
    assert drawn[2].get_label() == f"two: {table['fit_percent'][1]:.1f} %"
    crossed = mf.cross_validate([record(0), record(1), record(2)], [TF2])
    np.testing.assert_array_equal(crossed.plot().get_lines()[0].get_ydata(), crossed["fit_percent"])


def test_bic_over_one_band_prefers_the_truth():
    """A Duffing oscillator without and with seven superfluous terms; six records, one may be lost."""
    true = "y'' + a*y' + b*y + c*y**3 = d*u"
    left = "y'' + a*y' + b*y + c*y**3 + e1*y**2 + e2*y*y' + e3*y'**2 + e4*y**5 + e5*y**4"
    more = f"{left} = d*u + e6*u**2 + e7*u*y"
    plant = mf.Equation(true).model({"a": 0.5, "b": 4.0, "c": 8.0, "d": 5.0})
    chosen = []
    for seed in range(6):
        rec = mf.simulate(plant, input="sin(t**2/10)", duration=20.0, intervals=800, nsr=0.05, seed=seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fits = {"true": mf.fit(rec, mf.Equation(true)), "more": mf.fit(rec, mf.Equation(more))}
            bic = mf.compare(fits, rec)["bic"]
        chosen.append(bool(bic[0] < bic[1]))
    assert sum(chosen) >= 5


def test_bic_of_fits_of_other_records_does_not_compare(fits):
    assert np.all(np.isfinite(mf.compare(fits)["bic"]))
    assert np.all(np.isnan(mf.compare([fits[0], mf.fit(record(1), TF2)], record(2))["bic"]))
