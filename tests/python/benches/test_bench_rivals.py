"""The rivals of benches/compare: the right estimates, the right distribution, and a table at the end."""

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from places import ROOT

COMPARE = ROOT / "benches" / "compare"
sys.path.insert(0, str(COMPARE))

import checks  # noqa: E402
import setting  # noqa: E402
from rivals.expert_numpy import ExpertNumPy  # noqa: E402
from rivals.natural_numpy import NaturalNumPy  # noqa: E402
from rivals.output_error import OutputError  # noqa: E402

NUMPY = {
    "natural": NaturalNumPy,
    "expert, lines": lambda: ExpertNumPy("lines", 64),
    "expert, banded": lambda: ExpertNumPy("banded", 64),
}


@pytest.mark.parametrize("name", NUMPY)
def test_numpy_rivals_estimate_as_modfun(name):
    assert checks.same_estimates(NUMPY[name](), 100) < 1e-10


@pytest.mark.parametrize("name", NUMPY)
@pytest.mark.parametrize("draw", ["samples", "coefficients"])
def test_numpy_rivals_draw_the_same_distribution(name, draw):
    checks.same_distribution(getattr(NUMPY[name](), draw), 1000)


@pytest.mark.skipif(
    find_spec("numba") is None,
    reason="numba is not installed: pip install -r benches/compare/requirements.txt",
)
@pytest.mark.parametrize("form", ["lines", "banded"])
def test_numba_estimates_as_modfun(form):
    from rivals.lanes_numba import NumbaLanes

    rival = NumbaLanes(form)
    assert checks.same_estimates(rival, 100) < 1e-10
    checks.same_distribution(rival.samples)
    checks.same_distribution(rival.coefficients)


def test_checks_see_a_wrong_estimate_and_a_wrong_distribution():
    class Off(NaturalNumPy):
        def from_noise(self, noise):
            return super().from_noise(noise) * (1 + 1e-7)

    with pytest.raises(AssertionError, match="differ from modfun's"):
        checks.same_estimates(Off(), 20)
    with pytest.raises(AssertionError, match="standard errors"):
        checks.same_distribution(lambda n: NaturalNumPy().samples(n) * 1.02, 1000)


def test_output_error_agrees_with_the_exact_one_to_its_discretisation():
    import modfun as mf

    noise = np.random.default_rng(3).standard_normal((4, setting.SAMPLES))
    exact = mf.rivals.output_error(mf.TransferFunction(poles=2, zeros=0))
    want = [
        list(
            exact(
                mf.Record(
                    y=setting.Y + setting.SIGMA * e, u=setting.U, dt=setting.DURATION / setting.INTERVALS
                )
            ).values()
        )
        for e in noise
    ]
    np.testing.assert_allclose(OutputError().from_noise(noise), want, rtol=5e-3)


@pytest.mark.process
def test_quick_bench_writes_the_table(tmp_path):
    page = tmp_path / "benchmarks.md"
    command = [sys.executable, COMPARE / "bench.py", "--quick", "--out", page]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    text = page.read_text()
    assert "expert NumPy, banded" in text
    assert "numba (left out by --quick)" in text
    assert text.count("| ≥ ") + text.count("| ≤ ") == 14
