"""Initial states by an observer: exact without noise, beside least squares with it, its covariance true."""

import modfun as mf
import numpy as np
import pytest
from modfun.results.observer import default_eigenvalues, observe
from oracle import observer as naive
from scipy.linalg import expm

DT = 10 / 256
SYSTEMS = {
    "eq24": [-1.5 + 2.4j, -1.5 - 2.4j],
    "light": [-0.05 + 2j, -0.05 - 2j],
    "undamped": [2j, -2j],
    "third": [-1.0, -0.6 + 2.94j, -0.6 - 2.94j],
    "unstable": [0.2, -3.0],
    "double": [-1.0, -1.0],
    "fast": [-1e2 + 1e2j, -1e2 - 1e2j],
}


def companion(poles):
    den = np.poly(poles).real
    n = len(poles)
    return np.vstack([np.eye(n, k=1)[:-1], -den[:0:-1]]), np.eye(n)[:1]


def responses(a, c, samples, dt):
    """(state, output, time)"""
    step, now, out = expm(a * dt), np.eye(a.shape[0]), []
    for _ in range(samples):
        out.append(c @ now)
        now = step @ now
    return np.moveaxis(np.array(out), 0, -1).swapaxes(0, 1)


@pytest.mark.parametrize("trend", [0, 1, 2])
@pytest.mark.parametrize("name", SYSTEMS)
def test_exact_without_noise(name, trend):
    a, c = companion(SYSTEMS[name])
    dt = DT / 50 if name == "fast" else DT
    x0 = np.array([1.0, -0.5, 2.0])[: a.shape[0]]
    y = np.tensordot(x0, responses(a, c, 257, dt), 1)
    terms = np.array([0.7, -0.3])[:trend]
    y = y + (terms @ np.vstack([np.ones(257), np.linspace(0, 1, 257)])[:trend] if trend else 0.0)
    found = observe(a, c, y, dt, trend=trend)
    np.testing.assert_allclose(found.state, x0, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(found.trend[0], terms, atol=1e-7)
    assert np.all(np.sqrt(np.diag(found.cov)) < 1e-6)


def test_exact_for_several_outputs_of_one_state():
    rng = np.random.default_rng(0)
    a = np.array([[-0.5, 3.0, 0.0], [-3.0, -0.5, 1.0], [0.0, 0.0, -0.8]])
    c = rng.normal(size=(2, 3)) * [[1.0], [1e3]]
    x0 = np.array([1.0, 2.0, -1.0])
    y = np.tensordot(x0, responses(a, c, 200, DT), 1) + np.array([[0.5], [-200.0]])
    found = observe(a, c, y, DT, trend=1)
    np.testing.assert_allclose(found.state, x0, rtol=1e-8)
    np.testing.assert_allclose(found.trend[:, 0], [0.5, -200.0], rtol=1e-7)


def test_it_is_the_continuous_observer_where_its_start_is_forgotten():
    a, c = companion(SYSTEMS["third"])
    t = np.arange(1025) * DT / 4
    y = (np.exp(-0.3 * t) * np.cos(2 * t))[None]  # no free response of the model: the answer is the gain's
    wanted = np.array([-4.0, -3.0 + 2j, -3.0 - 2j])
    found = observe(a, c, y, DT / 4, eigenvalues=wanted)
    twin = naive.initial_state(a, c, y, DT / 4, wanted)
    # the sampled observer tends to the continuous one with the step
    coarse = observe(a, c, y[:, ::4], DT, eigenvalues=wanted)
    gap, wide = (np.linalg.norm(x.state - twin) for x in (found, coarse))
    assert gap < 0.05 * np.linalg.norm(twin)
    assert 3.0 < wide / gap < 5.0


@pytest.mark.parametrize("trend", [0, 1])
@pytest.mark.parametrize("name", ["eq24", "light", "undamped", "third", "unstable"])
def test_never_better_than_least_squares_and_close_to_it(name, trend):
    """By covariance, exactly: the observer is linear in the samples, least squares the best of these."""
    a, c = companion(SYSTEMS[name])
    n = a.shape[0]
    dt, samples = 4 * DT, 65
    columns = naive.least_squares(a, c, samples, dt)
    if trend:
        columns = np.hstack([columns, np.ones((samples, 1))])
    best = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))[:n]
    # the spread of the answer over unit noise, sample by sample
    weights = np.array([observe(a, c, e[None], dt, trend=trend).state for e in np.eye(samples)])
    ratio = np.sqrt(np.sum(weights**2, axis=0)) / best
    assert np.all(ratio >= 1 - 1e-9)
    assert np.all(ratio < 1.08)
    np.testing.assert_allclose(weights.T @ columns[:, :n], np.eye(n), atol=1e-8)


