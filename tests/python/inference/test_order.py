"""Orders: candidates on one residual space, criteria, cancelling pairs, the rank test."""

import warnings

import modfun as mf
import numpy as np
import pytest
from core_fit import fit, standard_errors
from modfun.results import derived
from modfun.results.diagnosis import high_band_df
from oracle import banded, lines, rank
from sample_records import random_record

SYSTEMS = {
    (2, 0): mf.tf([5], [1, 3, 8]),
    (3, 1): mf.tf([6, 12], np.polymul([1, 1], [1, 1.2, 9])),
}


def record(true, seed, nsr=0.1, noise="white"):
    rec = mf.simulate(SYSTEMS[true], input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0, seed=seed)
    e = np.random.default_rng(seed).normal(size=1257)
    if noise == "ar":
        for k in range(1, e.size):
            e[k] += 0.9 * e[k - 1]
    e = e[1000:] / np.std(e)
    return rec.assign(y=lambda r: r["y"] + nsr * np.sqrt(np.mean(r["y"] ** 2)) * e)


# More transient terms than poles ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "zeros", "terms", "options"),
    [
        (1, 0, 3, {}),
        (2, 1, 4, {"trend": "constant"}),
        (2, 0, 3, {"extended": False}),
        (3, 1, 5, {"trend": "linear"}),
    ],
)
def test_more_transient_terms_are_scipys_fit_with_as_many(order, zeros, terms, options):
    rec, _ = random_record(order, order, zeros, nsr=0.02)
    problem = lines.Problem([rec], order, [zeros], 40, ends=terms, **options)
    edge = 40.3 * 2 * np.pi / (rec.dt * (rec.y.size - 1))
    found = fit(rec, order, [zeros], band=(0.0, edge), transient=terms, **options)
    expected = lines.result(problem, lines.ml(problem, found["theta"]))
    assert found["cost"] == pytest.approx(expected.cost, rel=1e-8)
    assert found["df_resid"] == expected.df
    assert found["theta"] == pytest.approx(expected.theta, rel=1e-5)
    assert standard_errors(found) == pytest.approx(np.sqrt(np.diag(expected.cov)), rel=1e-4)


@pytest.mark.parametrize("extended", [True, False])
def test_more_transient_terms_are_more_differences(extended):
    rec, _ = random_record(5, 2, 1, nsr=0.02)
    problem = banded.Differenced(rec, 2, [1], 11, extended, differences=3)  # lines up to 14
    for method in ("ls", "ml"):
        found = fit(rec, 2, [1], method=method, harmonics=12, transient=3, extended=extended)
        twin = getattr(banded, method)(problem)
        assert found["theta"] == pytest.approx(twin, rel=1e-10 if method == "ls" else 1e-6)


def test_the_default_number_of_terms_is_that_of_the_poles():
    rec, _ = random_record(5, 2, 1)
    one, other = (fit(rec, 2, [1], harmonics=12, **given) for given in ({}, {"transient": 2}))
    assert np.array_equal(one["theta"], other["theta"])
    assert one["cost"] == other["cost"]
    with pytest.raises(mf.SpecError, match="1 transient terms"):
        fit(rec, 2, [1], harmonics=12, transient=1)


def test_the_best_of_several_starts_is_kept_and_starts_must_fit():
    rec, theta = random_record(5, 2, 1)
    options = {"order": 2, "numerators": [1], "delays": [0.0], "intersample": [["smooth"]], "method": "ml"}
    options |= {"noise": "output", "initial_state": "unknown", "states": [], "trend": None, "rule": "gregory"}
    options |= {"extended": True, "band": None}
    options |= {"harmonics": 12, "tol": 1e-9, "maxiter": 50}
    data = [np.ascontiguousarray(rec.y[None])], [np.ascontiguousarray(rec.u)]
    fitter = mf._core.Fitter([rec.y.size], [rec.dt], **options)
    own, led = fitter.fit(*data), fitter.fit(*data, starts=[theta.tolist()])
    assert led["theta"] == pytest.approx(own["theta"], rel=1e-7)
    short = mf._core.Fitter([rec.y.size], [rec.dt], **{**options, "maxiter": 1})
    far, near = short.fit(*data), short.fit(*data, starts=[(3 * theta).tolist(), own["theta"].tolist()])
    assert far["cost"] > (1 + 1e-6) * own["cost"]
    assert near["cost"] == pytest.approx(own["cost"], rel=1e-9)
    with pytest.raises(mf.SpecError, match="3 numbers for 4 parameters"):
        fitter.fit(*data, starts=[[1.0, 2.0, 3.0]])
    free = mf._core.Fitter([rec.y.size], [rec.dt], **{**options, "harmonics": None})
    with pytest.raises(mf.SpecError, match="needs a band"):
        free.fit(*data, starts=[theta.tolist()])


