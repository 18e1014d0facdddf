"""docs/initial_state.md: what its script finds is what the page says."""

import sys

import modfun as mf
import numpy as np
import pytest
from places import ROOT


@pytest.fixture(scope="module")
def bench():
    sys.path.insert(0, str(ROOT / "benches"))
    import initial_state

    sys.path.pop(0)
    return initial_state


def test_the_table_of_eigenvalues(bench):
    found = bench.over_eigenvalues(2000)
    page = (ROOT / "docs" / "initial_state.md").read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(): line for line in page.splitlines() if line.startswith("| ")}
    for (name, own), word in zip(found.items(), ("ζ = 0.53", "ζ = 0.1", "third order"), strict=True):
        shown = [float(cell) for cell in rows[word].split("|")[2:-1]]
        np.testing.assert_allclose(own["its own answer"], shown, atol=0.0051, err_msg=name)
        # Mirrored eigenvalues: least squares itself.
        assert own["its own answer"][bench.FACTORS.index(1.0)] == pytest.approx(1.0, abs=1e-3)
    zero = [float(cell) for cell in rows["ζ = 0.1, started from zero"].split("|")[2:-1]]
    np.testing.assert_allclose(found["light, ζ = 0.1"]["zero"], zero, atol=0.0051)


def test_its_observer_is_that_of_the_fit(bench):
    system = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(system, **bench.CHIRP, initial_state=[1.0, -2.0], nsr=0.1, seed=4)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), trend=None, band=6.0)
    eigenvalues = bench.faster(fit.model, 4.0)
    ss = fit.model.to_ss()
    left = rec.y[0] - fit.model.simulate(u=rec.u, dt=rec.dt)
    twin = bench.observed(ss.A, ss.C, left[:, None], rec.dt, eigenvalues, "its own answer")
    found = fit.initial_state(method="observer", eigenvalues=eigenvalues)
    np.testing.assert_allclose(twin[:, 0], found.state, rtol=1e-8)


def test_errors_and_signal_to_error_after_a_fit(bench):
    found = bench.over_noise(replicates=6)
    for name in ("least squares", "observer", "observer, 4 times as fast"):
        assert list(found[name].values()) == sorted(found[name].values())
    for nsr in bench.LEVELS:
        assert found["observer"][nsr] == pytest.approx(found["least squares"][nsr], rel=1e-2)
        lost = found["S/E, least squares"][nsr] - found["S/E, observer, 4 times as fast"][nsr]
        assert 0 <= lost < 0.2
