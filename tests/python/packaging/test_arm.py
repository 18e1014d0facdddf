"""`make test-arm`: numbers that differ and calls of fma are found; what is missing is named."""

import os
import subprocess
import sys

import pytest
from places import ROOT

sys.path.append(str(ROOT / "packaging"))
import arm
import same_bits

TEXT = "exact\tnormals\t0\t3ff0000000000000\t1e0\nclose\ttones\t0\t4000000000000000\t2e0\n"


def test_the_same_text_has_no_differences():
    assert same_bits.differences(TEXT, TEXT) == []


def test_a_bit_of_an_exact_number_counts():
    assert same_bits.differences(TEXT, TEXT.replace("3ff0000000000000", "3ff0000000000001")) == [
        "exact normals 0: 1.0 and 1.0000000000000002"
    ]


@pytest.mark.parametrize(("bits", "held"), [("4000000000000001", True), ("4000001000000000", False)])
def test_a_close_number_may_be_near(bits, held):
    assert (same_bits.differences(TEXT, TEXT.replace("4000000000000000", bits)) == []) is held


def test_a_number_that_one_lacks_is_named():
    assert same_bits.differences(TEXT, TEXT.splitlines()[0]) == ["close tones 0: only one has it"]


def test_multiply_adds_must_be_instructions():
    fused = "  1c:\tfmla\tv6.2d, v21.2d, v18.2d\n" * 1000
    assert arm.instructions(fused) == []
    assert arm.instructions(fused + "  20:\tbl\t41b7 <fma@plt>\n") == ["1 calls of fma"]
    assert arm.instructions(fused.replace("2d", "4s")) == ["no kernel has fmla of two lanes"]


@pytest.mark.process
def test_what_is_missing_is_named_with_its_package(tmp_path):
    alone = {**os.environ, "PATH": str(tmp_path), "RUSTC": "no compiler"}
    script = ROOT / "packaging" / "arm.py"
    code = (
        "import runpy, platform, sys; platform.machine = lambda: 'x86_64';"
        f"sys.path.insert(0, {str(script.parent)!r}); runpy.run_path({str(script)!r}, run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], env=alone, capture_output=True, text=True)
    assert done.returncode == 1
    assert "the program qemu-aarch64" in done.stdout
    assert "apt-get install" in done.stdout