@pytest.mark.statistics
def test_its_covariance_is_its_scatter():
    """400 records: a variance is known to 7 %; four standard errors are allowed."""
    a, c = companion(SYSTEMS["light"])
    rng = np.random.default_rng(3)
    clean = np.tensordot([1.0, 0.5], responses(a, c, 65, 4 * DT), 1)
    found = [observe(a, c, clean + 0.1 * rng.normal(size=clean.shape), 4 * DT, trend=1) for _ in range(400)]
    scatter = np.var([f.state for f in found], axis=0, ddof=1)
    told = np.mean([np.diag(f.cov) for f in found], axis=0)
    assert told == pytest.approx(scatter, rel=0.28)


def test_default_eigenvalues_mirror_the_poles_and_decay():
    found = default_eigenvalues(np.array([-2.0 + 3j, -2.0 - 3j, 0.0]), 10.0)
    np.testing.assert_allclose(found, [-2 + 3j, -2 - 3j, -0.1])
    grown = default_eigenvalues(np.array([0.5, -0.2]), 10.0)
    assert np.all(grown.real <= -0.6)
    assert abs(grown[0] - grown[1]) > 0.005


@pytest.mark.parametrize(
    ("eigenvalues", "text"),
    [([-1.0], "2 values"), ([-1 + 1j, -1 + 2j], "conjugate"), ([-1.0, 1.0], "negative real parts")],
)
def test_eigenvalues_that_do_not_serve_are_refused(eigenvalues, text):
    a, c = companion(SYSTEMS["eq24"])
    with pytest.raises(mf.SpecError, match=text):
        observe(a, c, np.zeros((1, 100)), DT, eigenvalues=eigenvalues)


def test_a_state_that_is_not_shown_is_said():
    a, c = companion([0.0, -1.0])  # an integrator beside an offset
    with pytest.raises(mf.FitError, match="trend"):
        observe(a, c, np.ones((1, 100)), DT, trend=1)
    with pytest.raises(mf.FitError, match="cannot follow"):
        observe(*companion([-1e4, -1.0]), np.ones((1, 100)), DT)


# Of a fit -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fit():
    plant = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(
        plant, input="sin(t**2/5)", duration=10, intervals=256, nsr=0.1, initial_state=[1.0, 0.5], seed=4
    )
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))


def test_a_fit_gives_both(fit):
    best, seen = fit.initial_state(), fit.initial_state(method="observer")
    np.testing.assert_allclose(seen.state, best.state, atol=0.2 * best.bse.max())
    np.testing.assert_allclose(seen.bse, best.bse, rtol=0.05)
    np.testing.assert_allclose(seen.trend, best.trend, atol=0.01)
    other = fit.initial_state(method="observer", eigenvalues=[-8.0, -9.0])
    assert np.all(other.bse > 1.3 * best.bse)
    assert np.all(np.abs(other.state - best.state) < 5 * other.bse)
    predicted = fit.predict(initial_state=seen)
    np.testing.assert_allclose(predicted.y, fit.predict().y, atol=0.02)


def test_what_a_fit_cannot_do_is_refused(fit):
    with pytest.raises(mf.SpecError, match="observer"):
        fit.initial_state(method="observr")
    with pytest.raises(mf.SpecError, match="belong to"):
        fit.initial_state(eigenvalues=[-1, -2])
    rec = fit.records[0]
    uneven = mf.Record(y=rec.y, u=rec.u, t=rec.t + 0.004 * np.sin(rec.t))
    with pytest.raises(mf.DataError, match="even sampling"):
        fit.initial_state(uneven, method="observer")
