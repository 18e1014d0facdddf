"""docs/validation.md is what `make validate` writes, and says why where it says off; cheap sections run."""

import re
import sys

import numpy as np
import pytest
from places import ROOT

PAGE = ROOT / "docs" / "validation.md"
sys.path.append(str(ROOT / "benches" / "validate"))

import validate  # noqa: E402, I001  first, since it sets the path of the others
import claims  # noqa: E402
import gaps  # noqa: E402
import intervals  # noqa: E402
import orders  # noqa: E402
import page  # noqa: E402
import pem  # noqa: E402
import published  # noqa: E402
import reasons  # noqa: E402
import twins  # noqa: E402

# What fits on the page say is counted, or the point of a row.
pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


def sections():
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    return {heading: body for heading, body in found if heading != "Summary"}


def test_every_section_says_how_it_was_made():
    found = sections()
    commands = [re.search(r"`make validate ONLY=(\w+)`, \d+ s\. (.+)", body) for body in found.values()]
    assert [c[1] for c in commands] == list(validate.SECTIONS)
    assert all("modfun 0." in c[2] and " UTC" in c[2] and "rustc" in c[2] for c in commands)
    for name in validate.SECTIONS.values():
        assert (ROOT / "benches" / "validate" / f"{name}.py").exists()


def test_no_row_is_off_without_a_reason():
    for heading, body in sections().items():
        checks, ok, off = map(
            int, re.search(r"^Result: (\d+) checks, (\d+) ok, (\d+) off\.$", body, re.M).groups()
        )
        assert checks == ok + off > 0, heading
        assert body.count("**off**") == off, heading
        assert "reason not known" not in body, heading
        for reason in re.findall(r"\*\*off\*\*(.*?) \|$", body, re.M):
            assert len(reason) > 20, heading


def test_tables_are_whole():
    for block in re.findall(r"(?:^\|.*\|\n)+", PAGE.read_text(encoding="utf-8"), re.M):
        widths = {line.count("|") for line in block.splitlines()}
        assert len(widths) == 1, block[:200]


def test_figures_are_there():
    for name in re.findall(r"\]\((figures/\w+\.png)\)", PAGE.read_text(encoding="utf-8")):
        assert (ROOT / "docs" / name).exists()


def test_a_row_that_is_off_without_a_reason_is_counted(tmp_path):
    one = page.Section("One", reasons={"known": "theory is for small noise"})
    assert one.judge("known thing", good=False) == "**off**: theory is for small noise"
    assert one.judge("other", good=False) == "**off**: reason not known"
    assert one.judge("fine", good=True) == "ok"
    assert (one.count, one.off, one.unexplained) == (3, 2, 1)
    out = tmp_path / "page.md"
    one.command = "make validate ONLY=one"
    page.begin(out)
    out.write_text(out.read_text() + "\n" + one.text())
    page.summarise(out)
    assert "| One | 3 | 1 | 2 | `make validate ONLY=one` | 0 |" in out.read_text()


def test_the_limit_of_a_table_is_bonferronis():
    assert page.limit(1) == pytest.approx(2.5758, abs=1e-4)
    assert page.limit(100) == pytest.approx(3.8906, abs=1e-4)


@pytest.mark.parametrize("make", [orders.quadrature, orders.holds, orders.integration])
def test_orders_are_those_of_theory(make):
    for curve in make():
        slope, _ = curve.fitted()
        assert slope == pytest.approx(curve.theory, abs=orders.NEAR), curve.name


@pytest.mark.parametrize(
    "kind", [twins.spectra, twins.regressors, twins.estimates, twins.iterates, twins.bands]
)
def test_the_core_agrees_with_its_twins(kind):
    found = gaps.Gaps()
    kind(found, 6)
    for name, (count, gap, limit) in found.rows.items():
        assert count >= 2, name
        assert gap <= limit, name