# Selection ----------------------------------------------------------------------------------------


@pytest.mark.statistics
@pytest.mark.parametrize("true", SYSTEMS)
def test_true_orders_are_found(true):
    """About 94 of 100 records; fewer than 32 of 40 happen once in 1,000 seeds."""
    hits = 0
    for seed in range(40):
        best = mf.select_order(record(true, seed), poles=range(1, 5)).best.structure
        hits += (best.poles, best.zeros) == true
    assert hits >= 32


def held(kind, input, nsr, seed, intervals=250):
    """A response from rest to a held or straight input, exact, in white noise; and the noise level."""
    t = np.linspace(0, 10, intervals + 1)
    switched = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], intervals // 10 + 1), 10)[: t.size]
    u = {"step": (t > 1) * 1.0, "switched": switched, "square": np.sign(np.sin(np.pi / 2 * t + 0.1))}[input]
    y = SYSTEMS[3, 1].simulate(u=u, dt=10 / intervals, intersample=kind)
    level = nsr * np.std(y)
    e = np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=y + level * e, u=u, dt=10 / intervals, intersample=kind), level


@pytest.mark.parametrize("kind", ["zoh", "foh"])
@pytest.mark.parametrize("input", ["step", "switched", "square"])
def test_candidates_under_held_inputs_are_the_fits_of_their_structures(kind, input):
    """With the transient terms of four poles three had ten times the noise left, and unstable ones won."""
    rec, level = held(kind, input, 0.0005, 0)
    found = mf.select_order(rec, poles=range(2, 5))
    band = (found.band[0], found.band[1] * (1 + 1e-9))
    true = next(k for k, fit in enumerate(found.fits) if (fit.structure.poles, fit.structure.zeros) == (3, 1))
    alone = mf.fit(rec, found.fits[true].structure, band=band)
    assert found.table["cost"][true] == pytest.approx(alone.cost, rel=1e-5)
    assert found.table["residual"][true] == pytest.approx(level, rel=0.3)  # three standard errors
    assert found.best is found.fits[true]


def test_one_held_record_of_several_counts_alike():
    records = [held("zoh", input, 0.0005, seed)[0] for seed, input in enumerate(("step", "switched"))]
    best = mf.select_order(records, poles=range(2, 5)).best.structure
    assert (best.poles, best.zeros) == (3, 1)


@pytest.mark.statistics
@pytest.mark.parametrize("nsr", [0.0005, 0.005])
def test_true_orders_are_found_under_held_inputs(nsr):
    """About 90 of 100 records: fewer than 5 of 10 happen once in 6,000 seeds. There were 0 and 3 of 20."""
    hits = 0
    for seed in range(10):
        best = mf.select_order(held("zoh", "step", nsr, seed)[0], poles=range(2, 5)).best.structure
        hits += (best.poles, best.zeros) == (3, 1)
    assert hits >= 5


def test_the_table_holds_its_formulas_where_transients_differ():
    """Costs count per equation, of which each transient coefficient takes one."""
    found = mf.select_order(held("zoh", "step", 0.1, 0)[0], poles=range(1, 5))
    table = found.table
    k, all_lines = table["unknowns"], 2 * round(found.band[1] * 10 / (2 * np.pi))
    equations, n = all_lines - table["poles"], all_lines - 4
    mean = table["cost"] / equations
    np.testing.assert_allclose(table["residual"], np.sqrt(mean))
    np.testing.assert_allclose(table["bic"], n * np.log(mean) + k * np.log(n))
    np.testing.assert_allclose(table["calibrated_bic"], n * mean / found.sigma**2 + k * np.log(n))
    assert f"over {n} real equations" in found.notes[0]


