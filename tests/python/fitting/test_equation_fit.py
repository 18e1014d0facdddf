"""Fits of equations: against the linear path, against dense matrices, and what users can ask of them."""

import re
import subprocess
import sys
import warnings
from itertools import product

import modfun as mf
import numpy as np
import pytest
from oracle import nonlinear, terms

# On a dozen lines the two kinds of standard errors often differ by more than what is warned of.

BANDS = [{"harmonics": 6}, {"harmonics": 20}, {"band": (2.0, 9.0)}, {}]
# Beside a lower edge, `ls` with a drift differences the drift's line 0, the two paths each in its way.
ALIKE = [
    case
    for case in product(["ls", "wls", "awls", "ml"], BANDS, [None, "constant", "linear"])
    if case != ("ls", BANDS[2], "linear")
]

LINEAR = mf.Equation("y'' + a1*y' + a2*y = b0*u")
DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")


def chirp(nsr=0.2, seed=3):
    system = mf.tf([5], [1, 3, 8])
    return mf.simulate(
        system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=seed, initial_state=[1, 0.5]
    )


def duffing(nsr=0.1, seed=5, intervals=1024):
    case = nonlinear.duffing(intervals)
    sigma = nsr * np.sqrt(np.mean(case.v[0] ** 2))
    y = case.v[0] + sigma * np.random.default_rng(seed).standard_normal(case.t.size)
    return mf.Record(y=y, u=case.u(case.t), dt=case.t[1]), case, sigma


@pytest.mark.parametrize(("method", "band", "trend"), ALIKE)
def test_a_linear_equation_is_the_transfer_function(method, band, trend):
    rec = chirp()
    options = {"method": method, "trend": trend, "tol": 1e-11, **band}
    plain = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), **options)
    written = mf.fit(rec, LINEAR, **options)
    assert written.lines == plain.lines
    assert written.df_resid == plain.df_resid
    assert written.params == pytest.approx(plain.params, rel=1e-9)
    if method in ("awls", "ml"):
        assert written.cov_nonrobust == pytest.approx(plain.cov_nonrobust, rel=1e-8)
        assert written.cov_hc3 == pytest.approx(plain.cov_hc3, rel=1e-7)
        assert written.cost == pytest.approx(plain.cost, rel=1e-9)


@pytest.mark.parametrize("intersample", ["zoh", "foh"])
def test_held_inputs_have_exact_coefficients(intersample):
    u = np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], 32), 8)
    u = np.append(u, u[-1])
    y = mf.tf([5], [1, 3, 8]).simulate(u=u, dt=10 / 256, intersample=intersample)
    rec = mf.Record(y=y, u=u, dt=10 / 256, intersample=intersample)
    plain = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), trend=None, harmonics=8)
    # But for what sampling folds into the output, which transfer functions take out: 5e-6 of it.
    assert mf.fit(rec, LINEAR, harmonics=8).params == pytest.approx(plain.params, rel=2e-5)


