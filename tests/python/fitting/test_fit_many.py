"""Many fits at once: the same numbers as one at a time."""

import pickle
import warnings
from dataclasses import replace
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.changes import above

TF20 = mf.TransferFunction(poles=2, zeros=0)


@pytest.fixture(scope="module")
def batch():
    t = np.linspace(0, 10, 257)
    clean = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256)
    noise = 0.1 * clean.std() * np.random.default_rng(0).standard_normal((50, 257))
    return mf.Batch(y=clean + noise, u=np.sin(t**2 / 5), dt=10 / 256)


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
def test_a_batch_equals_single_fits(batch, method):
    many = mf.fit_many(batch, TF20, method=method)
    harmonics = round(many.band[1] * 10 / (2 * np.pi)) - 2
    for k in (0, 17, 49):
        one = mf.fit(batch[k], TF20, method=method, harmonics=harmonics)
        np.testing.assert_allclose(many.params[k], one.params, rtol=1e-12)
        np.testing.assert_allclose(many.bse[k], one.bse, rtol=1e-12)
        np.testing.assert_allclose(many.conf_int(0.9)[k], one.conf_int(0.9), rtol=1e-12)
        assert many.cost[k] == pytest.approx(one.cost, rel=1e-12)
        assert many.status[k] == one.status
    assert many.df_resid == one.df_resid
    assert many.success.all()
    assert len(many) == 50


def test_errors_and_scatter_agree(batch):
    table = mf.fit_many(batch, TF20, trend=None).table()
    assert table["parameter"].tolist() == ["a1", "a2", "b0"]
    np.testing.assert_allclose(table["mean"], [3, 8, 5], rtol=0.02)
    assert np.all(table["sd"] / table["mean_bse"] < 1.4)
    assert np.all(table["sd"] / table["mean_bse"] > 0.6)


def test_the_band_is_chosen_once_on_the_first_record(batch):
    many = mf.fit_many(batch, TF20)
    assert many.band == mf.fit(batch[0], TF20).band
    assert mf.fit_many(batch, TF20, band=(1.0, 8.0)).band[1] <= 8.0


def test_threads_do_not_change_the_numbers(batch, monkeypatch):
    alone = mf.fit_many(batch, TF20, threads=1)
    np.testing.assert_array_equal(alone.params, mf.fit_many(batch, TF20, threads=2).params)
    monkeypatch.setenv("MODFUN_NUM_THREADS", "2")
    np.testing.assert_array_equal(alone.params, mf.fit_many(batch, TF20).params)
    monkeypatch.setenv("MODFUN_NUM_THREADS", "many")
    with pytest.raises(mf.SpecError, match="MODFUN_NUM_THREADS='many'"):
        mf.fit_many(batch, TF20)


def test_lists_alike_and_unlike(batch):
    records = [batch[k] for k in range(3)]
    np.testing.assert_array_equal(
        mf.fit_many(records, TF20).params,
        mf.fit_many(mf.Batch(y=batch.y[:3], u=batch.u, dt=batch.dt), TF20).params,
    )
    unlike = mf.fit_many([batch[0], batch[1].window(0, 8)], TF20)
    again = mf.fit(batch[1].window(0, 8), TF20, band=unlike.band)
    np.testing.assert_array_equal(unlike.params[1], again.params)


def test_a_bad_replicate_leaves_the_others_alone(batch):
    y = batch.y.copy()
    y[3, 0, 5] = np.nan
    many = mf.fit_many(mf.Batch(y=y, u=batch.u, dt=batch.dt), TF20)
    assert many.failures == {"nonfinite": 1}
    good = np.arange(50) != 3
    assert np.array_equal(many.success, good)
    assert np.array_equal(many.usable, good)
    np.testing.assert_array_equal(many.params[good], mf.fit_many(batch, TF20).params[good])
    assert "49 ok, 1 nonfinite" in repr(many)
    assert many.table().title == "49 of 50 fits have an estimate"
    assert "<table" in many._repr_html_()


def test_names_and_cov_type(batch):
    many = mf.fit_many(batch, TF20, cov_type="nonrobust")
    np.testing.assert_array_equal(many["a2"], many.params[:, 1])
    assert not np.array_equal(many.bse, mf.fit_many(batch, TF20).bse)
    with pytest.raises(mf.SpecError, match="a1, a2, b0"):
        many["a3"]


