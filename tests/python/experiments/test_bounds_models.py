"""The Cramér–Rao bound of every kind of model, against differences made without modfun and Monte Carlo."""

import modfun as mf
import numpy as np
import pytest
from oracle.bound import bound, held
from scipy.integrate import solve_ivp

VALUES = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
SHORT_PERIOD = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"]
)
DE = mf.signals.multistep("de", unit=0.4, dt=0.05, amplitude=0.03, before=0.5, duration=8.0)
COV = np.array([[4e-6, 3e-6], [3e-6, 1.6e-5]])


def short_period(z, u=DE.u, dt=0.05):
    """Response of the short period to Za, Ma, Mq, Zd, Md and the initial state."""
    a, b = np.array([[z[0], 1], [z[1], z[2]]]), np.array([[z[3]], [z[4]]])
    return held(a, b, np.eye(2), np.zeros((2, 1)), u, dt, z[5:7])


def same(found, wanted, rel=1e-6):
    """Equal covariances, relative to the standard deviations."""
    size = np.sqrt(np.diag(wanted))
    np.testing.assert_allclose(found / np.outer(size, size), wanted / np.outer(size, size), atol=rel)


# Against differences ---------------------------------------------------------------------------------


@pytest.mark.parametrize("trend", [None, "constant", "linear"])
def test_state_space_with_correlated_noise(trend):
    found = mf.crlb(SHORT_PERIOD, DE, params=VALUES, sigma=COV, trend=trend)
    assert found.param_names == tuple(VALUES)
    terms = {None: 0, "constant": 1, "linear": 2}[trend]
    same(found.cov, bound(short_period, [*VALUES.values(), 0, 0], 5, COV, terms))
    np.testing.assert_allclose(found.sigma, np.sqrt(np.diag(COV)))


def test_state_space_with_expressions_held_values_and_a_hidden_state():
    # Mq = k·w with w held; q alone measured, doubled; feedthrough.
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "k*w"]],
        [[0], ["Md**2"]],
        [[0, 2]],
        [["f"]],
        states=["alpha", "q"],
        inputs=["de"],
        outputs=["out"],
        params={"w": 2.0},
    )
    values = {"Za": -0.8, "Ma": -4.5, "k": -0.6, "Md": 2.0, "f": 0.3}

    def response(z):
        a, b = np.array([[z[0], 1], [z[1], 2 * z[2]]]), np.array([[0.0], [z[3] ** 2]])
        return held(a, b, np.array([[0.0, 2.0]]), np.array([[z[4]]]), DE.u, 0.05, z[5:])

    found = mf.crlb(model, DE, params=values, sigma=0.01, start=[0.02, -0.01])
    same(found.cov, bound(response, [*values.values(), 0.02, -0.01], 5, np.eye(1) * 1e-4))


def companion(a, b, dt, u, x0):
    """y⁽ⁿ⁾ + a1 y⁽ⁿ⁻¹⁾ + … = b(p) u, x0 the states y, y', … of the free response."""
    n = len(a)
    matrix = np.vstack([np.eye(n, k=1)[:-1], -np.array(a)[::-1]])
    markov = np.zeros((n + 1, len(b)))
    for j, own in enumerate(b):
        full = np.concatenate([np.zeros(n + 1 - len(own)), own])
        for k in range(n + 1):
            markov[k, j] = full[k] - sum(a[i] * markov[k - 1 - i, j] for i in range(k))
    return held(matrix, markov[1:], np.eye(n)[:1], markov[:1], u, dt, x0)[0]


