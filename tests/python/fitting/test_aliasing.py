"""What sampling folds into the output under held inputs is taken out of the sums."""

import modfun as mf
import numpy as np
import pytest

SYSTEMS = [
    ([1.0], [1.0, 1.0], 0.5),
    ([2.0, 5.0], [1.0, 3.0, 8.0], 0.1),
    ([5.0], [1.0, 3.0, 8.0], 0.25),
]


def stairs(seed, count=257, hold=4):
    return np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], count // hold + 2), hold)[:count]


def held(num, den, dt, seed, noise, kind="zoh", delay=0.0):
    u = stairs(seed)
    y = mf.tf(num, den, delay=delay).simulate(u=u, dt=dt, intersample=kind)
    e = np.random.default_rng(seed + 1000).standard_normal(y.size)
    return mf.Record(y=y + noise * np.std(y) * e, u=u, dt=dt, intersample=kind)


def structure(num, den, **words):
    return mf.TransferFunction(poles=len(den) - 1, zeros=len(num) - 1, **words)


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
@pytest.mark.parametrize(("num", "den", "dt"), SYSTEMS)
@pytest.mark.parametrize("delay", [0.0, 0.32])
def test_estimates_are_right_on_average(num, den, dt, delay):
    """At 1 % noise: three standard errors beside the truth before. The mean of 40 is known to 0.16 of one."""
    truth = np.array(den[1:] + num)
    z = []
    for seed in range(40):
        fit = mf.fit(held(num, den, dt, seed, 0.01, delay=delay), structure(num, den, delay=delay))
        z.append((fit.params - truth) / fit.bse)
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.6), np.mean(z, axis=0)


def unequal_ends(kind, seed=4):
    """An input that begins at 0 and ends at ±1: it jumps where the record's end meets its beginning."""
    u = stairs(seed, 201, 5)
    u[:10] = 0
    return np.interp(np.arange(201), np.arange(0, 201, 5), u[::5]) if kind == "foh" else u


@pytest.mark.parametrize("kind", ["zoh", "foh"])
@pytest.mark.parametrize("delay", [0.0, 1.2, 1.3])
@pytest.mark.parametrize(("num", "den"), [([0.4], [1.0, 0.2]), ([5.0], [1.0, 3.0, 8.0])])
def test_the_jump_at_the_ends_of_the_record(kind, delay, num, den):
    """It folds from a sample whatever the delay. Counted as the others, up to 4e-4 off."""
    truth, system = np.array(den[1:] + num), mf.tf(num, den, delay=delay)

    def record(seed):
        known = {"u": unequal_ends(kind, seed), "dt": 0.2, "intersample": kind}
        return mf.Record(y=system.simulate(**known), **known)

    rec, other = record(4), record(6)
    model = structure(num, den, delay=delay)
    free = structure(num, den, delay=mf.Free(delay, min=0.0, max=2.0))
    found = {
        "fit": mf.fit(rec, model).params,
        "batch": mf.fit_many([other, rec], model).params[1],
        "several": mf.fit([rec, other], model).params,
    }
    if delay:
        found["free delay"] = mf.fit(rec, free).params[:-1]
    for name, params in found.items():
        assert np.max(np.abs(params / truth - 1)) < 2e-5, (name, params)


@pytest.mark.parametrize("kind", ["zoh", "foh"])
def test_without_noise(kind):
    """(s + 5)/(s² + 3s + 8) at 26 samples a second: 0.4 % before, and next to nothing now."""
    num, den = [1.0, 5.0], [1.0, 3.0, 8.0]
    fit = mf.fit(held(num, den, 1 / 25.6, 0, 0.0, kind), structure(num, den))
    assert np.max(np.abs(fit.params / np.array([3.0, 8.0, 1.0, 5.0]) - 1)) < 1e-6


def test_a_free_delay_is_right_on_average():
    num, den = [2.0, 5.0], [1.0, 3.0, 8.0]
    model = structure(num, den, delay=mf.Free(0.2, min=0.0, max=0.5))
    z = []
    for seed in range(25):
        fit = mf.fit(held(num, den, 0.1, seed, 0.01, delay=0.23), model)
        z.append((fit["delay"] - 0.23) / fit.bse[-1])
    assert abs(np.mean(z)) < 0.8, np.mean(z)  # six before; the mean is known to 0.2


def test_several_outputs_and_batches():
    den = [1.0, 3.0, 8.0]
    system = mf.tf([[[2.0, 5.0]], [[4.0]]], den)
    model = mf.TransferFunction(poles=2, zeros=[[1], [0]], denominator="common")
    truth = np.array([3.0, 8.0, 2.0, 5.0, 4.0])
    records = []
    for seed in range(40):
        u = stairs(seed)
        y = system.simulate(u=u, dt=0.1, intersample="zoh")
        e = np.random.default_rng(seed + 1000).standard_normal(y.shape)
        y = y + 0.005 * np.std(y, axis=1, keepdims=True) * e
        records.append(mf.Record(y=y, u=u, dt=0.1, intersample="zoh"))
    single = [mf.fit(rec, model, harmonics=28) for rec in records]
    z = [(fit.params - truth) / fit.bse for fit in single]
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.6), np.mean(z, axis=0)
    many = mf.fit_many(records, model, harmonics=28)
    bse = np.array([fit.bse for fit in single])
    assert np.all(np.abs(many.params - [fit.params for fit in single]) < 0.02 * bse)