def test_coefficients_that_are_nonlinear_find_the_same_minimum():
    rec = chirp()
    plain = mf.fit(rec, LINEAR, harmonics=12, tol=1e-12)
    shaped = mf.Equation("y'' + 2*z*w*y' + w**2*y = k*w**2*u", params={"w": mf.Free(min=0)})
    found = mf.fit(rec, shaped, harmonics=12, tol=1e-12)
    w = np.sqrt(plain["a2"])
    want = [plain["a1"] / (2 * w), w, plain["b0"] / w**2]
    assert found.params == pytest.approx(want, rel=1e-8)
    assert found.cost == pytest.approx(plain.cost, rel=1e-10)
    error = plain.derived(w="sqrt(a2)")["bse"][0]
    assert found.bse[found.param_names.index("w")] == pytest.approx(error, rel=1e-6)


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
@pytest.mark.parametrize("nsr", [0.05, 0.3])
def test_duffing_is_what_dense_matrices_give(method, nsr):
    """The oracle weighs end samples as the rule does, the core evenly: 1e-3 of a standard error."""
    rec, case, sigma = duffing(nsr, intervals=512)
    fit = mf.fit(rec, DUFFING, method=method, harmonics=11, noise=mf.Noise(y=sigma), tol=1e-12)
    problem = terms.Problem(case.terms, rec.y, rec.dt, sigma, 13)
    found = {"ls": terms.ls, "wls": terms.wls, "awls": terms.awls, "ml": terms.ml}[method](
        problem, terms.wls(problem, [0.0, 1.0, 0.0])
    )
    if method == "ml":  # once more, with slopes where the noise is taken away
        whiten, _, residual = problem.at_theta(found, found)
        at = problem.v - problem.noise(found, whiten, residual)
        problem = terms.Problem(case.terms, rec.y, rec.dt, sigma, 13, at=at)
        found = terms.ml(problem, found)
    assert fit.params == pytest.approx(
        found, abs=0.02 * np.min(fit.bse), rel=1e-9 if method in ("ls", "wls") else 0
    )
    if method == "ml":
        oracle = terms.fit(problem, "ml", found)
        assert fit.cov_nonrobust == pytest.approx(oracle.cov, rel=0.02)
        assert fit.cov_hc3 == pytest.approx(oracle.cov_hc3, rel=0.02)


def test_stacked_state_equations_are_what_dense_matrices_give():
    case = nonlinear.short_period(600)
    sigma = 0.1 * np.sqrt(np.mean(case.v**2, axis=1))
    v = case.v + sigma[:, None] * np.random.default_rng(8).standard_normal(case.v.shape)
    rec = mf.Record(y=v, u=case.u(case.t), dt=case.t[1], outputs=["alpha", "q"], inputs=["de"])
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], C=np.eye(2), states=["alpha", "q"], inputs=["de"]
    )
    fit = mf.fit(rec, model, trend=None, harmonics=13, noise=mf.Noise(y=sigma), tol=1e-12)
    problem = terms.Problem(case.terms, v, rec.dt, sigma, 14)
    oracle = terms.fit(problem, "ml", terms.wls(problem, [-1.0] * 5))
    order = [fit.param_names.index(name) for name in ("Za", "Zd", "Ma", "Mq", "Md")]
    assert fit.params[order] == pytest.approx(oracle.theta, abs=0.02 * np.min(fit.bse))
    assert np.sqrt(np.diag(fit.cov_nonrobust))[order] == pytest.approx(np.sqrt(np.diag(oracle.cov)), rel=0.01)


@pytest.mark.parametrize("rho", [0.0, -0.7])
def test_learnt_noise_is_that_of_restricted_likelihood(rho):
    """There noise has of the weighted sum of squares what it has of the rows, each output with each."""
    case = nonlinear.short_period(600)
    rng = np.random.default_rng(9)
    slow = [
        np.convolve(rng.standard_normal(800), np.hanning(101), "valid")[: case.t.size] / 6 for _ in range(2)
    ]
    slow[1] = rho * slow[0] + np.sqrt(1 - rho**2) * slow[1]
    size = np.sqrt(np.mean(case.v**2, axis=1))[:, None]
    v = case.v + size * (np.array([[0.02], [0.2]]) * slow + 1e-4 * rng.standard_normal(case.v.shape))
    rec = mf.Record(y=v, u=case.u(case.t), dt=case.t[1], outputs=["alpha", "q"], inputs=["de"])
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], C=np.eye(2), states=["alpha", "q"], inputs=["de"]
    )
    fit = mf.fit(rec, model, trend=None, harmonics=13, tol=1e-12)
    assert fit.seen[0] == pytest.approx(1e-4 * size[:, 0], rel=0.2)
    correlation = correlation_of(fit)
    assert correlation[0, 1] == pytest.approx(rho, abs=0.35)
    problem = terms.Problem(case.terms, v, rec.dt, fit.levels[0], 14, correlation=correlation)
    theta = fit.params[[fit.param_names.index(name) for name in ("Za", "Zd", "Ma", "Mq", "Md")]]
    whiten, _, residual = problem.at_theta(theta, theta)
    inverse = whiten.T @ whiten
    lines = problem.sensitivity(theta)
    for i, j in ((0, 0), (1, 1), (0, 1)):
        scale = fit.levels[0, i] * fit.levels[0, j]
        squares = scale * (lines[i].T @ inverse @ residual) @ (lines[j].T @ inverse @ residual)
        rows = scale * np.trace(inverse @ lines[i] @ lines[j].T) * fit.df_resid / residual.size
        level = scale * np.sqrt(np.prod([np.trace(inverse @ lines[k] @ lines[k].T) for k in (i, j)]))
        assert squares == pytest.approx(rows, abs=0.005 * level)


