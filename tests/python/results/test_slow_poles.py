"""Slow poles: a drift of the output, which they imitate, is told from a system that integrates."""

import modfun as mf
import numpy as np
import pytest
from heater import INTEGRATOR, LAG, bump_test

pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
TWO = {zeros: mf.TransferFunction(poles=2, zeros=zeros) for zeros in (0, 1)}


@pytest.mark.parametrize("drift", [0.01, 0.02, 0.2])
def test_a_drift_is_named_where_a_pole_imitates_it(drift):
    """Nothing was said in 6 of 10, and in the others that the system may integrate."""
    for seed in range(5):
        rec = bump_test(LAG, seed, drift=drift)
        fit = mf.fit(rec, TWO[1])
        (said,) = [text for text in fit.check() if "may be a drift" in text]
        assert 'poles=1, zeros=0, trend="linear"' in said
        assert not any("integrates" in text for text in fit.check())
        before, after = (float(part.split()[0].rstrip(".")) for part in said.split("from ")[1].split(" to "))
        assert before == pytest.approx(fit.bic, abs=0.1)
        low, high = fit.band
        cure = mf.fit(
            rec, mf.TransferFunction(poles=1, zeros=0), trend="linear", band=(low, high * (1 + 1e-9))
        )
        assert after == pytest.approx(cure.bic, abs=0.5)
        assert after < before
        assert np.all(np.abs(cure.params - [1 / 390, 1.8 / 390]) < 4 * cure.bse)


def test_a_system_that_integrates_is_told_from_a_drift():
    """The drift in its place is tried, and raises BIC by hundreds."""
    named = 0
    for seed in range(10):
        text = str(mf.fit(bump_test(INTEGRATOR, seed), TWO[0]).check())
        assert "may be a drift" not in text
        if "A pole is not told from 0" in text:
            named += 1
            assert "A drift in its place explains less" in text
            assert float(text.split("BIC rises by ")[1].split()[0].rstrip(".")) > 100
    assert named > 2


@pytest.mark.parametrize("seed", range(5))
def test_a_superfluous_pole_is_no_drift(seed):
    """A smaller structure explains an integrator without a drift, too."""
    text = str(mf.fit(bump_test(mf.tf([1.8 / 390], [1, 0]), seed), TWO[1]).check())
    assert "may be a drift" not in text