def test_the_table_holds_its_formulas():
    found = mf.select_order(record((2, 0), 2), poles=range(1, 5))
    table = found.table
    assert len(table) == 10
    assert table["unknowns"].tolist() == (2 * table["poles"] + table["zeros"] + 1).tolist()
    lines_used = round(found.band[1] * 10 / (2 * np.pi))
    n = 2 * lines_used - 4  # line 0 belongs to the offset
    cost, k = table["cost"], table["unknowns"]
    high = found.fits[-1].high_band_sigma
    np.testing.assert_allclose(table["residual"], np.sqrt(cost / n))
    np.testing.assert_allclose(table["chi2"], cost / high**2)
    np.testing.assert_allclose(table["bic"], n * np.log(cost / n) + k * np.log(n))
    np.testing.assert_allclose(table["calibrated_bic"], cost / found.sigma**2 + k * np.log(n))
    np.testing.assert_allclose(table["aicc"], n * np.log(cost / n) + 2 * (k + 1) * n / (n - k - 2))
    assert found.criterion == "calibrated_bic"
    assert found.best.structure == mf.TransferFunction(poles=2, zeros=0)
    assert found.best.success
    assert min(table["p_value"][1:]) > 1e-6 > table["p_value"][0]
    assert "poles=2" in repr(found)
    assert "<table>" in found._repr_html_()


def test_several_starts_find_lower_minima_than_one():
    better = 0
    for seed in range(5):
        rec = record((3, 1), seed, nsr=0.3)
        found = mf.select_order(rec, poles=range(1, 6))
        table, top = found.table, round(found.band[1] * 10 / (2 * np.pi))
        twin = lines.Record(rec.y[0], rec.u, rec.dt, ("smooth",))
        for n, z, cost in zip(table["poles"], table["zeros"], table["cost"], strict=True):
            options = {"trend": "constant", "transient": 5, "band": (0.0, (top + 0.1) * 2 * np.pi / 10)}
            one = fit(twin, int(n), [int(z)], **options)
            assert one["status"] in ("ok", "maxiter")
            assert cost <= one["cost"] * (1 + 1e-12)
            better += cost < 0.999 * one["cost"]
    assert better > 8  # of 75: one start goes from filters, too, where its way was long


def test_coloured_noise_falls_back_to_bic_and_says_so():
    found = mf.select_order(record((2, 0), 3, noise="ar"), poles=range(1, 4))
    assert found.criterion == "bic"
    assert np.isnan(found.sigma)
    assert any("not white" in note for note in found.notes)


def test_noise_that_changes_is_named_and_even_noise_is_not():
    """Four times the level from 6 s on; of 60 white records 1 gets the note (0.01 each)."""
    named, clean = [], mf.simulate(SYSTEMS[2, 0], input="sin(t**2/5)", duration=10.0, intervals=256)
    for loud in (1.0, 4.0):
        level = np.where(clean.t < 6, 1.0, loud)
        level *= 0.1 * clean["y"].std() / np.sqrt(np.mean(level**2))
        for k in (0, 1, 38):  # of 4, 2 and 4 poles where the noise changes; that of 38 runs away
            e = level * np.random.default_rng(k).standard_normal(257)
            found = mf.select_order(clean.assign(y=clean["y"] + e), poles=range(1, 5))
            named.append((found.best.structure.poles, [n for n in found.notes if "changes over" in n]))
    assert [poles for poles, _ in named] == [2, 2, 2, 4, 2, 4]
    assert [len(notes) for _, notes in named] == [0, 0, 0, 1, 1, 1]
    assert "its level in time varies by a factor of 9.9 (p = 9.6e-10). Orders tend" in named[3][1][0]
    assert "rec.window(start, stop), or by the .bic" in named[3][1][0]
    assert not any("changes over" in n for n in mf.select_order(clean, poles=range(1, 4)).notes)


def test_the_high_bands_degrees_of_freedom_are_those_of_its_spread():
    """400 levels: their variance is known to 7 %, four standard errors are allowed."""
    fit = mf.fit(record((2, 0), 1), mf.TransferFunction(poles=2, zeros=0))
    noise = np.random.default_rng(0).normal(size=(400, 257))
    level = mf._core.noise_level(noise, 2) ** 2
    assert 2 * level.mean() ** 2 / level.var() == pytest.approx(high_band_df(fit), rel=0.28)