def test_progress_is_shown_on_request_only(batch, capsys):
    mf.fit_many(batch, TF20)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("call", "error", "cure"),
    [
        (lambda b: mf.fit_many(b, TF20, bnad=8.0), mf.SpecError, "'band'"),
        (lambda b: mf.fit_many(b, "tf"), mf.SpecError, "TransferFunction"),
        (lambda b: mf.fit_many([], TF20), mf.DataError, "at least one"),
        (lambda b: mf.fit_many(b.y, TF20), mf.SpecError, "make a Record"),
        (lambda b: mf.fit_many(b, TF20, threads=1.5), mf.SpecError, "whole number"),
        (lambda b: mf.fit_many(b, mf.TransferFunction(poles=2, zeros=[0, 0])), mf.SpecError, "one per input"),
        (lambda b: mf.fit_many(b, TF20, harmonics=500), mf.ModfunError, "harmonic"),
        (
            lambda b: mf.fit_many(mf.Batch(y=np.full((2, 257), np.nan), u=b.u, dt=b.dt), TF20),
            mf.DataError,
            "not finite",
        ),
    ],
)
def test_bad_input_is_refused_with_the_cure(batch, call, error, cure):
    with pytest.raises(error, match=cure):
        call(batch)


def test_the_level_of_intervals_is_a_probability(batch):
    many = mf.fit_many(batch, TF20)
    with pytest.raises(mf.SpecError, match=r"conf_int: level=95 must lie between 0 and 1, as 0\.95"):
        many.conf_int(95)


@pytest.mark.parametrize(("method", "ratio"), [("ml", 0.6), ("awls", 1.0)])
def test_records_that_go_astray_start_again_in_a_batch(method, ratio):
    """Of every second record noise rules the wide band and leads `wls` astray: it alone has a second start.

    The minimum is that of a single fit, which always has both starts; no bit depends on the records beside.
    """
    t = np.linspace(0, 10, 257)
    clean = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256)
    noise = ratio * clean.std() * np.random.default_rng(0).standard_normal((64, 257))
    noise[::2] *= 0.05
    noisy = mf.Batch(y=clean + noise, u=np.sin(t**2 / 5), dt=10 / 256)
    many = mf.fit_many(noisy, TF20, method=method, harmonics=100)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        single = [mf.fit(noisy[k], TF20, method=method, harmonics=100) for k in range(64)]
    assert many.success.all()
    np.testing.assert_allclose(many.cost, [one.cost for one in single], rtol=1e-9)
    np.testing.assert_allclose(many.params, [one.params for one in single], rtol=1e-6)
    assert np.max(many.nit) > 50  # two ways
    beside = mf.fit_many([noisy[k] for k in range(3, 64)], TF20, method=method, harmonics=100, threads=2)
    np.testing.assert_array_equal(beside.params, many.params[3:])


def changing_batch(count: int, level: Any, delay: float = 0.0) -> mf.Batch:
    clean = mf.simulate(mf.tf([5], [1, 3, 8], delay=delay), input="sin(t**2/5)", duration=10.0, intervals=256)
    noise = np.random.default_rng(5).standard_normal((count, clean.t.size)) * level
    noise *= 0.1 * np.sqrt(np.mean(clean.y**2) / np.mean(np.square(level)))
    return mf.Batch(clean.y + noise[:, None], clean.u, clean.dt)


LOUD = np.where(np.arange(257) > 154, 4.0, 1.0)


@pytest.mark.statistics
def test_errors_of_a_batch_allow_for_noise_that_changes() -> None:
    """150 records: coverage of 0.945 over three parameters, known to 0.013; below 0.905 in 1 of 1,000."""
    structure, truth = mf.TransferFunction(poles=2, zeros=0), np.array([3.0, 8.0, 5.0])
    many = mf.fit_many(changing_batch(150, LOUD), structure)
    assert many.changing.all()
    limits = many.conf_int()
    assert np.mean((limits[..., 0] < truth) & (limits[..., 1] > truth)) > 0.905
    assert np.median(many.bse / many.bse_even) > 1.2
    assert "the noise of 150 changes over the record" in str(many.table())


@pytest.mark.parametrize(
    ("count", "rows", "said"), [(0, 20, False), (2, 20, False), (3, 20, True), (20, 20, True), (1, 1, True)]
)
def test_the_title_does_not_report_what_chance_finds(count: int, rows: int, said: bool) -> None:
    """The noise of 1 of 200 ordinary records was said to change, which the test finds in one of a hundred."""
    many = mf.fit_many(changing_batch(20, 1.0), mf.TransferFunction(poles=2, zeros=0))
    many = replace(many, status=np.where(np.arange(20) < rows, "ok", "rank"))
    many.__dict__["_looked"] = np.arange(20) < count, many.bse_even
    assert ("changes over the record" in str(many.table())) is said


@pytest.mark.statistics
def test_errors_of_a_batch_with_even_noise_stay() -> None:
    """Of 400 records 4 should have p < 0.01: more than 12 in 1 of 3,000."""
    many = mf.fit_many(changing_batch(400, 1.0), mf.TransferFunction(poles=2, zeros=0))
    assert many.changing.sum() <= 12
    np.testing.assert_array_equal(many.bse[~many.changing], many.bse_even[~many.changing])