def test_a_twin_that_differs_or_is_not_finite_is_seen():
    found = gaps.Gaps()
    for got in ([1.0, 2.0], [1.0, 2.2], [1.0, float("nan")], [1.0, 2.0]):
        found.add("x", 1e-3, got, [1.0, 2.0])
    assert found.rows["x"][0] == 4
    assert not found.rows["x"][1] <= 1e-3


@pytest.mark.statistics
def test_spectral_and_classical_intervals_cover_and_hc3_is_cautious():
    """4,000 records; 4.5 Monte Carlo errors for three parameters: false alarm 2e-5, the seed is fixed."""
    spectral, hc3, classical = intervals.study("x", 4000, ("ml",), nsr=0.1, harmonics=11, trend=None)
    assert (spectral.kind, hc3.kind, classical.kind) == ("spectral", "HC3", "classical")
    for row in (spectral, classical):
        assert np.all(np.abs(row.covered - 0.95) < 4.5 * row.errors)
    assert np.all(hc3.covered > 0.95 - 4.5 * hc3.errors)


def test_rows_of_lotka_and_volterra_and_of_the_prey_alone():
    """Ten records each: a 95 % interval misses seven of them once in 1e-7 parameters."""
    rows = [row for row in intervals.benchmarks(0.01) if "Rao" not in row.name]
    assert [row.covered.size for row in rows] == 2 * [4, 4, 4, 3, 3, 3]
    assert {row.name for row in rows} <= set(re.findall(r"^\| ([^|]+) \|", PAGE.read_text("utf-8"), re.M))
    for row in rows:
        assert row.records == 10
        assert np.all(row.covered > 0.3)


@pytest.mark.statistics
def test_noise_counted_on_the_mean_of_y_gives_the_reports_bias():
    """12.1 %; known to .1 % from 10,000 runs."""
    value, error = claims.mean_absolute(10_000)
    assert error == pytest.approx(0.09, rel=0.5)
    assert value == pytest.approx(12.08, abs=4.5 * error)


def test_half_an_interval_is_what_makes_the_bias_of_a_discrete_model():
    quiet = claims.setting(0.0)
    late = {
        n: pem.converted(pem.fitted(quiet, lags), quiet.dt, "logarithm") for n, lags in pem.NUMERATORS.items()
    }
    found = {name: pem.rms(theta - 1) for name, theta in late.items()}
    assert found["b u(t)"] == pytest.approx(10.2, abs=0.1)
    assert found["b u(t − 1)"] < 0.2
    assert found["b u(t) + c u(t − 1)"] < 0.2


@pytest.mark.statistics
def test_reasons_are_tried_by_taking_the_cause_away():
    """2,400 and 450 intervals; 4.5 errors of a coverage, the seeds are fixed."""
    (_, _, given, true_sigma), *_, (_, _, _, both) = reasons.wide("wls", 0.05, 800)
    assert float(given) > 97.0
    assert float(true_sigma) == pytest.approx(95.0, abs=2.0)
    assert float(both) == pytest.approx(95.0, abs=2.0)
    _, _, independent, dependent = reasons.uneven(150)
    assert float(independent) < 90.0
    assert float(dependent) == pytest.approx(95.0, abs=4.6)


def test_a_claim_is_as_far_away_as_its_errors_say():
    near = claims.Claim("x", "5–10", 12.0, 0.5, 5.0, 10.0, "")
    assert near.away == pytest.approx(4.0)
    assert claims.Claim("x", "5–10", 7.0, 0.0, 5.0, 10.0, "").away == 0.0
    assert claims.Claim("x", "never", 1.0, 0.0, 0.0, 0.0, "").away == np.inf


def test_data_that_are_not_there_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(published, "FOLDER", tmp_path)
    monkeypatch.setattr(published, "PARTS", [(published.delays, "time_delay")])
    text = published.section(0.1).text()
    assert "time_delay is not there" in text
    assert "MODFUN_DATA" in text
    assert "0 checks" in text
