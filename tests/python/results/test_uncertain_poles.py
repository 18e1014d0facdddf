"""Poles that a record hardly determines: intervals that are too short are said to be so."""

import warnings

import modfun as mf
import numpy as np
import pytest


def _fits(num, den, nsr, seeds=20, **options):
    """Fits of records that hardly move above 4 rad/s, and what each warns of."""
    system, structure = mf.tf(num, den), mf.TransferFunction(poles=len(den) - 1, zeros=len(num) - 1)
    for seed in range(seeds):
        rec = mf.simulate(system, input="sin(t**2/5)", duration=10, intervals=256, nsr=nsr, seed=seed)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            fit = mf.fit(rec, structure, **options)
        yield fit, " ".join(str(one.message) for one in caught)


def test_a_mode_beyond_the_input_is_said_to_be_uncertain():
    """One of five intervals of 95 % held the truth, in silence: a light mode at 16 rad/s fitted the noise."""
    truth, inside, named, boot = np.array([6.0, 30.0, 20.0, 1.0, 20.0]), [], 0, []
    for fit, text in _fits([1, 20], [1, 6, 30, 20], 0.6, seeds=8, maxiter=300):
        low, high = fit.conf_int().T
        inside.append(np.mean((low < truth) & (truth < high)))
        # Those that fewer poles explain as well are named first, as modes in the noise.
        uncertain = "is uncertain: the standard error of its real part is" in text
        if uncertain or "explains no more than noise does by chance" in text:
            named += 1
            low, high = mf.bootstrap(fit, replicates=200, progress=False).conf_int().T
            boot.append(np.mean((low < truth) & (truth < high)))
    assert named >= 4
    assert np.mean(inside) < 0.4
    assert np.mean(boot) > np.mean(inside) + 0.3


@pytest.mark.parametrize("nsr", [0.1, 0.6])
def test_poles_that_the_record_determines_are_not(nsr):
    assert [text for _, text in _fits([5], [1, 3, 8], nsr) if text] == []


def test_check_names_what_is_a_little_uncertain():
    fits = [(str(fit.check()), text) for fit, text in _fits([5], [1, 3, 8], 1.0)]
    assert 1 <= sum("is uncertain" in check for check, _ in fits) <= 8
    assert sum("is uncertain" in text for _, text in fits) <= 3


def test_two_real_poles_near_each_other_are_not():
    assert [text for _, text in _fits([5], [1, 1, 0], 0.3) if "uncertain" in text] == []