def correlation_of(fit):
    level = np.sqrt(np.diag(fit.noise_cov))
    return fit.noise_cov / np.outer(level, level)


@pytest.mark.parametrize("case", ["short period", "predator and prey"])
def test_correlated_noise_is_seen_and_weighed_as_dense_matrices_do(case):
    """Noise of two outputs correlated by 0.8; of the product x z it adds its covariance."""
    names = {"short period": ("Za", "Zd", "Ma", "Mq", "Md"), "predator and prey": ("a", "b", "c", "d")}[case]
    if case == "short period":
        own = nonlinear.short_period(600)
        model = mf.StateSpace(
            [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], C=np.eye(2), states=["alpha", "q"], inputs=["de"]
        )
        given = {"u": own.u(own.t), "outputs": ["alpha", "q"], "inputs": ["de"]}
    else:
        own = nonlinear.predator_and_prey(600)
        model = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x", "z"])
        given = {"outputs": ["x", "z"]}
    sigma = 0.1 * np.std(own.v, axis=1)
    noise = np.linalg.cholesky([[1, 0.8], [0.8, 1]]) @ np.random.default_rng(8).standard_normal(own.v.shape)
    v = own.v + sigma[:, None] * noise
    rec = mf.Record(y=v, dt=own.t[1], **given)
    fit = mf.fit(rec, model, trend=None, harmonics=13, tol=1e-12)
    np.testing.assert_array_equal(fit.levels, fit.seen)
    # Some 60 independent lines: four standard deviations of a correlation of 0.8.
    assert correlation_of(fit)[0, 1] == pytest.approx(0.8, abs=0.2)
    problem = terms.Problem(own.terms, v, rec.dt, fit.levels[0], 14, correlation=correlation_of(fit))
    theta = terms.ml(problem, terms.wls(problem, own.true))
    if case == "predator and prey":  # slopes are taken once more where the noise is taken away
        whiten, _, residual = problem.at_theta(theta, theta)
        clean = v - problem.noise(theta, whiten, residual)
        problem = terms.Problem(
            own.terms, v, rec.dt, fit.levels[0], 14, correlation=correlation_of(fit), at=clean
        )
        theta = terms.ml(problem, theta)
    order = [fit.param_names.index(name) for name in names]
    assert fit.params[order] == pytest.approx(theta, abs=0.02 * np.min(fit.bse))
    alike = mf.fit(rec, model, trend=None, harmonics=13, noise=mf.Noise(y=fit.levels[0]))
    assert np.prod(fit.bse) < 0.6 * np.prod(alike.bse)


def test_a_batch_is_its_single_fits_whatever_the_threads():
    rec, case, sigma = duffing()
    rng = np.random.default_rng(11)
    ys = case.v[0] + sigma * rng.standard_normal((40, case.t.size))
    batch = mf.Batch(y=ys[:, None], u=rec.u, dt=rec.dt)
    one, two = (mf.fit_many(batch, DUFFING, threads=k, harmonics=11) for k in (1, 2))
    assert np.array_equal(one.params, two.params)
    assert np.array_equal(one.bse, two.bse)
    for k in (0, 17, 39):
        single = mf.fit(mf.Record(y=ys[k], u=rec.u, dt=rec.dt), DUFFING, harmonics=11)
        assert single.params == pytest.approx(one.params[k], rel=1e-10)
        assert single.bse == pytest.approx(one.bse[k], rel=1e-10)


