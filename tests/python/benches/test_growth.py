"""The bench of growth writes its section into the page and nothing else."""

import subprocess
import sys

import pytest
from places import ROOT

SCRIPT = ROOT / "benches" / "compare" / "growth.py"


@pytest.mark.process
def test_its_section_is_replaced_and_the_others_stay(tmp_path):
    page = tmp_path / "performance.md"
    page.write_text(
        "# Performance\n\nBefore.\n\n## How cost grows\n\nOld.\n\n## Tried and rejected\n\nAfter.\n"
    )
    subprocess.run([sys.executable, SCRIPT, "--quick", "--out", page], check=True, capture_output=True)
    text = page.read_text()
    assert text.startswith("# Performance\n\nBefore.\n\n## How cost grows\n")
    assert text.endswith("\n\n## Tried and rejected\n\nAfter.\n")
    assert "Old." not in text
    for symbol in ("N", "M", "n", "inputs"):
        assert f"| {symbol} | awls, many | awls, one | ml, many | ml, one |" in text
