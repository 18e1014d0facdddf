"""Numbers of Bode diagrams with standard errors, and what a fit offers for completion."""

import re
from pathlib import Path

import modfun as mf
import numpy as np
import pytest
from modfun.results.drawn import INSIDE

REC = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
TF2 = mf.TransferFunction(poles=2, zeros=0)
PAGES = Path(__file__).parents[3] / "docs"


@pytest.fixture(scope="module")
def fit():
    return mf.fit(REC, TF2)


def test_errors_are_those_of_the_delta_method(fit):
    """At rest by an expression; elsewhere by differences of the fitted system's own response."""
    rest = fit.bode([1e-9])
    known = fit.derived(level="20*log(b0/a2)/log(10)")
    assert rest["magnitude_db"][0] == pytest.approx(known["value"][0])
    assert rest["magnitude_bse"][0] == pytest.approx(known["bse"][0], rel=1e-6)
    assert rest["phase_bse"][0] == pytest.approx(0, abs=1e-6)
    omega, slopes = np.array([0.7, 2.5, 4.0]), []
    for step in 1e-6 * np.eye(3):
        two = [mf.tf([b0], [1, a1, a2])(1j * omega) for a1, a2, b0 in (fit.params + step, fit.params - step)]
        slopes.append((np.log(two[0]) - np.log(two[1])) / 2e-6)
    table, slopes = fit.bode(omega), np.array(slopes)
    for name, part, unit in (
        ("magnitude_bse", slopes.real, 20 / np.log(10)),
        ("phase_bse", slopes.imag, 180 / np.pi),
    ):
        want = unit * np.sqrt(np.einsum("pf,pq,qf->f", part, fit.cov_params(), part))
        np.testing.assert_allclose(table[name], want, rtol=1e-5)
    np.testing.assert_allclose(table["phase_deg"], np.degrees(np.angle(fit.model(1j * omega))), rtol=1e-12)


def test_paths_follow_one_another():
    plant = mf.tf([[[5], [0]], [[1, 0], [3]]], [1, 1, 8])
    rec = mf.simulate(
        plant, input=["sin(t**2/5)", "sin(3*t)*cos(0.3*t**2)"], duration=20.0, intervals=512, nsr=0.1, seed=0
    )
    structure = mf.TransferFunction(poles=2, zeros=[[0, None], [1, 0]], denominator="common")
    found = mf.fit(rec, structure, band=6.0)
    table = found.bode([1.0, 2.0])
    assert table["output"].tolist() == ["y1", "y1", "y2", "y2", "y2", "y2"]
    assert table["input"].tolist() == ["u1", "u1", "u1", "u1", "u2", "u2"]
    want = np.abs(found.model(2j))[[0, 1, 1], [0, 0, 1]]
    np.testing.assert_allclose(table["magnitude_db"][1::2], 20 * np.log10(want), rtol=1e-9)


def test_default_frequencies_lie_in_the_band(fit):
    omega = fit.bode()["omega"]
    assert omega[0] == pytest.approx(fit.omega0[0])
    assert omega[-1] == pytest.approx(fit.band[1])


def test_state_spaces_and_fits_of_gains_have_one_and_nonlinear_equations_have_none():
    space = mf.fit(REC, mf.StateSpace([["a", 1], ["b", 0]], [0, "c"], [1, 0], outputs=["y"]))
    gains = mf.fit(mf.tf([5], [1, 3, 8]).frequency_response(np.geomspace(0.1, 9, 30)), TF2)
    for one in (space, gains):
        assert one.bode([2.0])["magnitude_db"][0] == pytest.approx(20 * np.log10(abs(one.model(2j))))
    with pytest.raises(mf.SpecError, match="is not asked for its frequency response"):
        mf.fit(REC, mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u")).bode([1.0])


def test_completion_offers_what_users_read(fit):
    offered = dir(fit)
    assert not set(INSIDE) & set(offered)
    assert {"params", "bode", "predict", "status", "records"} <= set(offered)
    every = [fit, mf.fit(REC, mf.Equation("y'' + a*y' + b*y = c*u"))]
    assert all(any(hasattr(one, name) for one in every) for name in INSIDE)
    assert fit._ipython_key_completions_() == fit.params._ipython_key_completions_() == ["a1", "a2", "b0"]


def test_no_page_reads_what_completion_hides():
    pages = [page.read_text() for page in PAGES.rglob("*.md")]
    found = {name for page in pages for name in re.findall(r"\bfit\d?\.([a-z_]+)", page)}
    assert not found & set(INSIDE)
