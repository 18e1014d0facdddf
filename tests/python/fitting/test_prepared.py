"""What is kept between fits changes no bit, serves threads at the same time, and does not grow."""

import itertools
import resource
import threading

import modfun as mf
import numpy as np
import pytest
from modfun.fitting import prepared
from modfun.results.diagnosis import surely_stable

# These records are to differ, not to be easy.
pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")

DT = 10 / 256
TF20 = mf.TransferFunction(poles=2, zeros=0)
CHOICES = [{"harmonics": 6, "trend": None}, {"band": (1.0, 9.0)}, {"harmonics": 12, "method": "awls"}, {}]


def noisy(seed, intervals=256):
    """A record in the setting of the report's eq. (24), of some size."""
    u = np.sin((DT * np.arange(intervals + 1)) ** 2 / 5)
    y = mf.tf([5], [1, 3, 8]).simulate(u=u, dt=DT)
    rng = np.random.default_rng(seed)
    y = 10 ** rng.uniform(-3, 3) * (y + 0.1 * rng.standard_normal(u.size))
    return mf.Record(y=y, u=u, dt=DT, intersample="smooth")


def bits(fit):
    arrays = (fit.params, fit.cov_nonrobust, fit.cov_hc3, fit.gram, fit.residuals)
    return (
        *(a.tobytes() for a in arrays),
        fit.cost,
        fit.sigma,
        fit.lines,
        fit.nit,
        fit.status,
        fit.band_rule,
    )


def fresh(record, **choices):
    """A fit by a core that nothing has used before."""
    prepared._kept.cache_clear()
    return mf.fit(record, TF20, **choices)


@pytest.fixture(scope="module")
def records():
    return [noisy(seed) for seed in range(12)]


@pytest.mark.parametrize("choices", CHOICES, ids=str)
def test_a_fit_does_not_feel_the_fits_before(records, choices):
    alone = [bits(fresh(record, **choices)) for record in records]
    prepared._kept.cache_clear()
    for order in (range(12), reversed(range(12))):
        for k in order:
            assert bits(mf.fit(records[k], TF20, **choices)) == alone[k], k
    assert prepared._kept.cache_info().misses == 1


@pytest.mark.parametrize("choices", CHOICES, ids=str)
def test_a_batch_does_not_feel_the_batches_before(records, choices):
    alone = []
    for k in range(12):
        prepared._kept.cache_clear()
        alone.append(mf.fit_many(records[k:], TF20, **choices))
    prepared._kept.cache_clear()
    for k in (0, 11, 3, 7, 0):
        again = mf.fit_many(records[k:], TF20, **choices)
        np.testing.assert_array_equal(again.params, alone[k].params)
        np.testing.assert_array_equal(again.bse, alone[k].bse)
        assert again.band == alone[k].band


@pytest.mark.parametrize("choices", CHOICES, ids=str)
def test_threads_at_the_same_time_get_the_bits_of_one_after_the_other(records, choices):
    alone = [bits(fresh(record, **choices)) for record in records]
    found = {}
    start = threading.Barrier(4)

    def work(part):
        start.wait()
        for _, k in itertools.product(range(10), range(part, 12, 4)):
            found.setdefault(k, set()).add(bits_key(mf.fit(records[k], TF20, **choices)))

    threads = [threading.Thread(target=work, args=(part,)) for part in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {k: {repr(alone[k])} for k in range(12)}


def bits_key(fit):
    return repr(bits(fit))


def test_uneven_and_long_records_are_not_kept():
    prepared._kept.cache_clear()
    t = np.sort(np.random.default_rng(0).uniform(0, 10, 200))
    mf.fit(mf.Record(y=np.sin(t) + 0.1 * np.cos(7 * t), u=np.cos(t), t=t), TF20, band=6.0)
    mf.fit(noisy(1, intervals=prepared.LONGEST), TF20, harmonics=20)
    assert prepared._kept.cache_info().currsize == 0


def test_ten_thousand_fits_of_other_lengths_do_not_grow():
    """Kept for ever, each would cost 40 kB or more; what is kept fits into 60 MB with room to spare."""
    long = noisy(0, intervals=2100)
    cut = [mf.Record(y=long.y[:, : n + 1], u=long.u[:, : n + 1], dt=DT) for n in range(100, 2100)]
    for record in cut[:100]:
        mf.fit(record, TF20, harmonics=6)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for record, harmonics in itertools.product(cut, range(6, 11)):
        prepared.prepare(TF20, mf.Estimator(TF20, harmonics=harmonics).options, (record,)).core.fit(
            [record.y], [record.u]
        )
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert prepared._kept.cache_info().currsize == prepared.KEPT
    assert after - before < 60_000


def test_options_are_checked_however_often_and_whatever_came_before():
    rec = noisy(2)
    mf.fit(rec, TF20, harmonics=6, extended=True, maxiter=1, tol=0.5)
    for wrong in (
        {"extended": 1},
        {"maxiter": True},
        {"maxiter": 1.0},
        {"harmonics": 6.0},
        {"method": ["ml"]},
    ):
        for _ in range(2):
            with pytest.raises(mf.SpecError):
                mf.fit(rec, TF20, **wrong)
    mf.fit(rec, TF20, band=(0, 8.0))
    with pytest.raises(mf.SpecError, match="number"):
        mf.fit(rec, TF20, band=(False, 8.0))
    assert mf.fit(rec, TF20, band=[0, 8.0]).options == mf.fit(rec, TF20, band=8).options


def test_surely_stable_is_never_wrong_and_seldom_shy():
    rng = np.random.default_rng(3)
    said = {True: 0, False: 0}
    for _ in range(3000):
        pairs = rng.uniform(-2, 0.4, rng.integers(0, 4)) + 1j * rng.uniform(0, 5)
        real = rng.uniform(-3, 0.4, rng.integers(1, 4))
        den = np.poly([*pairs, *pairs.conj(), *real]).real
        stable = bool(np.max(np.roots(den).real) < 0)
        answer = surely_stable(den.tolist())
        assert stable or not answer
        said[stable] += answer == stable
        if stable:
            assert answer
    assert min(said.values()) > 300
    assert not surely_stable([1.0, 0.0, 8.0])
    assert not surely_stable([1.0, -1e-300])
    assert not surely_stable([1.0, float("nan"), 1.0])
