"""A replicate's bits depend on its record alone: not on lane, batch, neighbours or threads."""

import numpy as np
import pytest
from core_fit import fit, fit_many
from oracle.lines import Record
from sample_records import eq24, random_record, white

KEYS = ("theta", "bse_nonrobust", "bse_hc3", "cost", "nit", "status")


def same_bits(first, second):
    for key in KEYS:
        a, b = np.asarray(first[key]), np.asarray(second[key])
        assert a.tobytes() == b.tobytes(), key


def take(found, index):
    return {key: np.asarray(found[key])[index] for key in KEYS}


def batch(structure):
    if structure == "eq24":
        record = eq24()
        return white(record, 0.3, 21, 5), record, 2, [0]
    record, _ = random_record(6, 4, 2, inputs=2, intervals=200)
    noise = np.random.default_rng(7).normal(size=(21, record.y.size))
    return record.y + 0.05 * np.std(record.y) * noise, record, 4, [2, 2]


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
@pytest.mark.parametrize("structure", ["eq24", "two inputs"])
def test_same_bits_in_any_lane_batch_and_company(structure, method):
    y, record, order, numerators = batch(structure)
    options = {"method": method, "harmonics": 14}

    def many(chosen, threads=1):
        return fit_many(chosen, record.u, record.dt, order, numerators, threads=threads, **options)

    whole = many(y)
    assert not np.any(whole["status"])
    for size in (1, 2, 3, 8, 9, 16):
        same_bits(many(y[:size]), take(whole, slice(0, size)))
    order_of = np.random.default_rng(1).permutation(21)
    same_bits(many(y[order_of]), take(whole, order_of))
    same_bits(many(y, threads=2), whole)
    for bad in (np.nan, np.inf, 1e300, 0.0):
        spoiled = y.copy()
        spoiled[[0, 5, 11]] = bad
        found = many(spoiled)
        kept = np.setdiff1d(np.arange(21), [0, 5, 11])
        same_bits(take(found, kept), take(whole, kept))
        if not np.isfinite(bad):
            assert np.all(found["status"][[0, 5, 11]] == 3)


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
def test_a_fit_is_a_batch_of_one(method):
    y, record, order, numerators = batch("eq24")
    for row in y[:4]:
        one = fit(replaced(record, row), order, numerators, method=method, harmonics=10)
        many = fit_many(row[None], record.u, record.dt, order, numerators, method=method, harmonics=10)
        assert one["theta"].tobytes() == many["theta"][0].tobytes()
        assert one["cost"] == many["cost"][0]
        assert one["nit"] == many["nit"][0]
        for kind in ("nonrobust", "hc3"):
            errors = np.sqrt(np.diag(one[f"cov_{kind}"]))
            assert errors == pytest.approx(many[f"bse_{kind}"][0], rel=1e-14)


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
def test_without_a_band_a_fit_and_a_batch_of_one_converge_to_the_same(method):
    """The fit goes on from where the band was chosen, the batch starts every replicate from `wls`."""
    y, record, order, numerators = batch("eq24")
    for row in y[:4]:
        one = fit(replaced(record, row), order, numerators, method=method)
        many = fit_many(row[None], record.u, record.dt, order, numerators, method=method)
        assert one["lines"] == many["lines"]
        assert one["theta"] == pytest.approx(many["theta"][0], rel=1e-8)


def replaced(record, y):
    return Record(y, record.u, record.dt, record.kinds)


def test_two_threads_give_the_bits_of_one_over_many_chunks():
    record = eq24()
    y = white(record, 0.2, 5_003, 8)
    first, second = (fit_many(y, record.u, record.dt, 2, [0], harmonics=6, threads=k) for k in (1, 2))
    same_bits(first, second)
