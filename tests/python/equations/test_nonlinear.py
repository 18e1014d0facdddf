"""Equations with numbers: simulated against closed forms, fitted initial states, studies, bounds."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import modfun as mf
import numpy as np
import pytest
from modfun.equations.nonlinear import model_of
from modfun.equations.symbolic.compiled import Compiled, jet
from modfun.results.initial_state import find_state
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.special import ellipj, ellipk

DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
NUMBERS = {"d": 0.3, "a": 1.0, "b": 0.5}
TONES = "2*sin(1.1*t) + 1.5*sin(2.3*t + 1) + sin(0.45*t)"
T = np.arange(401) * 0.05


def model(text, params=(), **words):
    return mf.Equation(text, **words).model(dict(params))


# Against closed forms -----------------------------------------------------------------------------


def test_duffing_follows_the_jacobi_elliptic_cosine():
    a, b, peak = 1.0, 0.5, 1.3
    omega = np.sqrt(a + b * peak**2)
    m = b * peak**2 / (2 * omega**2)
    y = model("y'' + a*y + b*y**3 = 0", {"a": a, "b": b}).simulate(t=T, initial_state=[peak, 0.0])
    assert np.abs(y - peak * ellipj(omega * T, m)[1]).max() < 1e-7


def test_a_pendulum_follows_its_elliptic_solution_up_to_150_degrees():
    top, k = np.deg2rad(150), 9.81
    m = np.sin(top / 2) ** 2
    exact = 2 * np.arcsin(np.sin(top / 2) * ellipj(ellipk(m) - np.sqrt(k) * T, m)[0])
    q = model("q'' + k*sin(q) = 0", {"k": k}, outputs=["q"]).simulate(t=T, initial_state=[top, 0.0])
    assert np.abs(q - exact).max() < 1e-6


def test_logistic_growth_follows_its_closed_form_at_uneven_instants():
    t = np.sort(np.random.default_rng(0).uniform(0, 12, 200))
    y = model("y' = r*y*(1 - y/K)", {"r": 0.9, "K": 6.0}).simulate(t=t, initial_state=[0.2])
    exact = 6 / (1 + 29 * np.exp(-0.9 * (t - t[0])))
    assert np.abs(y - exact).max() < 1e-8


def test_lotka_volterra_keeps_its_constant_of_motion():
    species = model(
        ["x' = a*x - b*x*z", "z' = d*x*z - c*z"], {"a": 1, "b": 0.5, "c": 0.8, "d": 0.3}, outputs=["x", "z"]
    )
    x, z = species.simulate(t=T, initial_state=[2.0, 0.7])
    constant = 0.3 * x - 0.8 * np.log(x) + 0.5 * z - np.log(z)
    assert np.ptp(constant) < 1e-7


@pytest.mark.parametrize("kind", ["smooth", "zoh", "foh"])
@pytest.mark.parametrize(
    "given", ["sin(t**2/5)", np.sin(np.arange(257) ** 2 * (10 / 256) ** 2 / 5)], ids=type
)
def test_a_linear_equation_with_derivatives_of_the_input_is_the_transfer_function(kind, given):
    """Held inputs have no derivatives: the states take them in, as those of a transfer function do."""
    system = mf.tf([2, 1, 3], [1, 0.5, 2, 1])
    same = model("y''' + a*y'' + b*y' + c*y = 2*u'' + u' + 3*u", {"a": 0.5, "b": 2.0, "c": 1.0})
    words = {
        "u": given,
        "dt": 10 / 256,
        "intervals": 256,
        "initial_state": [1.0, 0.3, -0.2],
        "intersample": kind,
    }
    assert np.abs(same.simulate(**words) - system.simulate(**words)).max() < 1e-11


def test_a_static_feedthrough_sees_the_last_sample_of_a_held_input():
    u = np.array([1.0, 2.0, -1.0, 3.0])
    both = model(["v' + v = u", "y = v + 2*u"], outputs=["v", "y"]).simulate(u=u, dt=0.5, intersample="zoh")
    assert np.allclose(both[1] - both[0], 2 * u, atol=1e-12)


def test_a_delayed_state_is_the_method_of_steps():
    y = model("y' + a*y(t - 1) = 0", {"a": 1.0}).simulate(dt=0.05, intervals=60, initial_state=[1.0])
    t = np.arange(61) * 0.05
    steps = [1 - t, (t > 1) * (t - 1) ** 2 / 2, (t > 2) * (2 - t) ** 3 / 6]
    assert np.abs(y - sum(steps)).max() < 1e-9


def test_a_delayed_input_is_a_shifted_one():
    late = model("y' + y = u(t - 0.25)")
    u = np.random.default_rng(0).normal(size=101)
    y = late.simulate(u=u, dt=0.1, intersample="zoh")
    assert np.abs(y - mf.tf([1], [1, 1], delay=0.25).simulate(u=u, dt=0.1, intersample="zoh")).max() < 1e-10


def test_a_delay_between_samples_keeps_the_accuracy_of_any_input():
    """The spline of the samples, shifted, integrated from knot to knot: 1e-11 is twenty times its errors."""
    step, late, u = 0.1, 0.037, np.random.default_rng(1).normal(size=21)
    t = step * np.arange(u.size)
    spline, knots = CubicSpline(t, u), np.unique(np.concatenate([t, t[:-1] + late]))
    x, reached = np.zeros(2), {0.0: 0.0}
    for a, b in pairwise(knots):

        def slopes(s, x, middle=(a + b) / 2):
            drive = spline(s - late) if middle > late else 0.0
            return [x[1], 3 * drive - 0.8 * x[1] - 4 * x[0]]

        x = solve_ivp(slopes, (a, b), x, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        reached[b] = x[0]
    y = model(f"y'' + 0.8*y' + 4*y = 3*u(t - {late})").simulate(u=u, dt=step)
    assert np.abs(y - [reached[s] for s in t]).max() < 1e-11


def test_a_stiff_oscillator_goes_on():
    """Van der Pol with mu = 300: period mu (3 - 2 log 2) + 7.014 mu**(-1/3) - ..., Dorodnicyn."""
    t = np.arange(751.0)
    y = model("y'' - mu*(1 - y**2)*y' + y = 0", {"mu": 300.0}).simulate(t=t, initial_state=[2.0, 0.0])
    falls = t[1:][(y[1:] < 0) & (y[:-1] >= 0)]
    period = 300 * (3 - 2 * np.log(2)) + 7.014 * 300 ** (-1 / 3) - np.log(300) / 450 - 1.3246 / 300
    assert abs(np.diff(falls)[0] - period) <= 1.0  # to a sample


@pytest.mark.parametrize("step", [0.5, 4.0], ids=["core", "scipy"])
def test_the_error_falls_with_the_tolerance(step):
    """Over 4 s the tones are no polynomial, and SciPy integrates."""
    m, t = DUFFING.model(NUMBERS), np.arange(0.0, 20.1, step)
    exact = m.simulate(u=TONES, t=t, initial_state=[0.5, 0.0], rtol=1e-12)
    errors = []
    for rtol in (1e-9, 1e-7, 1e-5):
        errors.append(np.abs(m.simulate(u=TONES, t=t, initial_state=[0.5, 0.0], rtol=rtol) - exact).max())
    assert errors[0] < 1e-7
    assert errors[0] < errors[1] < errors[2] < 1e-2


def test_a_jump_within_an_interval_is_met():
    """What is no polynomial between samples goes through SciPy, which steps up to it."""
    y = model("y' + y = u").simulate(u="step(t - 1.03)", t=np.arange(0.0, 5.0, 0.1))
    t = np.arange(0.0, 5.0, 0.1)
    assert np.abs(y - np.where(t > 1.03, 1 - np.exp(1.03 - t), 0.0)).max() < 1e-6


def test_steps_do_not_pass_over_a_pulse():
    u = np.zeros(2001)
    u[1500:1504] = 1.0
    y = model("y' + y + y**3 = u").simulate(u=u, dt=0.01)
    assert 0.035 < y.max() < 0.04


def test_small_units_are_integrated_as_large_ones_are():
    large = model("y'' + y' + 4*y + y**3 = u").simulate(u="sin(3*t)", t=T)
    small = model("y'' + y' + 4*y + 1e24*y**3 = u").simulate(u="1e-12*sin(3*t)", t=T)
    assert np.abs(1e12 * small - large).max() < 1e-7


def test_varying_coefficients_as_text_function_and_samples_agree():
    words = {"u": "sin(t)", "t": T, "initial_state": [1.0, 0.0]}
    given = ["t**2", lambda t: t**2, T**2]
    y = [
        model("y'' + c(t)*y' + 4*y = u", {"c0": 0.5, "c1": 0.02}, varying={"c": ["1", one]}).simulate(**words)
        for one in given
    ]
    assert np.abs(y[1] - y[0]).max() < 1e-9
    assert np.abs(y[2] - y[0]).max() < 1e-7


# What it says -------------------------------------------------------------------------------------


def test_it_names_states_and_prints_itself():
    m = DUFFING.model(NUMBERS)
    assert m.states == ("y", "y'")
    assert m.shape == (1, 1)
    assert repr(m) == "-u + 0.5*y**3 + 1.0*y + 0.3*y' + y'' = 0"
    assert "y**3" in m._repr_html_()


def test_it_can_go_to_another_process():
    m = DUFFING.model(NUMBERS)
    again = pickle.loads(pickle.dumps(m))
    assert np.array_equal(again.simulate(u="sin(t)", t=T), m.simulate(u="sin(t)", t=T))


def test_a_finite_escape_is_said_with_its_time():
    with pytest.raises(mf.DataError, match=r"leaves all bounds at t = 0\.5 s"):
        model("y' = y**2").simulate(dt=0.05, intervals=40, initial_state=[2.0])


def test_a_start_outside_the_equations_is_said():
    with pytest.raises(mf.DataError, match="no finite highest derivative"):
        model("y' = log(y)").simulate(dt=0.05, intervals=40, initial_state=[-1.0])


@pytest.mark.parametrize(
    ("words", "error", "text"),
    [
        ({"u": "sin(t)"}, mf.SpecError, "give dt="),
        ({"u": "sin(t)", "dt": 0.1}, mf.SpecError, "say how long"),
        ({"u": "sin(t)", "dt": -0.1, "intervals": 5}, mf.DataError, "above 0"),
        ({"u": "sin(t)", "dt": 0.1, "intervals": 0}, mf.DataError, "at least 1"),
        ({"u": "sin(t)", "t": [0.0, 0.0, 1.0]}, mf.DataError, "rising"),
        ({"dt": 0.1, "intervals": 5}, mf.SpecError, "0 signal"),
        (
            {"u": "sin(t)", "dt": 0.1, "intervals": 5, "initial_state": [1.0]},
            mf.SpecError,
            "states y, y'; give 2",
        ),
        ({"u": "sin(t)", "dt": 0.1, "intervals": 5, "intersample": "no"}, mf.SpecError, "'no' is unknown"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(words, error, text):
    with pytest.raises(error, match=text):
        DUFFING.model(NUMBERS).simulate(**words)


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ({"d": 0.3, "a": 1.0}, "look at b"),
        ({**NUMBERS, "k": 1.0}, "look at k"),
        ({**NUMBERS, "b": np.nan}, "finite"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(params, text):
    with pytest.raises(mf.SpecError, match=text):
        DUFFING.model(params)


def test_a_held_input_under_a_product_with_its_derivative_is_refused():
    m = model("y' + y = u'*y")
    m.simulate(u=np.ones(20), dt=0.1, initial_state=[1.0])
    with pytest.raises(mf.SpecError, match="'zoh' between its samples"):
        m.simulate(u=np.ones(20), dt=0.1, initial_state=[1.0], intersample="zoh")


def bare(*source, outputs=("y",), inputs=(), hidden=()):
    return model_of(Compiled(outputs, inputs, (), {}, (), {}, source, hidden), {})


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda: bare(jet("y", 1) ** 2 - jet("y")), "finds 2 solution"),
        (lambda: bare(jet("y", 1) + jet("v"), hidden=("v",)), "1 equation.* for the 2 signals"),
        (lambda: bare(jet("y", 1) + jet("y"), outputs=("y", "z")), "no equation has z"),
        (
            lambda: bare(jet("y", 1) - jet("v"), jet("y", 1) + jet("y") + jet("v"), hidden=("v",)),
            None,  # v = y', so y' = -y - y': determined
        ),
        (
            lambda: bare(jet("y", 1) - jet("v", 1), 2 * jet("y", 1) - 2 * jet("v", 1), hidden=("v",)),
            "do not determine",
        ),
    ],
)
def test_equations_that_cannot_be_solved_are_refused_in_words(made, text):
    if text is None:
        y = made().simulate(dt=0.1, intervals=10, initial_state=[1.0])
        assert np.allclose(y, np.exp(-np.arange(11) * 0.05), atol=1e-9)
        return
    with pytest.raises(mf.SpecError, match=text):
        made().simulate(dt=0.1, intervals=10)


def test_an_implicit_equation_with_one_real_solution_is_solved():
    y = bare(jet("y", 1) ** 3 + jet("y") ** 3).simulate(dt=0.1, intervals=10, initial_state=[1.0])
    assert np.allclose(y, np.exp(-np.arange(11) * 0.1), atol=1e-9)


# Records and initial states ---------------------------------------------------------------------------


def test_simulate_adds_the_addressed_noise_of_linear_systems():
    words = {"input": TONES, "duration": 20.0, "intervals": 400, "initial_state": [0.5, 0.0]}
    m = DUFFING.model(NUMBERS)
    clean, noisy = mf.simulate(m, **words), mf.simulate(m, nsr=0.1, seed=3, replicate=2, **words)
    line = mf.tf([1], [1, 1, 1])
    noise = [mf.simulate(line, **{**words, "nsr": nsr}, seed=3, replicate=2).y[0] for nsr in (0.0, 0.1)]
    same = (noise[1] - noise[0]) / (noise[1] - noise[0]).std()
    own = noisy.y[0] - clean.y[0]
    assert np.allclose(own / own.std(), same, rtol=0, atol=1e-9)
    assert own.std() == pytest.approx(0.1 * np.sqrt(np.mean(clean.y**2)), rel=0.15)
    assert (noisy.outputs, noisy.inputs) == (("y",), ("u",))


def test_the_initial_state_is_found_with_its_standard_error():
    """Squared normalised errors of 2 states in 12 records: chi2(24), once in 1,000 outside 7.45 to 53.5."""
    m = DUFFING.model(NUMBERS)
    total = 0.0
    for replicate in range(12):
        rec = mf.simulate(
            m,
            input=TONES,
            duration=10.0,
            intervals=200,
            initial_state=[0.5, 0.2],
            nsr=0.1,
            replicate=replicate,
        )
        _, found = find_state(m, rec)
        e = found.state - [0.5, 0.2]
        total += e @ np.linalg.solve(found.cov, e)
    assert 7.45 < total < 53.5


def test_states_that_are_not_measured_are_found_too():
    x, z = jet("x"), jet("z")
    prey = bare(
        jet("x", 1) - x + 0.5 * x * z, jet("z", 1) + 0.8 * z - 0.3 * x * z, outputs=("x",), hidden=("z",)
    )
    y = prey.simulate(t=T, initial_state=[2.0, 0.7])
    rec = mf.Record(y=y + 0.05 * np.random.default_rng(1).normal(size=T.size), t=T, outputs=["x"])
    simulated, found = find_state(prey, rec)
    assert np.all(np.abs(found.state - [2.0, 0.7]) < 4 * found.bse)
    assert np.std(simulated[0] - y) < 0.02


def test_masked_samples_do_not_count():
    m = DUFFING.model(NUMBERS)
    rec = mf.simulate(m, input=TONES, duration=10.0, intervals=200, initial_state=[0.5, 0.2])
    y, ok = rec.y[0].copy(), np.ones(201, dtype=bool)
    y[20:60], ok[20:60] = 50.0, False
    _, found = find_state(m, mf.Record(y=y, u=rec.u, dt=rec.dt, mask=ok))
    assert found.state == pytest.approx([0.5, 0.2], abs=1e-5)


def test_a_response_that_leaves_all_bounds_from_everywhere_is_said():
    rec = mf.Record(y=np.linspace(1.0, 2.0, 101), dt=1.0)
    with pytest.raises(mf.DataError, match="leaves all bounds within the first"):
        find_state(model("y' = 5 + y**2"), rec)


# Studies and bounds -----------------------------------------------------------------------------------


def by_bound(rec, rng):
    """An 'estimator' that tells its record."""
    return {"d": rec.y[0, 5], "a": rec.y[0, 15], "b": rec.y[0, 30]}


STUDY = {
    "system": {"duffing": DUFFING.model(NUMBERS), "soft": DUFFING.model({**NUMBERS, "b": 0.1})},
    "input": TONES,
    "duration": 10.0,
    "intervals": 64,
    "nsr": [0.0, 0.1],
    "estimators": {
        "own": by_bound,
        "linear": mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=6, trend=None),
    },
    "seed": 5,
}


@pytest.mark.process
@pytest.mark.forks
@pytest.mark.parametrize("state", [[0.5, 0.0], "random"], ids=["fixed", "random"])
def test_a_study_of_equations_has_the_same_bits_on_any_engine(state):
    study = mf.MonteCarlo(**{**STUDY, "intervals": 32}, initial_state=state, replicates=66)
    here = study.run(threads=2)
    with ProcessPoolExecutor(2) as pool:
        there = study.run(executor=pool)
    for figure in ("bias", "sd", "median"):
        assert np.array_equal(getattr(here, figure), getattr(there, figure), equal_nan=True)
    assert np.array_equal(here.failures, there.failures)
    assert here.failures.sum() == 0


def test_the_truth_of_a_study_goes_by_name_and_its_record_is_that_of_simulate():
    study = mf.MonteCarlo(**STUDY, initial_state=[0.5, 0.0], replicates=3)
    res = study.run()
    rec, _ = res.replicate(2, system="soft", nsr=0.1)
    own = mf.simulate(
        STUDY["system"]["soft"], input=TONES, duration=10.0, intervals=64, initial_state=[0.5, 0.0]
    )
    sigma = 0.1 * np.sqrt(np.mean(own.y**2))
    assert np.std(rec.y - own.y) == pytest.approx(sigma, rel=0.25)
    truth = dict(zip(res.param_names, res.truth[1, 0, 0], strict=True))
    assert truth["b"] == 0.1
    assert np.isnan(truth["a1"])


def test_a_function_draws_the_initial_state_of_equations():
    study = mf.MonteCarlo(**STUDY, initial_state=lambda rng: rng.normal(size=2), replicates=3)
    first = [study.run().replicate(k, system="duffing", nsr=0.0)[0].y[0, 0] for k in range(3)]
    assert len(set(first)) == 3


def test_the_bound_of_a_linear_equation_is_that_of_its_transfer_function():
    system = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256)
    same = model("y'' + a1*y' + a2*y = b0*u", {"a1": 3.0, "a2": 8.0, "b0": 5.0})
    for state in ("unknown", "zero"):
        ours = mf.crlb(same, rec, nsr=0.2, initial_state=state)
        theirs = mf.crlb(system, rec, nsr=0.2, initial_state=state)
        assert ours.param_names == theirs.param_names
        assert ours.sd == pytest.approx(theirs.sd, rel=1e-6)


def test_the_bound_of_equations_stands_beside_a_study_of_them():
    study = mf.MonteCarlo(**STUDY, initial_state=[0.5, 0.0], replicates=2)
    bound = study.run().crlb
    rec = mf.simulate(STUDY["system"]["duffing"], input=TONES, duration=10.0, intervals=128)
    alone = mf.crlb(STUDY["system"]["duffing"], rec, nsr=0.1, start=[0.5, 0.0])
    assert np.isfinite(alone.sd).all()
    assert bound.shape == (2, 2, 2, len(study.run().param_names))


def test_equations_without_states_are_functions_of_their_inputs():
    y = model("y = a*u + b*u**2", {"a": 2.0, "b": 0.5}).simulate(u=[0.0, 1.0, 2.0], dt=0.1)
    assert np.allclose(y, [0.0, 2.5, 6.0])


@pytest.mark.parametrize("state", [None, np.array([0.5, 0.2])], ids=["unknown", "known"])
def test_a_constant_in_the_equation_is_found_beside_the_initial_state(state):
    offset = model("y'' + d*y' + a*y + b*y**3 + 0.4 = u", NUMBERS)
    rec = mf.simulate(offset, input=TONES, duration=10.0, intervals=200, initial_state=[0.5, 0.2])
    simulated, found = find_state(DUFFING.model(NUMBERS), rec, "constant", state)
    assert found.state == pytest.approx([0.5, 0.2], abs=1e-5)
    assert found.trend == pytest.approx([0.4], abs=1e-5)
    assert np.abs(simulated - rec.y).max() < 1e-5


def test_a_given_state_is_taken_as_it_is():
    m = DUFFING.model(NUMBERS)
    rec = mf.simulate(m, input=TONES, duration=10.0, intervals=200, initial_state=[0.5, 0.2])
    simulated, found = find_state(m, rec, None, np.array([0.1, 0.0]))
    assert np.array_equal(found.state, [0.1, 0.0])
    assert not found.cov.any()
    assert np.allclose(simulated[0], m.simulate(u=rec.u, t=rec.t, initial_state=[0.1, 0.0]))


# With fits -----------------------------------------------------------------------------------------------


def duffing_fit(method="ml"):
    rec = mf.simulate(
        DUFFING.model(NUMBERS),
        input=TONES,
        duration=20.0,
        intervals=256,
        initial_state=[0.5, 0.0],
        nsr=0.1,
        seed=4,
    )
    return mf.fit(rec, DUFFING, method=method, harmonics=12)


def test_a_fit_of_equations_predicts_and_its_model_is_a_system():
    fit = duffing_fit()
    assert fit.model.params == fit.estimates()
    initial = fit.initial_state()
    again = fit.predict(initial_state=initial)
    assert np.allclose(again.y, fit.predict().y, atol=1e-6)
    assert np.all(np.abs(initial.state - [0.5, 0.0]) < 4 * initial.bse)
    assert mf.simulate(fit.model, input=TONES, duration=5.0, intervals=50).intervals == 50


@pytest.mark.parametrize("kind", ["parametric", "wild"])
def test_the_bootstrap_of_equations_has_the_spread_of_their_standard_errors(kind):
    """200 replicates know a standard deviation to 5 %; HC3 and the wild one have but 25 lines to go by."""
    fit = duffing_fit()
    boot = mf.bootstrap(fit, replicates=200, seed=1, kind=kind, progress=False)
    assert boot.success.sum() >= 198
    bse = np.sqrt(np.diag(fit.cov_params("nonrobust" if kind == "parametric" else "HC3")))
    assert np.all(np.abs(np.log(boot.sd / bse)) < (0.2 if kind == "parametric" else 0.6))
    same = mf.bootstrap(fit, replicates=20, seed=1, kind=kind, threads=1, progress=False)
    assert np.array_equal(same.params, boot.params[:20])


def test_the_wild_noise_of_equations_is_grown_by_their_leverage():
    """Residuals in the band lose the share of 5 unknowns in 29 rows; 1/(1 - h) gives more than that back."""
    from modfun.inference.bootstrap_noise import wild

    fit = duffing_fit()
    rec = fit.records[0]
    y, initial = fit.simulate(rec)
    ((e,),) = wild(fit, (rec,), [(y, initial)], 0)(range(1))
    low, high = fit.lines[0]
    band = np.abs(np.fft.rfft(e[0, :-1])[low : high + 1]) ** 2
    plain = np.abs(np.fft.rfft(np.append((rec.y - y)[0, 1:-1], 0.0))[low : high + 1]) ** 2
    assert 1.05 < band.sum() / plain.sum() < 1.6


def test_a_study_fits_equations_in_batches_and_keeps_them_in_a_directory(tmp_path):
    study = mf.MonteCarlo(
        system=DUFFING.model(NUMBERS),
        input=TONES,
        duration=20.0,
        intervals=256,
        nsr=0.1,
        initial_state=[0.5, 0.0],
        estimators=["ls", "ml"],
        harmonics=12,
        replicates=70,
        seed=2,
    )
    here = study.run(keep="samples", threads=1)
    kept = study.run(keep="samples", directory=tmp_path / "study", threads=2)
    again = mf.load(tmp_path / "study")
    assert np.array_equal(here.samples, kept.samples)
    assert np.array_equal(here.bias, again.bias)
    assert here.failures.sum() == 0
    assert np.all(here.coverage[1] > 0.8)
    rec, fits = again.replicate(69)
    assert fits["ml"].params == pytest.approx(here.samples[1, 69], rel=1e-9)
    assert rec.outputs == ("y",)
    ratio = here.sd[1] / here.crlb[1]
    assert np.all((ratio > 0.75) & (ratio < 1.6))


def test_the_band_of_a_study_of_equations_is_chosen_on_the_first_response():
    study = mf.MonteCarlo(
        system=DUFFING.model(NUMBERS), input=TONES, duration=20.0, intervals=256, nsr=0.1,
        initial_state=[0.5, 0.0], estimators=["ml"], replicates=2,
    )  # fmt: skip
    own = study.plan.contenders[0].estimators[0].options
    assert own.harmonics is not None


SHORT = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], C=[[0, 1], [1, 0.5]], states=["alpha", "q"], inputs=["de"],
    outputs=["q", "nz"],
)  # fmt: skip


def flight(trend):
    system = mf.ss([[-1.2, 1.0], [-6.0, -1.5]], [[-0.1], [-8.0]], [[0, 1], [1, 0.5]], [[0.0], [0.0]])
    rec = mf.simulate(
        system, input="0.1*sin(t**2/2)", duration=10.0, intervals=200, nsr=0.02, initial_state=[0.05, 0.1],
        outputs=["q", "nz"], inputs=["de"], seed=1,
    )  # fmt: skip
    trimmed = rec if trend is None else rec.assign(nz=rec["nz"] + 0.2)
    return mf.fit(trimmed, SHORT, trend=trend, harmonics=18), rec


@pytest.mark.parametrize("trend", [None, "constant", "linear"])
def test_the_closed_form_of_linear_equations_is_what_the_search_finds(trend):
    fit, _ = flight(trend)
    rec = fit.records[0]
    simulated, initial = fit.simulate(rec)
    other, found = find_state(model_of(SHORT.compiled(), fit.params, SHORT), rec, trend)
    assert SHORT.states == ("alpha", "q")  # of the search: q first, which is an output
    assert np.abs(simulated - other).max() < 1e-5 * np.abs(rec.y).max()
    if trend is None:
        assert found.state[::-1] == pytest.approx(initial.state, rel=1e-3)
        assert found.bse[::-1] == pytest.approx(initial.bse, rel=0.02)


def test_a_linear_record_of_uneven_steps_has_the_states_in_the_users_order():
    fit, rec = flight(None)
    keep = np.flatnonzero(np.arange(201) % 7 != 3)
    uneven = mf.Record(
        y=fit.records[0].y[:, keep], u=rec.u[:, keep], t=rec.t[keep], outputs=["q", "nz"], inputs=["de"]
    )
    even, own = fit.initial_state(), fit.initial_state(uneven)
    assert own.state == pytest.approx(even.state, abs=0.005)
    again = fit.predict(uneven, initial_state=own)
    assert np.abs(again.y - fit.predict(uneven).y).max() < 0.02 * np.abs(rec.y).max()


def test_a_response_that_changes_ever_faster_ends_in_words():
    """Negative damping and a hardening spring: what grows turns faster, and would take steps for ever."""
    rec = mf.simulate(mf.tf([2], [1, 1]), input="sin(0.9*t)", duration=15.0, intervals=300, nsr=0.05, seed=3)
    model = mf.Equation("y'' + d*y' + a*y + b*y**3 = c*u", params={"d": -8.0})
    with pytest.raises(mf.DataError, match="simulating"):
        model.model({"a": -8.0, "b": 0.43, "c": -16.0}).simulate(
            u=rec.u[0], dt=rec.dt, initial_state=[0.1, 0.0]
        )


def test_a_scale_of_what_is_hidden_is_one():
    """Any value of b gives the same outputs; a hidden state is in units in which it is 1."""
    text, own = ["x' = a*x - b*x*z", "z' = d*x*z - c*z"], {"outputs": ["x"]}
    held = mf.Equation(text, params={"b": 0.5}, **own)
    values = {"a": 1.0, "c": 0.8, "d": 0.3}
    x = held.model(values).simulate(t=T, initial_state=[2.0, 0.7])
    free = mf.Equation(text, **own)
    np.testing.assert_allclose(free.model(values).simulate(t=T, initial_state=[2.0, 0.35]), x, rtol=1e-8)
    fit = mf.fit(mf.Record(y=x, dt=T[1], outputs="x"), free)
    assert next(row["fit_percent"] for row in fit.score()) > 99.9
    assert fit.initial_state().state == pytest.approx([2.0, 0.35], rel=1e-3)


def test_a_scale_that_may_not_be_one_must_be_held():
    text = ["x' = a*x - (b - 1)*x*z", "z' = d*x*z - c*z"]
    model = mf.Equation(text, outputs=["x"]).model({"a": 1.0, "c": 0.8, "d": 0.3})
    with pytest.raises(mf.SpecError, match=r"nothing gives b a value; hold them, params=\{'b': 1.0\}"):
        model.simulate(t=T, initial_state=[2.0, 0.7])