@pytest.mark.parametrize("denominator", ["common", "separate"])
def test_transfer_functions_with_several_outputs_and_inputs(denominator):
    rng = np.random.default_rng(3)
    u = np.repeat(rng.standard_normal((2, 40)), 5, axis=1)
    first, second = [1.4, 5.0], [1.4, 5.0] if denominator == "common" else [2.0, 3.0]
    structure = mf.TransferFunction(poles=2, zeros=[[1, 0], [None, 2]], denominator=denominator)
    rec = mf.Record(y=np.zeros((2, 200)), u=u, dt=0.05, intersample="zoh", outputs=["p", "r"])
    names = structure.param_names(rec.inputs, rec.outputs)
    numbers = [0.7, -2.0, 3.0, 0.2, 0.4, 1.5]
    theta = [*first, *numbers] if denominator == "common" else [*first, *numbers[:3], *second, *numbers[3:]]
    values = dict(zip(names, theta, strict=True))
    start = [0.1, -0.3, 0.2, 0.5]

    def response(z):
        if denominator == "common":
            a1, a2, b, x0 = z[:2], z[:2], z[2:8], z[8:]
        else:
            a1, b, a2, x0 = z[:2], np.concatenate([z[2:5], z[7:10]]), z[5:7], z[10:]
        one = companion(a1, [b[:2], b[2:3]], 0.05, u, x0[:2])
        other = companion(a2, [[0.0], b[3:]], 0.05, u, x0[2:])
        return np.array([one, other])

    found = mf.crlb(structure, rec, params=values, sigma=COV, start=start)
    assert found.param_names == names
    same(found.cov, bound(response, [*theta, *start], len(theta), COV))
    # The same from rest, of a system with numbers.
    system = structure.model(theta, inputs=2)
    again = mf.crlb(system, rec, sigma=COV, model=structure)
    same(again.cov, bound(response, [*theta, 0, 0, 0, 0], len(theta), COV))
    # What is held is known, and what is known costs nothing.
    less = mf.TransferFunction(
        poles=2, zeros=[[1, 0], [None, 2]], denominator=denominator, params={names[0]: first[0]}
    )
    rest = {name: value for name, value in values.items() if name != names[0]}
    known = mf.crlb(less, rec, params=rest, sigma=COV, start=start)
    information = np.linalg.inv(found.cov)[1:, 1:]
    same(known.cov, np.linalg.inv(information), 1e-7)


def late_response(z, t):
    """y' + a y = b u(t − τ), u = sin³ from 0 on; the same for the second output with its own a and b."""

    def u(time):
        return np.sin(time) ** 3 if time > 0 else 0.0

    def rate(time, y):
        return [-z[0] * y[0] + z[1] * u(time - z[3]), -z[0] * y[1] + z[2] * u(time - z[4])]

    done = solve_ivp(rate, (0, t[-1]), z[5:7], "DOP853", t, rtol=1e-12, atol=1e-14, max_step=0.05)
    return done.y


def test_delays_to_be_estimated_known_and_shared():
    t = np.arange(401) * 0.025
    rec = mf.Record(y=np.zeros((2, 401)), u=np.sin(t) ** 3, dt=0.025, outputs=["p", "r"], inputs="de")
    free = mf.Free(0.3, min=0, max=1)
    own = mf.TransferFunction(poles=1, zeros=0, delay=[[free], [free]], denominator="common")
    values = {"a1": 0.7, "b0[p]": 2.0, "b0[r]": -1.0, "delay[p]": 0.31, "delay[r]": 0.5}
    found = mf.crlb(own, rec, params=values, sigma=[0.1, 0.2])
    cov = np.diag([0.01, 0.04])
    wanted = bound(lambda z: late_response(z, t), [0.7, 2, -1, 0.31, 0.5, 0, 0], 5, cov)
    same(found.cov, wanted, 2e-5)  # the input is known by samples; the bend at 0 goes through a spline
    shared = mf.TransferFunction(poles=1, zeros=0, delay=free, denominator="common")
    values = {"a1": 0.7, "b0[p]": 2.0, "b0[r]": -1.0, "delay": 0.31}
    found = mf.crlb(shared, rec, params=values, sigma=[0.1, 0.2])
    wanted = bound(lambda z: late_response([*z[:4], z[3], *z[4:]], t), [0.7, 2, -1, 0.31, 0, 0], 4, cov)
    same(found.cov, wanted, 2e-5)
    known = mf.TransferFunction(poles=1, zeros=0, delay=0.31, denominator="common")
    values.pop("delay")
    found = mf.crlb(known, rec, params=values, sigma=[0.1, 0.2])
    wanted = bound(lambda z: late_response([*z[:3], 0.31, 0.31, *z[3:]], t), [0.7, 2, -1, 0, 0], 3, cov)
    same(found.cov, wanted, 2e-5)
    through = mf.TransferFunction(poles=1, zeros=1, delay=free)
    values = {"a1": 0.7, "b0": 2.0, "b1": 1.0, "delay": 0.3}
    with pytest.raises(mf.SpecError, match="hold the delay, or lower zeros="):
        mf.crlb(through, rec.select(outputs=["p"]), params=values, sigma=0.1)


