"""docs/validation.md is what `make validate` writes, and says why where it says off; cheap sections run."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "validation.md"
for folder in ("benches", "benches/compare", "benches/validate"):
    sys.path.append(str(ROOT / folder))

import orders  # noqa: E402
import page  # noqa: E402
import validate  # noqa: E402


def sections():
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    return {heading: body for heading, body in found if heading != "Summary"}


def test_every_section_says_how_it_was_made():
    found = sections()
    commands = [re.search(r"`make validate ONLY=(\w+)`, \d+ s\. (.+)", body) for body in found.values()]
    assert {c[1] for c in commands} <= set(validate.SECTIONS)
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
