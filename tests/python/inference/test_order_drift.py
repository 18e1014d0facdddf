"""Orders of records whose output drifts: the drift is named, and none where there is none."""

import modfun as mf
import numpy as np
import pytest
from heater import INTEGRATOR, LAG, bump_test
from modfun.commands.main import main

pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


def chosen(rec, poles=(1, 2), **options):
    """The selection, its notes, and the poles and zeros of the best."""
    found = mf.select_order(rec, poles=poles, **options)
    return found, " ".join(found.notes), (found.best.structure.poles, found.best.structure.zeros)


@pytest.mark.parametrize("seed", range(5))
def test_a_drift_that_a_pole_imitates_is_named(seed):
    """Two poles were chosen without a word, or of three candidates the worst that cancelled nothing."""
    rec = bump_test(LAG, seed, drift=0.02)
    found, notes, orders = chosen(rec)
    assert orders == (2, 1)
    assert 'poles=1, zeros=0, trend="linear", BIC falls from' in notes
    assert 'First try mf.select_order(..., trend="linear").' in notes
    assert notes in str(found).replace("\n", " ")
    assert "unstable" not in notes  # the advice to take another candidate without a drift
    assert any("may be a drift" in text for text in found.best.check())
    _, notes, orders = chosen(rec, trend="linear")
    assert orders == (1, 0)
    assert "drift" not in notes


def test_a_drift_beside_an_unknown_delay_is_named():
    rec = bump_test(mf.tf([1.8], [390, 1], delay=72), 1, drift=0.02)
    found, notes, _ = chosen(rec, delay=mf.Free(min=0, max=300))
    assert 'poles=1, zeros=0, trend="linear", BIC falls from' in notes
    assert any("may be a drift" in text for text in found.best.check())


def test_a_drift_that_nothing_imitates_is_named():
    """With one pole only, by as much as the criterion of the drifting candidate says."""
    rec = bump_test(LAG, 0, drift=0.02)
    _, notes, _ = chosen(rec, poles=1)
    fall = float(notes.split("falls by ")[1].split(":")[0])
    assert 'With trend="linear", the ' in notes
    assert fall > 30
    assert "trend" not in chosen(bump_test(LAG, 0), poles=1)[1]


@pytest.mark.parametrize("seed", range(6))
def test_no_drift_is_named_where_there_is_none(seed):
    """In none of 96 integrators and 120 lags."""
    for plant in (INTEGRATOR, LAG):
        found, notes, _ = chosen(bump_test(plant, seed))
        assert "drift" not in notes
        assert "may be a drift" not in str(found.best.check())


def test_of_candidates_that_cancel_one_far_below_all_others_is_taken():
    """The pair explains the drift: without it the criterion was 1,500 higher, and four poles unstable."""
    found, _, orders = chosen(bump_test(LAG, 0, drift=0.02), poles=range(1, 4))
    at = found.fits.index(found.best)
    assert found.table["cancelling"][at] < 1
    assert found.table[found.criterion][at] == np.min(found.table[found.criterion])
    assert orders == (2, 1)


def test_the_shell_prints_the_drift(tmp_path, capsys):
    bump_test(LAG, 0, drift=0.02).to_csv(tmp_path / "run.csv")
    words = ["--output", "y", "--input", "u", "--intersample", "zoh", "--poles", "1:2"]
    assert main(["order", str(tmp_path / "run.csv"), *words]) == 0
    assert 'poles=1, zeros=0, trend="linear", BIC falls from' in capsys.readouterr().out