def test_equations_with_several_outputs():
    model = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x", "z"])
    values = {"a": 1.0, "b": 0.5, "c": 0.8, "d": 0.4}
    t = np.arange(201) * 0.05

    def response(v):
        def rate(_, y):
            return [v[0] * y[0] - v[1] * y[0] * y[1], -v[2] * y[1] + v[3] * y[0] * y[1]]

        return solve_ivp(rate, (0, 10), v[4:], "DOP853", t, rtol=1e-12, atol=1e-14).y

    rec = mf.Record(y=np.ones((2, 201)), dt=0.05, outputs=["x", "z"])
    found = mf.crlb(model, rec, params=values, sigma=COV, start=[2.0, 1.0])
    assert found.param_names == tuple(values)
    same(found.cov, bound(response, [1.0, 0.5, 0.8, 0.4, 2.0, 1.0], 4, COV), 1e-5)
    hidden = mf.crlb(
        mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x"], params={"b": 0.5}),
        mf.Record(y=np.ones(201), dt=0.05, outputs="x"),
        params={"a": 1.0, "c": 0.8, "d": 0.4},
        sigma=0.1,
        start=[2.0, 1.0],
    )
    wanted = bound(
        lambda v: response([v[0], 0.5, *v[1:]])[:1], [1.0, 0.8, 0.4, 2.0, 1.0], 3, np.eye(1) * 0.01
    )
    same(hidden.cov, wanted, 1e-5)


def test_an_equation_with_a_delay_to_be_estimated():
    model = mf.Equation("y' = -a*y + b*u(t - h)", params={"h": mf.Free(0.3, min=0, max=1)})
    t = np.arange(401) * 0.025
    rec = mf.Record(y=np.zeros(401), u=np.sin(t) ** 3, dt=0.025)
    found = mf.crlb(model, rec, params={"a": 0.7, "b": 2.0, "h": 0.31}, sigma=0.1)
    places = [found.param_names.index(name) for name in ("a", "b", "h")]
    structure = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(0.3, min=0, max=1))
    wanted = mf.crlb(structure, rec, params={"a1": 0.7, "b0": 2.0, "delay": 0.31}, sigma=0.1)
    same(found.cov[np.ix_(places, places)], wanted.cov, 1e-4)


# Experiments ---------------------------------------------------------------------------------------------


def test_masked_and_unevenly_noisy_samples_of_two_outputs():
    rng = np.random.default_rng(1)
    seen = rng.random((2, DE.intervals + 1)) > 0.3
    spread = rng.uniform(0.5, 3, seen.shape)
    rec = mf.Record(y=np.zeros(seen.shape), u=DE, outputs=["alpha", "q"]).weigh(mask=seen, sigma=spread)
    found = mf.crlb(SHORT_PERIOD, rec, params=VALUES, sigma=COV, trend="constant")
    same(found.cov, bound(short_period, [*VALUES.values(), 0, 0], 5, COV, 1, seen, spread))
    turned = rec.select(outputs=["q", "alpha"])
    again = mf.crlb(SHORT_PERIOD, turned, params=VALUES, sigma=COV, trend="constant")
    np.testing.assert_allclose(again.cov, found.cov, rtol=1e-12)