@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_a_batch_and_single_fits_find_the_same_noise(lag: float) -> None:
    structure = mf.TransferFunction(poles=2, zeros=0, delay=lag)
    batch = changing_batch(6, np.array([1.0, 1.0, 1.0, 4.0, 4.0, 4.0])[:, None] ** (LOUD > 1), lag)
    many = mf.fit_many(batch, structure)
    listed = mf.fit_many([batch[k] for k in range(6)], structure)
    assert many.changing.tolist() == listed.changing.tolist() == [False] * 3 + [True] * 3
    np.testing.assert_array_equal(many.bse, listed.bse)
    for k in range(6):
        alone = mf.fit(batch[k], structure, band=many.band)
        assert alone.changing == many.changing[k]
        np.testing.assert_allclose(many.bse[k], alone.bse, rtol=1e-9)
    one_by_one = mf.fit_many([batch[5], batch[5].window(0.0, 9.0)], structure)
    assert one_by_one.changing.tolist() == [True, True]
    assert np.all(one_by_one.bse != one_by_one.bse_even)


AIRCRAFT = mf.StateSpace(A=[["Zw", "1"], ["Mw", "Mq"]], B=[["0"], ["Mde"]], states=["w", "q"], inputs=["de"])
EQUATIONS: dict[str, tuple[Any, dict[str, float]]] = {
    "Duffing": (mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u"), {"a": 0.5, "b": 4.0, "c": 1.0, "d": 3.0}),
    "state space": (AIRCRAFT, {"Zw": -0.8, "Mw": -4.0, "Mq": -1.5, "Mde": -6.0}),
}


def equation_batch(kind: str, count: int, level: Any) -> mf.Batch:
    structure, truth = EQUATIONS[kind]
    model = structure.model(truth)
    clean = mf.simulate(model, input="sin(t**2/5)", duration=10.0, intervals=256)
    size = 0.05 * np.sqrt(np.mean(clean.y**2, axis=1, keepdims=True) / np.mean(np.square(level)))
    drawn = np.random.default_rng(6).standard_normal((count, *clean.y.shape))
    y = clean.y + size * level * drawn
    return mf.Batch(y, clean.u, clean.dt, outputs=clean.outputs, inputs=clean.inputs)


@pytest.mark.statistics
@pytest.mark.parametrize("kind", EQUATIONS)
def test_errors_of_a_batch_of_equations_allow_for_noise_that_changes(kind: str) -> None:
    """80 records: coverage of 0.94 over four parameters, known to 0.018; below 0.885 in 1 of 1,000.

    Even noise: of 200 records 2 should have p < 0.01, more than 8 in 1 of 4,000.
    """
    structure, truth = EQUATIONS[kind]
    many = mf.fit_many(equation_batch(kind, 80, LOUD), structure)
    assert many.changing.all()
    limits, true = many.conf_int(), np.array([truth[name] for name in many.param_names])
    assert np.mean((limits[..., 0] < true) & (limits[..., 1] > true)) > 0.885
    assert np.median(many.bse / many.bse_even) > 1.1
    even = mf.fit_many(equation_batch(kind, 200, 1.0), structure)
    assert even.changing.sum() <= 8
    np.testing.assert_array_equal(even.bse[~even.changing], even.bse_even[~even.changing])


@pytest.mark.parametrize("kind", EQUATIONS)
def test_a_batch_of_equations_and_single_fits_find_the_same_noise(kind: str) -> None:
    structure, _ = EQUATIONS[kind]
    batch = equation_batch(kind, 4, np.array([1.0, 1.0, 4.0, 4.0])[:, None, None] ** (LOUD > 1))
    many = mf.fit_many(batch, structure)
    assert many.changing.tolist() == [False, False, True, True]
    for k in range(4):
        alone = mf.Estimator(structure, band=many.band)(batch[k])
        assert alone.changing == many.changing[k]
        np.testing.assert_allclose(many.bse[k], alone.bse, rtol=1e-6)
    wide = mf.fit_many(batch, structure, band=65.0)  # few lines are left above the band: each record alone
    assert wide.changing.tolist() == [False, False, True, True]


def test_a_study_of_an_equation_allows_for_noise_that_changes() -> None:
    structure, truth = EQUATIONS["Duffing"]
    clean = mf.simulate(structure.model(truth), input="sin(t**2/5)", duration=10.0, intervals=256)

    def make(cell: Any, rng: np.random.Generator) -> mf.Record:
        return clean.assign(y=clean["y"] + 0.02 * LOUD * rng.standard_normal(LOUD.size))

    words: dict[str, Any] = {"generate": make, "truth": truth, "replicates": 40, "seed": 3}
    estimators = {kind: mf.Estimator(structure, cov_type=kind) for kind in ("spectral", "nonrobust")}
    found = mf.MonteCarlo(**words, estimators=estimators).run(progress=False)
    covered = found.coverage.reshape(2, -1).mean(axis=1)
    assert covered[0] > covered[1] + 0.05


def test_what_lies_above_the_band_has_no_ends() -> None:
    """Of a drifting sinusoid below the line nothing is left; of noise what its lines have."""
    t = np.arange(256) / 256
    smooth = 3 * t**2 - t + np.sin(2 * np.pi * 5.3 * t)
    noise = np.random.default_rng(1).standard_normal(256)
    rest, left = above(np.array([smooth, noise]), 40)
    assert np.sqrt(np.mean(rest**2)) < 2e-3
    assert np.mean(left**2) == pytest.approx(1 - 81 / 256, abs=0.15)
    np.testing.assert_allclose(np.fft.rfft(left)[:41], 0.0, atol=1e-6)


def test_batches_that_have_no_test_of_changing_noise() -> None:
    batch, structure = changing_batch(3, LOUD), mf.TransferFunction(poles=2, zeros=0)
    words: list[dict[str, Any]] = [{"cov_type": "HC3"}, {"method": "wls"}, {"noise": "coloured"}]
    for word in words:
        many = mf.fit_many(batch, structure, **word)
        assert not many.changing.any()
        np.testing.assert_array_equal(many.bse, many.bse_even)
    assert pickle.loads(pickle.dumps(mf.fit_many(batch, structure))).changing.all()


def test_an_input_that_a_batch_lacks_is_in_its_table():
    """`fit_many` said nothing: no record is looked at until its results are."""
    t = np.arange(0.0, 20.001, 0.05)
    rng, system = np.random.default_rng(1), mf.tf([5], [1, 3, 8])
    u = np.sin(t**2 / 8 + np.arange(20)[:, None])
    other = np.repeat(rng.choice([-1.0, 1.0], (20, 41)), 10, axis=1)[:, : t.size]
    y = np.array([system.simulate(u=own, dt=0.05, intersample="smooth") for own in u])
    whole = y + np.array([system.simulate(u=own, dt=0.05, intersample="zoh") for own in other])
    noise = 0.1 * rng.standard_normal(y.shape)
    wrong, right = (
        mf.fit_many(mf.Batch(y=own + noise, u=u[:, None], dt=0.05, intersample="smooth"), TF20)
        for own in (whole, y)
    )
    assert "records that were fitted alone raise doubts; record 0: The residuals are" in str(wrong.table())
    assert wrong.doubts[0] in repr(wrong)
    assert pickle.loads(pickle.dumps(wrong)).doubts == wrong.doubts
    assert right.doubts == ()


def test_a_batch_has_relative_noise_of_its_samples(batch):
    level = np.where(np.arange(257) > 128, 3.0, 1.0)
    told = {"u": batch.u, "dt": batch.dt, "intersample": batch.intersample}
    each = np.stack([level * (k + 1) for k in range(4)])[:, None]
    for sigma in (level, level[None], each):
        weighted = pickle.loads(pickle.dumps(mf.Batch(y=batch.y[:4], sigma=sigma, **told)))
        many = mf.fit_many(weighted, TF20, progress=False)
        singly = mf.fit_many([batch[k].weigh(sigma=level) for k in range(4)], TF20, progress=False)
        np.testing.assert_allclose(many.params, singly.params, rtol=1e-9)
        np.testing.assert_allclose(many.bse, singly.bse, rtol=1e-9)
    alone = mf.Batch(y=batch.y[:4], dt=batch.dt, sigma=level)
    first = mf.sinusoids(alone[0], count=1)
    np.testing.assert_allclose(mf.sinusoids(alone, count=1).params[0], first.params, rtol=1e-6)
    with pytest.raises(mf.SpecError, match="share the weights"):
        mf.sinusoids(mf.Batch(y=batch.y[:4], dt=batch.dt, sigma=each), count=1)
    with pytest.raises(mf.DataError, match="sigma has shape"):
        mf.Batch(y=batch.y[:4], sigma=np.ones((3, 1, 257)), **told)
    with pytest.raises(mf.DataError, match="not positive and finite"):
        mf.Batch(y=batch.y[:4], sigma=-level, **told)


def test_a_number_is_answered_with_the_fit_of_one_record(batch):
    many = mf.fit_many(batch, TF20)
    with pytest.raises(mf.SpecError, match=r"FitMany: \[0\] is no parameter.* mf.fit\(records\[0\], model\)"):
        many[0]
