"""The rivals and studies of benches/nonlinear.py do what they say, before anything is measured with them."""

import importlib

import modfun as mf
import numpy as np
import pytest
from oracle import nonlinear as systems
from oracle.coefficients import weights
from places import ROOT

pytest.importorskip("sympy")
BENCHES = ROOT / "benches"


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHES))
    return importlib.import_module


def noisy(bench, nsr, records):
    y, u, dt = bench("nonlinear").duffing_record(512)
    sigma = nsr * np.sqrt(np.mean(y**2))
    return y + sigma * np.random.default_rng(3).standard_normal((records, *y.shape)), u, dt, sigma


def test_numpys_duffing_is_the_method_of_the_core(bench):
    y, u, dt, sigma = noisy(bench, 0.2, 6)
    other = bench("duffing_numpy").Duffing(u[0], dt, 15, sigma, weights("gregory", 512)).fit(y[:, 0])
    model = bench("nonlinear").DUFFING
    found = mf.fit_many(
        mf.Batch(y=y, u=u, dt=dt), model, harmonics=13, noise=mf.Noise(y=sigma), progress=False
    )
    place = [found.param_names.index(name) for name in "dab"]
    assert found.params[:, place] == pytest.approx(other, rel=1e-5)


def test_rivals_find_the_truth_where_noise_is_small(bench):
    y, u, dt, _ = noisy(bench, 1e-4, 1)
    rivals, study = bench("duffing_rivals"), bench("nonlinear")
    true = [study.DUFFING_TRUE[name] for name in "dab"]
    assert rivals.WeakForm(u[0], dt).fit(y[0, 0]) == pytest.approx(true, rel=2e-3)
    start = 1.05 * np.array(true)
    assert rivals.output_error(y[0, 0], study.duffing_input, dt, start) == pytest.approx(true, rel=2e-3)


def test_the_aircraft_is_that_of_the_oracle(bench):
    _, _, _, clean = bench("nonlinear").aircraft_record()
    assert clean == pytest.approx(systems.short_period().v, abs=2e-5)  # its input is smooth between samples


def test_a_study_counts_what_it_says(bench):
    """Thirty fits: biases below five standard errors of the mean, in the table's words."""
    study = bench("nonlinear")
    y, u, dt = study.duffing_record(512)
    sigma = 0.1 * np.sqrt(np.mean(y**2))
    found = bench("fit_studies").Study(study.DUFFING, study.DUFFING_TRUE, y, dt, sigma, (["y"], ["u"]), 30, u)
    bias, error, sd = found.relative()
    assert found.failures == 0
    assert found.params.shape == (30, 3)
    assert bias < 5 * error < sd < 5
    assert found.cells().count("|") == 5