def test_several_records_inputs_and_a_delay():
    rng = np.random.default_rng(2)
    plant = mf.tf([[2.0, 6.0], [3.0]], [1.0, 1.2, 9.0], delay=[0.2, 0.0])
    records = []
    for n in (300, 400):
        u = np.cumsum(rng.normal(size=(2, n + 1)), axis=1) * 0.3
        y = np.asarray(plant.simulate(u=list(u), dt=0.05, intersample="foh")).reshape(-1)
        y = y + 0.03 * np.sqrt(np.mean(y**2)) * rng.normal(size=y.size)
        records.append(mf.Record(y=y, u=u, dt=0.05, intersample="foh"))
    found = mf.select_order(
        records, poles=range(1, 4), zeros=[(0, 0), (1, 0), (1, 1)], delay=[0.2, 0.0], trend=None
    )
    assert found.best.structure == mf.TransferFunction(poles=2, zeros=(1, 0), delay=(0.2, 0.0))
    assert found.best.model.delays == (0.2, 0.0)


def test_free_motion_has_no_zeros():
    rec = mf.simulate(
        mf.tf([1], [1, 0.4, 4]), input=np.zeros(257), duration=10, intervals=256, initial_state=[1.0, 0.0]
    )
    y = rec.y + 0.02 * np.random.default_rng(0).normal(size=257)
    found = mf.select_order(mf.Record(y=y, dt=rec.dt), poles=range(1, 4))
    assert found.table["zeros"].tolist() == [None] * 3
    assert found.best.structure.poles == 2


def test_without_noise_the_smallest_that_explains_is_chosen():
    rec = mf.simulate(SYSTEMS[2, 0], input="sin(t**2/5)", duration=10.0, intervals=256)
    found = mf.select_order(rec, poles=range(1, 5))
    assert found.best.structure == mf.TransferFunction(poles=2, zeros=0)
    assert any("quadrature" in note for note in found.notes)


def test_a_long_record_is_compared_on_the_lines_it_needs():
    rec = mf.simulate(SYSTEMS[2, 0], input="sin(t**2/5)", duration=10.0, intervals=2048, nsr=0.1, seed=0)
    found = mf.select_order(rec, poles=range(1, 4))
    assert found.band[1] < 60 * 2 * np.pi / 10 < 256 * 2 * np.pi / 10
    assert found.best.structure.poles == 2


def test_a_given_band_is_the_band_and_nothing_warns():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = mf.select_order(record((2, 0), 0), poles=range(1, 4), band=12.0, method="awls")
    assert found.band[1] == pytest.approx(19 * 2 * np.pi / 10)
    assert found.best.options.method == "awls"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"method": "ls"}, "do not compare"),
        ({"noise": "equation"}, "do not compare"),
        ({"zeros": "all"}, "any"),
        ({"poles": [1], "zeros": [2]}, "no candidate"),
        ({"poles": []}, "no candidate"),
        ({"poles": 2.5}, "poles=2.5"),
        ({"bnad": 3}, "band"),
    ],
)
def test_what_does_not_serve_is_refused(given, text):
    with pytest.raises(mf.SpecError, match=text):
        mf.select_order(record((2, 0), 0), **given)


# Cancelling pairs ---------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_the_distance_of_a_pole_and_a_zero_is_that_of_the_delta_method():
    found = mf.fit(record((3, 1), 0, nsr=0.01), mf.TransferFunction(poles=3, zeros=1))
    cov = found.cov_params("nonrobust")

    def pairs(theta):
        return np.roots([1, *theta[:3]])[:, None] - np.roots(theta[3:])

    at = pairs(found.params)
    slope = np.empty((found.params.size, *at.shape), complex)
    for i, x in enumerate(found.params):
        step = np.zeros(found.params.size)
        step[i] = 1e-6 * abs(x)
        slope[i] = (pairs(found.params + step) - pairs(found.params - step)) / (2 * step[i])
    best = np.inf
    for k in np.ndindex(at.shape):
        g, d = np.array([slope[:, *k].real, slope[:, *k].imag]), np.array([at[k].real, at[k].imag])
        if abs(at[k].imag) < 1e-9:
            g, d = g[:1], d[:1]
        best = min(best, float(np.sqrt(d @ np.linalg.solve(g @ cov @ g.T, d))))
    assert derived.cancelling(found, found.params, cov) == pytest.approx(best, rel=1e-4)


