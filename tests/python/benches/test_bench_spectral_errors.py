"""benches/spectral_errors.py measures what its table says: intervals of each kind beside each other."""

import importlib

import numpy as np
import pytest
from places import ROOT


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benches"))
    return importlib.import_module("spectral_errors")


def test_intervals_of_each_kind_beside_each_other(bench):
    """17 rows less 5 unknowns; medians of 400 records are known to 0.02, the seed is fixed."""
    degrees, errors, widths = bench.measured(*bench.CASES["eq. (24), M = 6"], 400)
    assert degrees == 12
    assert widths["spectral"].shape == errors["HC3"].shape == (400, 3)
    assert np.median(errors["spectral"] / errors["nonrobust"], axis=0) == pytest.approx(0.98, abs=0.03)
    wider = np.median(widths["spectral"] / widths["nonrobust"], axis=0)
    assert np.all((wider > 1.02) & (wider < 1.17))
    assert np.all(np.median(widths["spectral"] / widths["HC3"], axis=0) < 0.9)


def test_a_row_has_the_least_and_the_greatest_ratio(bench):
    name, degrees, *ratios = bench.row("eq. (24), M = 6", 50).strip("| ").split(" | ")
    assert (name, degrees) == ("eq. (24), M = 6", "12")
    assert len(ratios) == 3
    for least, greatest in (one.split(" to ") for one in ratios):
        assert 0.5 < float(least) <= float(greatest) < 1.5