def test_a_sample_that_is_not_finite_fails_its_replicate_alone():
    rec, _, _ = duffing()
    ys = np.repeat(rec.y[None], 3, axis=0)
    ys[1, 0, 100] = np.nan
    many = mf.fit_many(mf.Batch(y=ys, u=rec.u, dt=rec.dt), DUFFING, harmonics=11)
    assert many.status.tolist() == ["ok", "nonfinite", "ok"]
    assert np.all(np.isnan(many.params[1]))
    assert np.array_equal(many.params[0], many.params[2])


@pytest.mark.statistics
def test_duffing_without_bias_and_with_honest_intervals():
    """400 records at NSR .3; bounds at four Monte Carlo errors, false alarm below 1e-3 in all."""
    rec, case, sigma = duffing(0.3)
    rng = np.random.default_rng(12)
    ys = case.v[0] + sigma * rng.standard_normal((400, case.t.size))
    batch = mf.Batch(y=ys[:, None], u=rec.u, dt=rec.dt)
    raw = mf.fit_many(batch, DUFFING, harmonics=11, correct=False)
    fits = mf.fit_many(batch, DUFFING, harmonics=11)
    error = fits.params.std(axis=0, ddof=1) / np.sqrt(len(ys))
    assert np.all(np.abs(fits.params.mean(axis=0) - case.true) < 4 * error + 0.005 * case.true)
    assert np.max(np.abs(raw.params.mean(axis=0) / case.true - 1)) > 0.08  # what the correction is for
    covered = np.abs(fits.params - case.true) < 2.0 * fits.bse
    assert np.all(np.abs(covered.mean(axis=0) - 0.955) < 4 * np.sqrt(0.05 * 0.95 / 400))


def test_several_records_are_one_problem():
    rec, case, _ = duffing()
    pieces = [rec.window(0, 8), rec.window(8, 20)]
    both = mf.fit(pieces, DUFFING, band=4.0)
    alone = [mf.fit(piece, DUFFING, band=4.0) for piece in pieces]
    errors = [np.sqrt(np.diag(f.cov_nonrobust)) for f in (both, *alone)]
    assert np.all(errors[0] < np.min(errors[1:], axis=0) * 1.2)
    assert np.all(np.abs(both.params - case.true) < 4 * both.bse)


def test_bounds_and_held_parameters():
    rec, _, _ = duffing(0.02)
    bounded = mf.Equation("y'' + d*y' + a*y + b*y**3 = u", params={"d": mf.Free(min=0.4)})
    with pytest.warns(mf.ModfunWarning, match="d ended on a bound: .* Widen it, or hold it there"):
        fit = mf.fit(rec, bounded, harmonics=11)
    assert fit["d"] == 0.4
    assert fit.at_bound == ("d",)
    assert np.isnan(fit.bse[0])
    held = mf.Equation("y'' + d*y' + a*y + b*y**3 = u", params={"d": 0.4})
    with pytest.warns(mf.ModfunWarning, match="times y' on the right of .*, where the model has -0.4"):
        assert mf.fit(rec, held, harmonics=11).params == pytest.approx(fit.params[1:], rel=1e-9)


