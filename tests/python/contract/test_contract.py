"""What every estimator promises, whatever its method: methods of `fit` and the established rivals alike."""

import pickle

import modfun as mf
import numpy as np
import pytest

TF20 = mf.TransferFunction(poles=2, zeros=0)
DT = 10.0 / 256
METHODS = {
    name: mf.Estimator(TF20, method=name, harmonics=6, trend=None) for name in ("ls", "wls", "awls", "ml")
}
RIVALS = {
    "output_error": mf.rivals.output_error(TF20),
    "pem": mf.rivals.pem(TF20),
    "arx": mf.rivals.arx(TF20),
}
EVERY = {**METHODS, **RIVALS}


def samples(seed=0, scale=1.0):
    """Output and input of the report's example (24), from rest."""
    t = np.arange(257) * DT
    y = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=DT, intervals=256)
    return scale * (y + 1e-5 * np.random.default_rng(seed).standard_normal(t.size)), np.sin(t**2 / 5)


def numbers(found):
    """Parameters of a Fit or of a rival's mapping."""
    return np.array(found.params if isinstance(found, mf.Fit) else list(found.values()))


@pytest.fixture(scope="module")
def rec():
    y, u = samples()
    return mf.Record(y=y, u=u, dt=DT)


@pytest.fixture(params=EVERY)
def estimate(request):
    return EVERY[request.param]


@pytest.fixture(params=METHODS)
def method(request):
    """Name of a method."""
    return request.param


def test_it_finds_the_truth(estimate, rec):
    np.testing.assert_allclose(numbers(estimate(rec)), [3, 8, 5], rtol=0.02)


def test_it_is_deterministic(estimate, rec):
    np.testing.assert_array_equal(numbers(estimate(rec)), numbers(estimate(rec)))


def test_it_leaves_its_input_alone(estimate):
    y, u = samples()
    before = y.copy(), u.copy()
    estimate(mf.Record(y=y, u=u, dt=DT))
    np.testing.assert_array_equal((y, u), before)


LAYOUTS = {
    "fortran": lambda y, u: (np.asfortranarray(y[None]), np.asfortranarray(u[None])),
    "every other": lambda y, u: (np.repeat(y, 2)[::2], np.repeat(u, 2)[::2]),
    "backwards": lambda y, u: (y[::-1].copy()[::-1], u[::-1].copy()[::-1]),
    "transposed": lambda y, u: (np.stack([y, u], axis=1).T[:1], np.stack([y, u], axis=1).T[1:]),
    "read only": lambda y, u: (np.broadcast_to(y, (1, y.size)), np.broadcast_to(u, (1, u.size))),
    "other byte order": lambda y, u: (y.astype(">f8"), u.astype(">f8")),
    "lists": lambda y, u: (y.tolist(), u.tolist()),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layout_in_memory_does_not_matter(estimate, rec, layout):
    y, u = LAYOUTS[layout](*samples())
    np.testing.assert_array_equal(numbers(estimate(mf.Record(y=y, u=u, dt=DT))), numbers(estimate(rec)))


@pytest.mark.parametrize("dtype", ["int16", "int64", "float32", "float16"])
def test_any_real_type_counts_as_its_values(estimate, dtype):
    y, u = samples()
    y, u = (3e4 * y).astype(dtype), (3e4 * u).astype(dtype)
    narrow = mf.Record(y=y, u=u, dt=DT)
    wide = mf.Record(y=y.astype(float), u=u.astype(float), dt=DT)
    assert narrow.y.dtype == np.float64
    np.testing.assert_array_equal(numbers(estimate(narrow)), numbers(estimate(wide)))


def test_pickle_keeps_the_estimator(estimate, rec):
    again = pickle.loads(pickle.dumps(estimate))
    np.testing.assert_array_equal(numbers(again(rec)), numbers(estimate(rec)))


REFUSED = {
    "none": None,
    "an array": np.zeros((2, 50)),
    "a word": "flight.csv",
    "an empty list": [],
    "too short": mf.Record(y=np.arange(9.0) ** 2, u=np.sin(np.arange(9.0)), dt=0.1),
    "two outputs": mf.Record(y=np.random.default_rng(0).standard_normal((2, 64)), u=np.arange(64.0), dt=0.1),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_in_words(estimate, what):
    with pytest.raises(mf.ModfunError) as refusal:
        estimate(REFUSED[what])
    assert len(str(refusal.value)) > 30


# What only the methods of `fit` have ----------------------------------------------------------------


def test_a_batch_is_a_loop(method):
    y = np.stack([samples(seed)[0] for seed in range(11)])[:, None]
    batch = mf.Batch(y=y, u=samples()[1], dt=DT)
    many = mf.fit_many(batch, TF20, method=method, harmonics=6, trend=None)
    for k, one in enumerate(y):
        fit = METHODS[method](mf.Record(y=one, u=samples()[1], dt=DT))
        np.testing.assert_array_equal(many.params[k], fit.params)
        np.testing.assert_allclose(many.bse[k], fit.bse, rtol=1e-14)


def test_pickle_and_json_keep_the_fit(method, rec, tmp_path):
    fit = METHODS[method](rec)
    fit.save(tmp_path / "fit.json")
    for again in (pickle.loads(pickle.dumps(fit)), mf.load(tmp_path / "fit.json")):
        np.testing.assert_array_equal(again.params, fit.params)
        np.testing.assert_array_equal(again.cov_params(), fit.cov_params())
        np.testing.assert_array_equal(again.residuals, fit.residuals)
        assert (again.param_names, again.status, again.band) == (fit.param_names, fit.status, fit.band)
        told, kept = (str(one.summary()).splitlines()[3:] for one in (fit, again))
        assert kept[:-1] == told[:-1]
        assert told[-1].startswith(kept[-1])  # without samples nothing is said of records without noise
        np.testing.assert_array_equal(again.predict(rec).y, fit.predict(rec).y)


def test_pickle_keeps_records_and_structures(rec):
    again = pickle.loads(pickle.dumps(rec))
    np.testing.assert_array_equal(again.y, rec.y)
    np.testing.assert_array_equal(again.u, rec.u)
    assert (again.dt, again.outputs, again.inputs) == (rec.dt, rec.outputs, rec.inputs)
    assert pickle.loads(pickle.dumps(TF20)) == TF20


def test_samples_that_are_missing_give_a_refusal_or_a_status():
    y, u = samples()
    y[7] = np.nan
    try:
        fit = METHODS["ml"](mf.Record(y=y, u=u, dt=DT))
    except mf.ModfunError:
        return
    assert fit.status == "nonfinite"