def test_a_path_without_zeros_cancels_nothing():
    found = mf.fit(record((2, 0), 0), mf.TransferFunction(poles=2, zeros=0))
    assert derived.cancelling(found, found.params, found.cov_params()) == np.inf


# Rank test ----------------------------------------------------------------------------------------


def test_the_rank_test_is_its_naive_twin():
    rec, _ = random_record(4, 3, 1, inputs=2, nsr=0.05)
    shown = mf.rank_test(mf.Record(y=rec.y, u=rec.u, dt=rec.dt), poles=4)["singular_value"]
    level = mf._core.noise_level(np.ascontiguousarray(rec.y[None]), 4)[0]
    np.testing.assert_allclose(shown, rank.singular_values(rec, 4, 40, level), rtol=1e-8)


def test_the_rank_test_counts_the_poles_it_can_see():
    """The values of noise lie below 2 in 99 of 100 records each."""
    light = mf.tf([1], [1, 0.2, 4])
    for seed in range(5):
        rec = mf.simulate(light, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=seed)
        values = mf.rank_test(rec)["singular_value"]
        assert values[1] > 4
        assert values[2] < 2


def test_the_rank_test_refuses_what_it_cannot_use():
    rec = record((2, 0), 0)
    with pytest.raises(mf.DataError, match="too few"):
        mf.rank_test(rec, poles=5, band=4.0)
    with pytest.raises(mf.SpecError, match="several lines"):
        mf.rank_test(rec, band=0.5)
    with pytest.raises(mf.DataError, match="uneven"):
        mf.rank_test(mf.Record(y=rec.y, u=rec.u, t=rec.t**1.1))
    with pytest.raises(mf.DataError, match="no noise"):
        mf.rank_test(mf.Record(y=np.r_[0.0, np.zeros(256)], u=rec.u, dt=0.04))


# Plot ---------------------------------------------------------------------------------------------


def test_the_plot_shows_levels_and_criterion():
    pytest.importorskip("matplotlib").use("Agg")
    plt = pytest.importorskip("matplotlib.pyplot")
    found = mf.select_order(record((2, 0), 2), poles=range(1, 4))
    upper, lower = found.plot()
    upper.figure.draw_without_rendering()
    for axes in (upper, lower):
        highest = max(text.get_window_extent().y1 for text in axes.texts)
        assert highest < axes.get_window_extent().y1 - 2  # pixels: labels are clear of the frame
    np.testing.assert_array_equal(upper.get_lines()[0].get_ydata(), found.table["residual"])
    score = found.table["calibrated_bic"]
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), score - score.min())
    assert lower.get_lines()[1].get_xdata() == pytest.approx([2], abs=0.1)
    assert lower.get_lines()[1].get_ydata() == [0]
    one = plt.figure().gca()
    assert mf.plot.order(found, ax=one) is one


@pytest.mark.parametrize(("pole", "stable"), [(0.4, False), (-0.4, True)])
def test_the_table_says_which_candidates_are_stable(pole, stable):
    rec = mf.simulate(
        mf.tf([2], [1, -pole]), input="sign(sin(2*t))", duration=6, intervals=300, nsr=0.02, seed=3
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)  # each unstable candidate says so itself
        found = mf.select_order(rec, poles=range(1, 4))
    assert found.best.order == 1
    assert found.table["stable"][0] == stable
    assert any("unstable: a pole has real part" in note for note in found.notes) != stable


def test_orders_beyond_the_record_are_left_out():
    """They raised an error after all other candidates had been fitted, and the table was lost."""
    system = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=1)
    found = mf.select_order(rec, poles=[1, 2, 22, 29], zeros=[0, 28])
    assert found.best.model.order == 2
    assert max(found.table["poles"]) == 22
    assert (
        "more than 22 poles are left out: 32 lines give 64 real equations for 87 unknowns" in found.notes[-1]
    )
    with pytest.raises(mf.DataError, match="64 real equations"):
        mf.select_order(rec, poles=40)


def test_a_long_search_says_how_far_it_is(capsys):
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10, intervals=256, nsr=0.1, seed=0)
    mf.select_order(rec, poles=[1, 2], progress=True)
    assert "select_order: 0 of 10 (0 %)" in capsys.readouterr().err
    mf.select_order(rec, poles=[1, 2], progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(mf.SpecError, match='progress=3 must be "auto", True or False'):
        mf.select_order(rec, poles=[1, 2], progress=3)
