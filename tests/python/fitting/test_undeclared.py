"""Inputs that nobody declared and that look the same held and smooth: the fit finds out which they were."""

import warnings

import loops
import modfun as mf
import numpy as np
import pytest
from loops import DT, LEVEL, MODEL

PLANT = mf.tf([5], [1, 3, 8])


def undeclared(seed: int, level: float = LEVEL) -> mf.Record:
    y, u = loops.flown(level, seed)
    return mf.Record(y=y, u=u, dt=DT, keep={"r": loops.command()})


def rough(seed: int, *, held: bool, nsr: float = 0.05, intersample: str = "auto") -> mf.Record:
    """White noise held for a sample each, or sines measured with as much noise as a third of them."""
    rng, dt, n = np.random.default_rng(seed), 0.1, 400
    if held:
        u = seen = rng.standard_normal(n + 1)
    else:
        u = sum(np.sin(w * dt * np.arange(n + 1) + rng.uniform(0, 6)) for w in (0.5, 1.1, 1.9, 3.1, 4.7))
        seen = u + 0.3 * u.std() * rng.standard_normal(n + 1)
    y = PLANT.simulate(u=u, dt=dt, intersample="zoh" if held else "smooth").ravel()
    y = y + nsr * y.std() * rng.standard_normal(n + 1)
    return mf.Record(y=y, u=seen, dt=dt, intersample=intersample)


def quiet(*args, **words):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mf.fit(*args, **words)


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_loop_closed_by_a_computer_is_read_as_held(share):
    """Read as smooth, the damping was 4 to 8 standard errors off."""
    for seed in range(5):
        rec = undeclared(seed, share * LEVEL)
        assert rec.intersample == ("smooth",)
        for words in ({}, {"reference": "r"}):
            fit = quiet(rec, MODEL, **words)
            told = quiet(loops.record(share * LEVEL, seed), MODEL, **words)
            assert fit.intersample == ("zoh",)
            assert np.array_equal(fit.params, told.params)
            assert fit.records[0]._between_words() == ["zoh (by the fit)"]
    many = mf.fit_many([undeclared(seed) for seed in range(2)], MODEL, reference="r", progress=False)
    told = mf.fit_many([loops.record(LEVEL, seed) for seed in range(2)], MODEL, reference="r", progress=False)
    assert np.array_equal(many.params, told.params)


def test_a_loop_whose_noise_hides_the_hold_is_assumed_held_and_doubted():
    fit = quiet(undeclared(0, 3 * LEVEL), MODEL, reference="r")
    assert fit.intersample == ("zoh",)
    assert "is assumed held" in str(fit.records[0].check())
    assert "(doubtful)" in repr(fit.records[0])


def test_open_inputs_are_what_the_fit_prefers():
    """Rates over 40 records: held for one sample each 100 %, smooth 98 %, with limits of one in twelve."""
    read = [quiet(rough(seed, held=True), mf.TransferFunction(poles=2, zeros=0)) for seed in range(12)]
    assert [fit.intersample for fit in read] == [("zoh",)] * 12
    error = np.array([(fit.params - [3, 8, 5]) / fit.bse for fit in read])
    assert np.max(np.abs(error.mean(axis=0))) < 3.3 / np.sqrt(12)
    read = [quiet(rough(seed, held=False), mf.TransferFunction(poles=2, zeros=0)) for seed in range(12)]
    assert sum(fit.intersample == ("smooth",) for fit in read) >= 11


def test_what_is_declared_wins():
    for word in ("smooth", "zoh", "foh"):
        rec = rough(0, held=True, intersample=word)
        fit = quiet(rec, mf.TransferFunction(poles=2, zeros=0))
        assert fit.intersample == (word,)
        assert fit.records[0] is rec


def test_a_record_to_predict_is_read_as_those_of_the_fit():
    fit = quiet(rough(0, held=True), mf.TransferFunction(poles=2, zeros=0))
    other = rough(1, held=True)
    held = other._like(intersample=("zoh",))
    assert np.array_equal(fit.predict(other).y, fit.predict(held).y)
    declared = rough(1, held=True, intersample="smooth")
    assert not np.allclose(fit.predict(other).y, fit.predict(declared).y)


def test_equations_are_asked_too():
    equation = mf.Equation("y'' + a1*y' + a2*y = b0*u + c")
    assert quiet(rough(0, held=True, nsr=0.02), equation).intersample == ("zoh",)
