"""The rivals of benches/sinusoids.py find what they should, and its studies print their tables."""

import importlib
import re

import numpy as np
import pytest
from places import ROOT, measured


@pytest.fixture
def bench(monkeypatch):
    for folder in ("benches", "benches/compare/rivals", "examples"):
        monkeypatch.syspath_prepend(str(ROOT / folder))
    return importlib.import_module


def test_rivals_find_the_truth_where_noise_is_small(bench):
    pair = bench("sinusoids").Pair(64, (0.20, 0.24), 1e-8, replicates=3)
    for name, found in bench("sinusoids").estimates(pair).items():
        # Yule–Walker's covariances of a short record are biased by its ends.
        reach = 2e-2 if name == "HOYW" else 1e-4
        assert np.abs(found - pair.omega).max() < reach, name


def test_esprit_is_near_the_bound_and_yule_walker_is_not(bench):
    pair = bench("sinusoids").Pair(256, (0.10, 0.12), 0.05, replicates=60)
    found = bench("sinusoids").estimates(pair)
    # 120 squared errors: their rms is within 20 % of its mean but for 1 in 500 seeds.
    assert 0.8 < pair.ratio(found["ml"]) < 1.2
    assert 0.8 < pair.ratio(found["ESPRIT"]) < 1.5
    assert pair.ratio(found["HOYW"]) > pair.ratio(found["ml"])


def test_outliers_are_counted(bench):
    pair = bench("sinusoids").Pair(64, (0.2, 0.3), 0.01, replicates=4)
    found = np.tile(pair.omega, (4, 1))
    assert pair.outliers(found) == 0
    found[1, 0] = np.nan
    found[2, 1] += 1
    assert pair.outliers(found) == 0.5


@pytest.mark.parametrize("name", ["accuracy", "close", "lines", "coverage", "counts", "speed"])
def test_studies_print_tables(bench, name, capsys, monkeypatch):
    study = bench("sinusoids")
    monkeypatch.setattr(study, "CELLS", study.CELLS[:1])
    study.STUDIES[name](4)
    text = capsys.readouterr().out
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) > 2
    assert len({line.count("|") for line in rows}) == 1


def test_marple(bench, capsys):
    """The four tones of which the record was made; their frequencies and levels are known."""
    marple = bench("marple")
    found = marple.main(measured("kay_marple64").parent)
    turns, level = found.omega / (2 * np.pi), 20 * np.log10(found.amplitude / found.amplitude.max())
    for known, decibels in marple.TONES.items():
        at = np.argmin(np.abs(turns - known))
        assert abs(turns[at] - known) < 0.002
        assert abs(level[at] - decibels) < 2
    assert len(re.findall("known", capsys.readouterr().out)) == 4