def test_experiments_add_up():
    other = mf.signals.multisine("de", band=(0.8, 6), duration=10, dt=0.05, amplitude=0.03)
    options = {"params": VALUES, "sigma": [0.002, 0.004], "trend": "constant"}
    alone = [mf.crlb(SHORT_PERIOD, one, **options) for one in (DE, other)]
    both = mf.crlb(SHORT_PERIOD, [DE, other], **options)
    wanted = np.linalg.inv(sum(np.linalg.inv(one.cov) for one in alone))
    same(both.cov, wanted, 1e-9)
    twice = mf.crlb(SHORT_PERIOD, [DE, DE], **options)
    same(twice.cov, alone[0].cov / 2, 1e-9)
    # nsr is relative to the response over all of them: a noise of one size.
    relative = mf.crlb(SHORT_PERIOD, [DE, other], params=VALUES, nsr=[0.1, 0.2])
    y = np.hstack([SHORT_PERIOD.model(VALUES).simulate(u=one) for one in (DE, other)])
    np.testing.assert_allclose(relative.sigma, [0.1, 0.2] * np.sqrt(np.mean(y**2, axis=1)), rtol=1e-5)


def test_a_design_is_a_record_not_yet_made():
    rec = mf.simulate(SHORT_PERIOD.model(VALUES), input=DE, outputs=["alpha", "q"])
    options = {"params": VALUES, "nsr": 0.1}
    np.testing.assert_array_equal(
        mf.crlb(SHORT_PERIOD, DE, **options).cov, mf.crlb(SHORT_PERIOD, rec, **options).cov
    )
    # Names that say nothing go by position; a system without names takes any.
    plain = mf.signals.Signals(DE.u, DE.dt)
    np.testing.assert_array_equal(
        mf.crlb(SHORT_PERIOD, plain, **options).cov, mf.crlb(SHORT_PERIOD, rec, **options).cov
    )
    assert mf.crlb(mf.tf([5], [1, 3, 8]), DE, nsr=0.1).param_names == ("a1", "a2", "b0")


# Fits and Monte Carlo ------------------------------------------------------------------------------------


def flight(seed, y=None):
    """A record of the short period with white noise on alpha and q."""
    rest = SHORT_PERIOD.model(VALUES).simulate(u=DE) if y is None else y
    noise = np.linalg.cholesky(COV) @ np.random.default_rng(seed).standard_normal(rest.shape)
    return mf.Record(y=rest + noise, u=DE, outputs=["alpha", "q"])


def test_a_fit_has_its_model_its_estimates_and_its_noise():
    rec = flight(0)
    fit = mf.fit(rec, SHORT_PERIOD)
    found = mf.crlb(fit)
    values, start = fit.estimates(), fit.initial_state().state
    wanted = mf.crlb(SHORT_PERIOD, rec, params=values, sigma=fit.noise_cov, trend="constant", start=start)
    np.testing.assert_allclose(found.cov, wanted.cov, rtol=1e-9)
    # Its own standard errors are of the same size: they know the noise by 160 samples (6 %) and no more.
    np.testing.assert_allclose(np.sqrt(np.diag(fit.cov_nonrobust)), found.sd, rtol=0.15)
    # Another manoeuvre of the same aircraft.
    longer = mf.signals.multisine("de", band=(0.8, 6), duration=30, dt=0.05, amplitude=0.03)
    assert np.all(mf.crlb(fit, longer).sd < found.sd)
    half = mf.crlb(fit, longer, sigma=fit.noise_cov / 4)
    np.testing.assert_allclose(half.sd, mf.crlb(fit, longer).sd / 2, rtol=1e-9)