@pytest.mark.parametrize("offset", [0.05, 0.3, 20.0])
def test_an_offset_without_a_constant_is_seen(offset):
    """Of the output, in its rms; the cure that is named is one. False alarm without: 1e-4 a record."""

    def told(rec, model, **options):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            fit = mf.fit(rec, model, harmonics=11, **options)
        assert ("no constant" in str(fit.check())) == any("no constant" in str(one.message) for one in said)
        cures = [str(one.message) for one in said if "no constant" in str(one.message)]
        # Where y does not enter linearly, a constant in the equation is no offset of y.
        cure = r"with it\.$" if model is LINEAR else r"Write \(y - c\) for y .* c = 0\.\d+, and BIC falls"
        assert all(re.search(cure, text) for text in cures)
        return fit, bool(cures)

    swing, drive = duffing(0.05)[0], chirp(nsr=0.05)
    # So far from its equilibrium a hardening spring is another system.
    for rec, model in ((drive, LINEAR), *([(swing, DUFFING)] if offset < 1 else [])):
        moved = rec.assign(y=rec["y"] + offset * rec["y"].std())
        assert not told(rec, model)[1]
        assert told(moved, model)[1]
        cured, again = told(moved, model, trend="constant")
        assert not again
        if model is LINEAR:
            wanted = told(rec, model, trend="constant")[0]
            assert cured.params == pytest.approx(wanted.params, abs=0.01 * np.min(wanted.bse))


def test_signals_that_depend_on_a_parameter():
    t = np.linspace(0, 20, 1025)
    model = mf.Equation("y' + a*tanh(y/s) = u", params={"s": mf.Free(1.0, min=0.05, max=5.0)})
    numbers = model.model({"a": 2.0, "s": 0.5})
    u = 2.5 * np.sin(0.8 * t) + np.sin(2.1 * t)
    y = np.ravel(numbers.simulate(u=u, dt=t[1], initial_state=[0.2]))
    clean = mf.fit(mf.Record(y=y, u=u, dt=t[1]), model, harmonics=14)
    assert [clean["a"], clean["s"]] == pytest.approx([2.0, 0.5], rel=1e-5)
    noisy = y + 0.02 * np.random.default_rng(3).standard_normal(y.size)
    fit = mf.fit(mf.Record(y=noisy, u=u, dt=t[1]), model, harmonics=14)
    assert np.all(np.abs([fit["a"] - 2.0, fit["s"] - 0.5]) < 4 * fit.bse)


def test_products_without_exact_form():
    """Property 2: y times Duffing's equation, where y y'' and y y' need no derivative of noise."""
    rec, case, _ = duffing(0.01)
    product = mf.Equation("y*y'' + d*y*y' + a*y**2 + b*y**4 = y*u")
    fit = mf.fit(rec, product, harmonics=11)
    assert np.all(np.abs(fit.params - case.true) < 5 * fit.bse)
    assert fit.params == pytest.approx(case.true, rel=0.05)


def test_noise_on_the_input():
    rec, case, _ = duffing(0.1)
    noisy = rec.u + 0.2 * np.random.default_rng(4).standard_normal(rec.u.shape)
    fit = mf.fit(mf.Record(y=rec.y, u=noisy, dt=rec.dt), DUFFING, noise="errors-in-variables", harmonics=11)
    assert np.all(np.abs(fit.params - case.true) < 4 * fit.bse)
    assert fit.levels[0, 1] == pytest.approx(0.2, rel=0.15)


def test_log_normal_noise():
    model = mf.Equation("y' = r*y - r*y**2/K")
    t = np.linspace(0, 10, 513)
    true = 2.0 / (1 + 19 * np.exp(-1.2 * t))
    rng = np.random.default_rng(6)
    ys = true * np.exp(0.05 * rng.standard_normal((200, t.size)))
    many = mf.fit_many(
        mf.Batch(y=ys[:, None], dt=t[1]), mf.Equation("(log(y))' = r - r*y/K"), noise="log-normal"
    )
    error = many.params.std(axis=0) / np.sqrt(200)
    assert np.all(np.abs(many.params.mean(axis=0) - [1.2, 2.0]) < 4 * error)
    with pytest.raises(mf.DataError, match="logarithm of 'y', which is not positive at sample 7"):
        mf.fit(mf.Record(y=np.where(np.arange(513) == 7, -1.0, ys[0]), dt=t[1]), model, noise="log-normal")