def test_studies():
    num, den = [2.0, 5.0], [1.0, 3.0, 8.0]
    study = mf.MonteCarlo(
        system=mf.tf(num, den), input=mf.signals.prbs("u", clock=0.4, dt=0.1, duration=25.6), nsr=[0.01],
        replicates=400, seed=1, estimators={"ml": mf.Estimator(structure(num, den))},
    )  # fmt: skip
    found = study.run(progress=False)
    bias, sd = np.squeeze(found.bias), np.squeeze(found.sd)
    assert np.all(np.abs(bias) < 0.4 * sd), bias / sd


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.25])
@pytest.mark.parametrize(("num", "den"), [([2.0, 1.0], [1.0, 2.0]), ([1.0, 3.0, 13.0], [1.0, 3.0, 8.0])])
def test_ends_of_the_record_with_feed_through(delay, num, den):
    """The last sample sees a step that no sample comes after: 0.5 to 1.7 % off before."""
    system, u = mf.tf(num, den, delay=delay), unequal_ends("zoh")
    known = {"u": u, "dt": 0.2, "intersample": "zoh"}
    fit = mf.fit(mf.Record(y=system.simulate(**known), **known), structure(num, den, delay=delay))
    assert np.max(np.abs(fit.params / np.array(den[1:] + num) - 1)) < 5e-5


def test_a_delay_that_samples_do_not_tell_is_refused():
    """A held input that acts at once: 90 to 350 standard errors off before, without a word."""
    rec = held([2.0, 1.0], [1.0, 2.0], 0.2, 0, 0.01, delay=0.25)
    model = structure([2.0, 1.0], [1.0, 2.0], delay=mf.Free(min=0.0, max=1.0))
    with pytest.raises(mf.SpecError, match=r"acts at once.*other numerators the samples are the same"):
        mf.fit(rec, model)
    with pytest.raises(mf.SpecError, match="Give the delay, take fewer zeros"):
        mf.fit_many([rec, rec], model)
    straight = held([2.0, 1.0], [1.0, 2.0], 0.2, 0, 0.01, "foh", delay=0.25)
    fit = mf.fit(straight, model)
    assert np.max(np.abs((fit.params - [2.0, 2.0, 1.0, 0.25]) / fit.bse)) < 4


AT_ONCE = [([2.0, 1.0], [1.0, 2.0], 0.15), ([1.0, 3.0, 13.0], [1.0, 3.0, 8.0], 0.15)]


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
@pytest.mark.parametrize(
    ("num", "den", "dt", "part"),
    [(*s, part) for s in AT_ONCE for part in (None, 0.66, 0.9)]
    + [([1.0, 2.0, 3.0, 4.0], [1.0, 3.0, 8.0, 6.0], 0.1, part) for part in (None, 0.66)],
)
def test_inputs_that_act_at_once(num, den, dt, part):
    """Up to these parts of half the sampling rate; 3 to 7 standard errors off before, or nowhere.

    Of 25 records the mean of z is known to 0.2 and its mean square to 0.28: false alarm below 1e-3.
    """
    truth, band = np.array(den[1:] + num), None if part is None else part * np.pi / dt
    z = []
    for seed in range(25):
        fit = mf.fit(held(num, den, dt, seed, 0.02), structure(num, den), band=band)
        z.append((fit.params - truth) / fit.bse)
    print(np.mean(z, axis=0), np.mean(np.square(z), axis=0))
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.8)
    assert np.all(np.mean(np.square(z), axis=0) < 2.2)


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_batches_and_studies_of_inputs_that_act_at_once():
    num, den, dt = AT_ONCE[1]
    records = [held(num, den, dt, seed, 0.02) for seed in range(9)]
    model, edge = structure(num, den), 0.66 * np.pi / dt
    single = np.array([mf.fit(rec, model, band=edge).params for rec in records])
    np.testing.assert_allclose(mf.fit_many(records, model, band=edge).params, single, rtol=1e-5)
    study = mf.MonteCarlo(
        system=mf.tf(num, den), input=mf.signals.prbs("u", clock=0.6, dt=dt, duration=38.4), nsr=[0.05],
        replicates=200, seed=1, estimators={"ml": mf.Estimator(model)},
    )  # fmt: skip
    found = study.run(progress=False)
    bias, sd = np.squeeze(found.bias), np.squeeze(found.sd)
    assert np.all(np.abs(bias) < 0.4 * sd), bias / sd