def test_a_fit_of_a_transfer_function_and_of_an_equation():
    system = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=2)
    structure = mf.TransferFunction(poles=2, zeros=0)
    fit = mf.fit(rec, structure, trend=None)
    wanted = mf.crlb(fit.model, rec, sigma=fit.sigma, start=fit.initial_state().state)
    np.testing.assert_allclose(mf.crlb(fit).cov, wanted.cov, rtol=1e-9)
    np.testing.assert_allclose(mf.crlb(fit).sd, np.sqrt(np.diag(fit.cov_nonrobust)), rtol=0.2)
    written = mf.fit(rec, mf.Equation("y'' + a1*y' + a2*y = b0*u"))
    by_name = mf.crlb(written)
    places = [by_name.param_names.index(name) for name in ("a1", "a2", "b0")]
    np.testing.assert_allclose(by_name.sd[places], mf.crlb(fit).sd, rtol=0.05)


@pytest.mark.statistics
def test_the_bound_is_what_maximum_likelihood_reaches():
    y = SHORT_PERIOD.model(VALUES).simulate(u=DE)
    count = 400
    batch = mf.Batch(
        y=np.array([flight(seed, y).y for seed in range(count)]),
        u=DE.u,
        dt=DE.dt,
        outputs=["alpha", "q"],
        inputs=["de"],
        intersample="zoh",
    )
    many = mf.fit_many(batch, SHORT_PERIOD, band=12.0)
    assert set(many.status) == {"ok"}
    estimates = many.params
    limit = mf.crlb(SHORT_PERIOD, DE, params=VALUES, sigma=COV, trend="constant")
    ratio = estimates.std(axis=0, ddof=1) / limit.sd
    # A standard deviation of 400 errs by 3.5 %; four times that, five parameters: false alarm 1 in 3,000.
    assert np.all(np.abs(ratio - 1) < 0.14), ratio
    error = (estimates.mean(axis=0) - list(VALUES.values())) / (limit.sd / np.sqrt(count))
    assert np.all(np.abs(error) < 4.5), error


@pytest.mark.statistics
def test_a_study_of_two_outputs_reaches_its_bound():
    study = mf.MonteCarlo(
        system=mf.tf([[[2, 1]], [[3]]], [1, 1.4, 5]),
        input=mf.signals.multisine("de", band=(0.6, 6), duration=15, dt=0.05),
        nsr=0.1,
        estimators=["ml"],
        band=12.0,
        trend=None,
        replicates=400,
        seed=5,
    )
    res = study.run()
    assert res.crlb.shape == res.sd.shape
    # A standard deviation of 400 errs by 3.5 %; four times that, five parameters: false alarm 1 in 3,000.
    assert np.all(np.abs(res.sd / res.crlb - 1) < 0.14), res.sd / res.crlb


# What is refused -----------------------------------------------------------------------------------------


def refused(said, *args, error=mf.SpecError, **options):
    with pytest.raises(error, match=said):
        mf.crlb(*args, **options)