def test_masked_and_weighted_samples():
    rec, case, sigma = duffing(0.1)
    y = rec.y.copy()
    mask = np.ones(y.shape[1], bool)
    mask[[50, 51, 400, 700]] = False
    y[0, ~mask] += 30.0
    spoiled = mf.fit(mf.Record(y=y, u=rec.u, dt=rec.dt), DUFFING, harmonics=11, noise=mf.Noise(y=sigma))
    fit = mf.fit(
        mf.Record(y=y, u=rec.u, dt=rec.dt, mask=mask), DUFFING, harmonics=11, noise=mf.Noise(y=sigma)
    )
    assert np.max(np.abs(spoiled.params - case.true)) > 0.1
    assert np.all(np.abs(fit.params - case.true) < 4 * fit.bse)


def test_delays_known_and_free():
    dt, steps, lag = 0.02, 1000, 25
    t = np.arange(steps + 1) * dt
    u = np.sin(0.8 * t) + 0.5 * np.sin(2.1 * t + 1)
    model = mf.Equation("y' + a*y + c*y(t - h) = u", params={"h": lag * dt})
    y = np.ravel(model.model({"a": 1.0, "c": 0.8}).simulate(u=u, dt=dt, initial_state=[0.3]))
    rec = mf.Record(y=y + 0.005 * np.random.default_rng(1).standard_normal(y.size), u=u, dt=dt)
    known = mf.fit(rec, model)
    assert np.all(np.abs(known.params - [1.0, 0.8]) < 4 * known.bse)
    free = mf.Equation("y' + a*y + c*y(t - h) = u", params={"h": mf.Free(0.3, min=0.05, max=1.0)})
    fit = mf.fit(rec, free)
    assert np.all(np.abs(np.array([fit["a"], fit["c"], fit["h"]]) - [1.0, 0.8, 0.5]) < 4 * fit.bse)
    assert fit.bse[fit.param_names.index("h")] < 0.05


def test_a_fit_is_kept_in_a_file(tmp_path):
    rec, _, _ = duffing()
    fit = mf.fit(rec, DUFFING)
    fit.save(tmp_path / "fit.json")
    back = mf.load(tmp_path / "fit.json")
    assert np.array_equal(back.params, fit.params)
    assert np.array_equal(back.conf_int(), fit.conf_int())
    assert back.structure == DUFFING
    assert back.score(rec)["r2"][0] == pytest.approx(fit.score()["r2"][0], rel=1e-12)


def test_a_fit_says_what_it_is():
    rec, _, _ = duffing()
    fit = mf.fit(rec, DUFFING)
    text = str(fit.summary())
    for part in (
        "Equation(",
        "chosen as the narrowest",
        "spectral; Student's t with",
        "Checks: nothing wrong",
    ):
        assert part in text
    assert fit.chi2 / fit.df_resid == pytest.approx(1.0, abs=0.6)
    with pytest.raises(mf.SpecError, match="an Equation, linear or not, is not asked for its poles"):
        fit.damp()
    with pytest.raises(mf.SpecError, match="not asked for its frequency response"):
        fit.plot_bode()


