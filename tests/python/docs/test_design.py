"""docs/design.md: the example that chooses an input prints its tables, and they say what the page says."""

import sys

import numpy as np
import pytest
from places import ROOT

PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(ROOT / "examples"))
    import choose_input

    sys.path.pop(0)
    return choose_input


@pytest.fixture(scope="module")
def found(example):
    return example.main(replicates=400)


def row(name):
    """Numbers of a row of the page's tables."""
    (line,) = [line for line in PAGE.splitlines() if line.replace("*", "").startswith(f"| {name} |")]
    return [float(cell.replace("*", "")) for cell in line.split("|")[2:-1]]


def test_the_tables_are_those_of_the_page(found):
    rows, _, both = found
    assert len(rows) == 7
    for name, own in rows.items():
        keys = ("alpha", "rms", "Za", "Ma", "Mq", "Zd", "Md", "all", "all at 3 deg")
        np.testing.assert_allclose(row(name), [own[key] for key in keys], atol=0.0051)
    for name, own in both.items():
        keys = ("beta", "phi", "Yb", "Lb", "Lp", "Nb", "Nr", "Lda", "Nda", "Ndr", "all")
        np.testing.assert_allclose(row(name), [own[key] for key in keys], atol=0.0051)


def test_what_the_page_says_is_so(found):
    rows, ratios, both = found
    assert min(rows, key=lambda name: rows[name]["all"]) == "PRBS"
    assert max(rows, key=lambda name: rows[name]["all"]) == "doublet"
    assert rows["multisine"]["all at 3 deg"] == pytest.approx(rows["PRBS"]["all at 3 deg"], rel=0.01)
    assert rows["3-2-1-1"]["all"] / rows["3-2-1-1 twice"]["all"] == pytest.approx(np.sqrt(2), rel=0.01)
    worth = {name: 1 / (row["all"] * row["rms"]) ** 2 for name, row in rows.items()}
    assert worth["multisine"] / worth["PRBS"] == pytest.approx(4 / 3, abs=0.05)
    assert worth["doublet"] > worth["PRBS"]
    assert both["multisines in turn"]["all"] / both["multisines at once"]["all"] == pytest.approx(
        1.43, abs=0.01
    )
    # A standard deviation of 400 errs by 3.5 %; four times that, fifteen ratios: false alarm 1 in 1,000.
    assert np.all(np.abs(np.array(list(ratios.values())) - 1) < 0.14)


def test_the_figure_is_drawn(example, found, tmp_path):
    rows, ratios, _ = found
    example.figures(tmp_path, rows, ratios)
    assert (tmp_path / "design_inputs.png").stat().st_size > 20_000
