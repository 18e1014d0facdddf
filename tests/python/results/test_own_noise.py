"""Masked samples and samples of unlike noise outside of the fit: scores, bounds, what does not take them."""

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)


def record(seed=0, nsr=0.1, **weights):
    rec = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=seed)
    return rec.weigh(**weights) if weights else rec


def gap(size=257):
    ok = np.ones(size, bool)
    ok[60:75] = False
    ok[200] = False
    return ok


def spoilt(rec, ok):
    """The same with nonsense in the masked samples."""
    return mf.Record(y=np.where(ok, rec.y, 99.0), u=rec.u, dt=rec.dt, mask=ok)


# Scores -------------------------------------------------------------------------------------------


def test_masked_samples_count_in_no_score():
    ok, rec = gap(), record(1)
    fit = mf.fit(record(0), TF2)
    masked = spoilt(rec, ok)
    simulated, errors = fit.predict(masked), fit.errors(masked)
    assert simulated.mask is None
    np.testing.assert_array_equal(np.isnan(errors[0]), ~ok)
    np.testing.assert_array_equal(errors[0, ok], (rec.y - simulated.y)[0, ok])
    (row,) = fit.score(masked).rows
    y, own = rec.y[0, ok], simulated.y[0, ok]
    level = np.sqrt(np.mean((y - own) ** 2)) / np.std(y)
    assert row["signal_to_error"] == pytest.approx(-20 * np.log10(level), rel=1e-12)
    assert row["fit_percent"] == pytest.approx(100 * (1 - level), rel=1e-12)
    # What stands in the gap does not matter, and the scores are near those of the whole record.
    assert fit.score(rec.weigh(mask=ok)) == fit.score(masked)
    assert row["fit_percent"] == pytest.approx(fit.score(rec)["fit_percent"][0], abs=3)


def test_comparison_and_cross_validation_leave_masked_samples_out():
    ok = gap()
    records = [spoilt(record(seed), ok) for seed in range(3)]
    table = mf.cross_validate(records, {"two": mf.Estimator(TF2, band=12.0)})
    fit = mf.fit(records[1:], TF2, band=12.0)
    assert table["fit_percent"][0] == fit.score(records[0])["fit_percent"][0]
    assert (table["fit_percent"] > 80).all()
    assert mf.compare({"two": fit}, records[0])["r2"][0] == fit.score(records[0])["r2"][0]


@pytest.mark.parametrize("denominator", ["common", "separate"])
def test_several_outputs_are_compared_and_left_out(denominator):
    t = 0.05 * np.arange(401)
    u = np.sin(t**2 / 6)
    plant = mf.tf([[[1.0, 2.0]], [[-1.0, 0.7]]], [1, 1.2, 4.0])

    def run(seed):
        noise = [[0.05], [0.02]] * np.random.default_rng(seed).standard_normal((2, 401))
        return mf.Record(y=plant.simulate(u=u, dt=0.05) + noise, u=u, dt=0.05, outputs=["al", "q"])

    records = [run(seed) for seed in range(3)]
    structure = mf.TransferFunction(poles=2, zeros=1, denominator=denominator)
    fits = [mf.fit(records[:2], structure, band=6.0), mf.fit(records[1:], structure, band=6.0)]
    table = mf.compare(fits, records[2])
    assert table["output"].tolist() == ["al", "q"] * 2
    assert len(set(table["model"])) == 2
    for k, fit in enumerate(fits):
        np.testing.assert_array_equal(table["theil"][2 * k : 2 * k + 2], fit.score(records[2])["theil"])
    left = mf.cross_validate(records, [mf.Estimator(structure, band=6.0)])
    assert left["output"].tolist() == ["al", "q"] * 3
    assert left["record"].tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_array_equal(left["r2"][4:], fits[0].score(records[2])["r2"])
    np.testing.assert_array_equal(left["r2"][:2], fits[1].score(records[0])["r2"])
    short = left.summary()
    assert short["output"].tolist() == ["al", "q"]
    assert short["r2"][1] == np.median(left["r2"][1::2])


# The bound ----------------------------------------------------------------------------------------


def test_the_bound_of_a_masked_tail_is_that_of_the_shorter_record():
    rec = record()
    tail = np.arange(257) <= 150
    short = mf.crlb(SYSTEM, rec.window(0.0, 150 * rec.dt), sigma=0.1)
    np.testing.assert_allclose(mf.crlb(SYSTEM, rec.weigh(mask=tail), sigma=0.1).cov, short.cov, rtol=1e-9)


def test_the_bound_weighs_samples_by_their_noise():
    rec, ok = record(), gap()
    deaf = mf.crlb(SYSTEM, rec.weigh(sigma=np.where(ok, 1.0, 1e7)), sigma=0.1)
    masked = mf.crlb(SYSTEM, rec.weigh(mask=ok), sigma=0.1)
    np.testing.assert_allclose(deaf.cov, masked.cov, rtol=1e-6)
    assert (masked.sd > mf.crlb(SYSTEM, rec, sigma=0.1).sd).all()
    twice = mf.crlb(SYSTEM, rec.weigh(sigma=np.full(257, 2.0)), sigma=0.1)
    np.testing.assert_allclose(twice.cov, mf.crlb(SYSTEM, rec, sigma=0.2).cov, rtol=1e-12)


# What takes every sample alike ----------------------------------------------------------------------


ALIKE = {
    "rank_test": lambda rec: mf.rank_test(rec),
    "regressors": lambda rec: mf.regressors(rec, TF2, harmonics=6),
    "output error": lambda rec: mf.rivals.output_error(TF2)(rec),
    "pem": lambda rec: mf.rivals.pem(TF2)(rec),
    "arx": lambda rec: mf.rivals.arx(TF2)(rec),
    "initial_state": lambda rec: mf.fit(record(), TF2).initial_state(rec, method="observer"),
}


@pytest.mark.parametrize("name", ALIKE)
def test_weights_are_refused_where_they_would_be_lost(name):
    cure = "lstsq" if name == "initial_state" else "rec.window"
    with pytest.raises(mf.DataError, match=f"16 masked samples.*{cure}"):
        ALIKE[name](record(mask=gap()))
    with pytest.raises(mf.DataError, match="samples of unlike sigma"):
        ALIKE[name](record(sigma=np.linspace(1, 3, 257)))
    ALIKE[name](record(nsr=1e-3))


def two_outputs():
    rec = record()
    return mf.Record(y=np.vstack([rec.y, 2 * rec.y]), u=rec.u, dt=rec.dt, outputs=["al", "q"])


HELD = mf.TransferFunction(poles=2, zeros=0, params={"a2": 8.0})
LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=0.5))
REFUSED = {
    "orders of outputs": (lambda: mf.select_order(two_outputs()), "one at a time"),
    "orders by weights": (lambda: mf.select_order(record(), output_weights=[1.0]), "leave them out"),
    "orders in colour": (lambda: mf.select_order(record(), noise="coloured"), 'noise="output"'),
    "bound of which": (
        lambda: mf.crlb(SYSTEM, two_outputs().weigh(mask=gap()), sigma=1.0),
        r"rec.select\(outputs=\['al'\]\)",
    ),
    "arx, held": (lambda: mf.rivals.arx(HELD)(record()), "leave params= out"),
    "pem, late": (lambda: mf.rivals.pem(LATE)(record()), "known delays"),
    "arx of outputs": (lambda: mf.rivals.arx(TF2)(two_outputs()), "rec.select"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_taken_is_refused_in_a_sentence(case):
    call, cure = REFUSED[case]
    with pytest.raises(mf.SpecError, match=cure):
        call()