def test_a_linear_state_space_has_poles():
    case = nonlinear.short_period(600)
    rec = mf.Record(y=case.v, u=case.u(case.t), dt=case.t[1], outputs=["alpha", "q"], inputs=["de"])
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], C=np.eye(2), states=["alpha", "q"], inputs=["de"]
    )
    fit = mf.fit(rec, model)
    pole = np.roots([1, 2.0, 0.8 * 1.2 + 4.0])
    assert fit.damp()["omega"][0] == pytest.approx(np.abs(pole[0]), rel=1e-4)
    response, gradient = fit.frequency_response([1.0, 2.0])
    assert response.shape == (2, 1, 2)
    assert gradient.shape == (5, 2, 1, 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": "coloured"}, "hold for noise of any colour"),
        ({"output_weights": [1.0]}, r"give noise=mf.Noise"),
        ({"extended": False}, "equations use all indices"),
        ({"noise": mf.Noise(y=[0.1, 0.2])}, r"one or one per channel \(1\)"),
        ({"correct": 1}, "must be True"),
        ({"band": 1e6}, "lower the edge"),
        ({"band": (0.3, 0.7)}, "real equations for"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(options, message):
    rec, _, _ = duffing()
    with pytest.raises(mf.ModfunError, match=message):
        mf.fit(rec, DUFFING, **options)


def test_a_transfer_function_has_no_logarithm():
    with pytest.raises(mf.SpecError, match='noise="log-normal" is for equations'):
        mf.fit(chirp(), mf.TransferFunction(poles=2, zeros=0), noise="log-normal")


def test_a_constant_that_nothing_shows_is_of_no_rank():
    rec, _, _ = duffing()
    with pytest.warns(mf.ModfunWarning, match="cannot tell the parameters apart"):
        fit = mf.fit(rec, mf.Equation("y'' + d*y' + a*y + b*y**3 + c = u"), trend="constant")
    assert fit.status == "rank"


def test_free_fall():
    """On line 0 the noise has no say: y'' + G = 0 leaves it without variance."""
    t = np.linspace(0, 15, 751)
    y = 0.5 + 0.3 * t - 0.5 * 9.8 * t**2 + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    fit = mf.fit(mf.Record(y=y, dt=t[1]), mf.Equation("y'' = -G"))
    assert fit["G"] == pytest.approx(9.8, abs=4 * fit.bse[0])
    assert 0 < fit.bse[0] < 1e-3


def test_nothing_to_estimate_is_a_fit():
    rec, _, _ = duffing()
    model = mf.Equation("y'' + 0.3*y' + y + 0.5*y**3 = u")
    fit = mf.fit(rec, model, harmonics=11)
    assert fit.params.size == 0
    assert "Checks" in str(fit.summary())


def test_wide_bands_given_start_from_a_narrow_one():
    """Unweighted rows of 104 lines at NSR .3 are ruled by noise; five standard errors, all of 20 records."""
    _, case, _ = duffing()
    sigma = 0.3 * np.sqrt(np.mean(case.v[0] ** 2))
    ys = case.v[0] + sigma * np.random.default_rng(13).standard_normal((20, case.t.size))
    many = mf.fit_many(mf.Batch(y=ys[:, None], u=case.u(case.t), dt=case.t[1]), DUFFING, harmonics=102)
    assert np.all(many.success)
    assert np.all(np.abs(many.params - case.true) < 5 * many.bse)


def test_uneven_samples_show_their_noise_level():
    """The estimates are those with the given level within a tenth of their errors."""
    _, case, sigma = duffing()
    t = case.t + 0.3 * case.t[1] * np.sin(np.arange(case.t.size))
    t[0], t[-1] = case.t[0], case.t[-1]
    y = np.interp(t, case.t, case.v[0]) + sigma * np.random.default_rng(2).standard_normal(t.size)
    uneven = mf.Record(y=y, u=case.u(t), t=t)
    given = mf.fit(uneven, DUFFING, harmonics=11, noise=mf.Noise(y=sigma))
    fit = mf.fit(uneven, DUFFING, harmonics=11)
    assert np.all(np.abs(given.params - case.true) < 4 * given.bse)
    assert np.all(np.abs(fit.params - given.params) < 0.1 * given.bse)
    assert fit.bse == pytest.approx(given.bse, rel=0.05)


def test_parameters_that_no_record_tells_apart():
    rec, _, _ = duffing()
    twice = mf.Equation("y'' + d*y' + (a + c)*y + b*y**3 = u")
    with pytest.warns(mf.ModfunWarning, match="a and c: adding s to a"):
        fit = mf.fit(rec, twice, harmonics=11)
    assert fit.status == "rank"
    assert np.all(np.isnan(fit.bse))


@pytest.mark.process
def test_without_sympy_the_cure_is_told():
    look = """
import sys
sys.modules["sympy"] = None
import modfun as mf
rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64)
try:
    mf.fit(rec, mf.Equation("y'' + a*y' + b*y = c*u"))
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout == "Equation needs sympy: pip install 'modfun[symbolic]'\n"


@pytest.mark.filterwarnings("ignore:fit. Part of the response is missing")  # two of the models are others
@pytest.mark.filterwarnings("ignore:fit. With T = .* the equations are the same")  # as it should
def test_another_set_of_parameters_with_the_same_equation_is_named():
    """T y'' + (1 + T b) y' + b y is the same for T and 1/b exchanged."""

    def lags(**free):
        return mf.StateSpace([["-1/T", 1], [0, "-b"]], [0, "k"], [1, 0], params={"k": 2.0, **free})

    model = lags()
    true = model.model({"T": 0.5, "b": 3.0})
    rec = mf.simulate(true, input="sin(t**2/5)", duration=10.0, intervals=512, nsr=0.05, seed=1)
    fit = mf.fit(rec, model)
    t, b = fit.params
    (text,) = [own for own in fit.check() if "are the same" in own]
    assert text.startswith(f"With T = {1 / b:.4g}, b = {1 / t:.4g} the equations are the same")
    between = (t + 1 / b) / 2
    bounds = {"min": between} if 1 / b > t else {"min": 0.0, "max": between}
    other = mf.fit(rec, lags(T=mf.Free(1 / b, **bounds)), band=fit.band)
    assert other.params == pytest.approx([1 / b, 1 / t], rel=1e-5)
    assert other.cost == pytest.approx(fit.cost, rel=1e-8)
    # Bounds leave one; a sign alone is no other set, nor is there one of what is linear or not to be found.
    assert not any("are the same" in own for own in other.check())
    for text in ("x1'' + d*x1' + w**2*x1 = 2*u", "x1'' + d*x1' + k*x1 = 2*u"):
        plain = mf.fit(rec, mf.Equation(text, outputs=["x1"]))
        assert not any("are the same" in own for own in plain.check())


@pytest.mark.filterwarnings("ignore:fit. Input .* is in the record and not in the model")
@pytest.mark.filterwarnings("ignore:fit. The equations have no input")
@pytest.mark.parametrize(("channel", "name", "refused"), [
    ("u", "U", True), ("elev", "elve", True), ("elev", "eleva", True), ("alpha", "alpha0", False),
    ("beta", "zeta", False), ("u", "c", False),
])  # fmt: skip
def test_a_misspelt_channel_is_no_parameter(channel, name, refused):
    made = chirp()
    rec = mf.Record(y=made.y, u=made.u, dt=made.dt, inputs=channel)
    equation = f"y'' + a1*y' + a2*y = {name}"
    if not refused:
        assert name in mf.fit(rec, mf.Equation(equation)).param_names
        return
    with pytest.raises(mf.SpecError, match=f"did you mean '{channel}' for '{name}'"):
        mf.fit(rec, mf.Equation(equation))
    with pytest.raises(mf.SpecError, match=f"did you mean '{channel}' for '{name}'"):
        mf.fit_many([rec, rec], mf.Equation(equation))
    assert name in mf.fit(rec.select(inputs=[]), mf.Equation(equation)).param_names


def test_an_input_that_is_not_listed_is_no_parameter():
    made = chirp()
    rec = mf.Record(y=made.y, u=made.u, dt=made.dt, inputs="de")
    with pytest.raises(mf.SpecError, match=r"'de' is a channel .* list it, inputs=\['de'\]"):
        mf.fit(rec, mf.Equation("y'' + a1*y' + a2*y = b0*de"))