def test_what_cannot_be_meant_is_refused():
    sigma = {"sigma": 0.1}
    refused("StateSpace has no numbers; give params=", SHORT_PERIOD, DE, **sigma)
    few = dict.fromkeys(list(VALUES)[:4], 1.0)
    refused("params lacks 'Md'", SHORT_PERIOD, DE, params=few, **sigma)
    refused("params names 'Mde'; did you mean", SHORT_PERIOD, DE, params={**VALUES, "Mde": 1.0}, **sigma)
    refused("must be a finite number", SHORT_PERIOD, DE, params={**VALUES, "Md": np.nan}, **sigma)
    refused("params= is for structures", mf.tf([5], [1, 3, 8]), DE, params=VALUES, **sigma)
    structure = mf.TransferFunction(poles=2)
    refused("model= is for systems", SHORT_PERIOD, DE, params=VALUES, model=structure, **sigma)
    refused("the system is of type str", "short period", DE, **sigma)
    refused("the experiment is a NoneType", SHORT_PERIOD, params=VALUES, **sigma)
    refused("the experiment is a int", SHORT_PERIOD, 5, params=VALUES, **sigma)
    refused("start='zero' is text; give real numbers", SHORT_PERIOD, DE, params=VALUES, start="zero", **sigma)
    growing = mf.signals.doublet("de", width=0.5, dt=0.1, duration=500)
    refused("grows without bound", mf.tf([1], [1, -3, 8]), growing, error=mf.DataError, **sigma)
    refused("the experiment is a list of nothing", SHORT_PERIOD, [], params=VALUES, **sigma)
    refused("give the noise", SHORT_PERIOD, DE, params=VALUES)
    refused("2 of them, one per output", SHORT_PERIOD, DE, params=VALUES, sigma=[0.1, 0.2, 0.3])
    refused("must be a number above 0", SHORT_PERIOD, DE, params=VALUES, nsr=[0.1, 0.0])
    refused("not a covariance matrix", SHORT_PERIOD, DE, params=VALUES, sigma=[[1.0, 2.0], [2.0, 1.0]])
    refused("has shape \\(3,\\)", SHORT_PERIOD, DE, params=VALUES, start=[0, 0, 0], **sigma)
    da = mf.signals.Signals(DE.u, DE.dt, "da")
    refused("the signals are da, the inputs of the system de", SHORT_PERIOD, da, params=VALUES, **sigma)
    rec = mf.Record(y=np.zeros((2, 161)), u=DE.u, dt=0.05, inputs="da", outputs=["alpha", "q"])
    refused("the model has the input 'de', the record the inputs", SHORT_PERIOD, rec, params=VALUES, **sigma)


def test_parameters_that_cannot_be_told_apart_are_named():
    # q alone: Zd and Md, Za and Mq … only in combinations (THEORY 7: four of five).
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], [[0, 1]], states=["alpha", "q"], inputs=["de"]
    )
    said = "does not tell .*Ma.*Zd.* apart .*hold one of them"
    refused(said, model, DE, params=VALUES, sigma=0.1, error=mf.DataError)
    held = mf.StateSpace(model.A, model.B, model.C, states=["alpha", "q"], inputs=["de"], params={"Zd": -0.1})
    values = {name: value for name, value in VALUES.items() if name != "Zd"}
    assert np.all(np.isfinite(mf.crlb(held, DE, params=values, sigma=0.001).sd))
    still = mf.signals.Signals(np.zeros(100), 0.05, "de")
    refused("not move the output", SHORT_PERIOD, still, params=VALUES, sigma=0.1, error=mf.DataError)


def test_free_motion_begins_at_start():
    """Of an equation, as by derivatives of the damped cosine; without start the message asks for it."""
    t, p = 0.05 * np.arange(401), np.array([0.4, 1.04, 1.0, 0.0])

    def motion(a1, a2, y0, v0):
        d = np.sqrt(a2 - a1**2 / 4)
        return np.exp(-a1 / 2 * t) * (y0 * np.cos(d * t) + (v0 + a1 / 2 * y0) / d * np.sin(d * t))

    slopes = np.array([(motion(*(p + e)) - motion(*(p - e))) / 2e-6 for e in 1e-6 * np.eye(4)])
    exact = 0.02 * np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    equation, rec = mf.Equation("y'' + a1*y' + a2*y = 0"), mf.Record(y=motion(*p), dt=0.05)
    values = {"a1": 0.4, "a2": 1.04}
    bound = mf.crlb(equation, rec, params=values, sigma=0.02, start=[1.0, 0.0])
    np.testing.assert_allclose(bound.sd, exact[:2], rtol=1e-5)
    np.testing.assert_allclose(mf.crlb(mf.fit(rec, equation), sigma=0.02).sd, exact[:2], rtol=1e-3)
    with pytest.raises(mf.DataError, match=r"a1, a2 do not move .* give start=, the initial state"):
        mf.crlb(equation, rec, params=values, sigma=0.02)


# From a state of rest that follows from the parameters ------------------------------------------------

TANK = mf.Equation("h' = -k*sqrt(h) + b*u", outputs=["h"])
INFLOW = np.where(np.linspace(0, 6, 61) >= 0.6, 1.5, 1.0)


def filling(z):
    """The level from rest under an inflow of 1, in u = √h: u' = (−k u + b q)/(2 u)."""
    k, b = z
    t = np.linspace(0, 5.4, 55)
    moved = solve_ivp(
        lambda _, u: (-k * u + 1.5 * b) / (2 * u), (0, 5.4), [b / k], "DOP853", t, rtol=1e-12, atol=1e-14
    )
    return np.concatenate([np.full(6, (b / k) ** 2), moved.y[0] ** 2])[None]


@pytest.mark.parametrize("trend", [None, "constant"])
def test_equations_rest_under_inputs_that_begin_elsewhere_than_at_zero(trend):
    model = TANK.model({"k": 0.5, "b": 0.4})
    rec = mf.Record(np.zeros(61), INFLOW, dt=0.1, outputs="h", intersample="zoh")
    told = {"sigma": 0.01, "initial_state": "rest", "trend": trend, "start": [1.0]}
    found = mf.crlb(model, rec, **told)
    same(found.cov, bound(filling, [0.5, 0.4], 2, np.array([[1e-4]]), 0 if trend is None else 1), 1e-5)
    # A state that only happens to be that of rest tells less of the parameters.
    given = mf.crlb(model, rec, sigma=0.01, initial_state=[0.64], trend=trend)
    assert np.all(found.sd < given.sd)


def test_linear_equations_that_have_stood_under_their_first_input():
    u = 1.0 + np.where(np.arange(81) >= 8, 1.0, 0.0)
    linear = mf.Equation("y'' + a1*y' + a2*y = b0*u").model({"a1": 3.0, "a2": 8.0, "b0": 5.0})
    rec = mf.Record(np.zeros(81), u, dt=0.05, intersample="zoh")
    told = {"sigma": 0.05, "initial_state": "rest", "trend": "constant"}
    same(mf.crlb(linear, rec, **told).cov, with_level(rec), 1e-5)


def with_level(rec):
    """The bound where the level before the first sample is that of the model, by responses from before it."""
    early = np.concatenate([np.full((1, 400), rec.u[0, 0]), rec.u], axis=1)

    def response(z):
        a = np.array([[-z[0], 1.0], [-z[1], 0.0]])
        b = np.array([[0.0], [z[2]]])
        return held(a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1)), early, 0.05, [0, 0])[:, 400:]

    return bound(response, [3.0, 8.0, 5.0], 3, np.array([[0.05**2]]), 1)


@pytest.mark.parametrize("equation", ["y'' + a*y' = u", "y' + a*y**2 + exp(y) + 3 = u"])
def test_equations_without_a_state_of_rest(equation):
    rec = mf.Record(np.zeros(41), INFLOW[:41], dt=0.1, intersample="zoh")
    with pytest.raises(mf.DataError, match="no state of rest under the inputs"):
        mf.crlb(mf.Equation(equation).model({"a": 1.0}), rec, sigma=0.1, initial_state="rest")


def test_an_integrator_at_rest_under_no_input_begins_at_the_level_it_is_given():
    rec = mf.Record(np.zeros(41), INFLOW[:41] - 1.0, dt=0.1, intersample="zoh")
    still = mf.crlb(
        mf.Equation("y'' + a*y' = b*u").model({"a": 1.0, "b": 2.0}), rec, sigma=0.1, initial_state="rest"
    )
    zero = mf.crlb(
        mf.tf([2], [1, 1, 0]),
        rec,
        sigma=0.1,
        initial_state="zero",
        model=mf.TransferFunction(poles=2, zeros=0, params={"a2": 0.0}),
    )
    np.testing.assert_allclose(still.sd, zero.sd, rtol=1e-5)
