"""A record of 2²² samples: coefficients to rounding, and hardly any memory beside the record's own."""

import math
import subprocess
import sys

import modfun as mf
import numpy as np
import pytest
from oracle import coefficients as naive

INTERVALS = 2**22
MOST = 20.0  # MB beside the record

EXTRA = """
import warnings
import modfun as mf, numpy as np

warnings.simplefilter("ignore")
model = mf.TransferFunction(poles=2, zeros=0)

def status(key):
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith(key)) / 1024

def work(intervals):
    noise = np.random.default_rng(1).standard_normal((2, intervals + 1))
    rec = mf.Record(noise[0], noise[1], dt=0.01)
    del noise
    with open("/proc/self/clear_refs", "w") as peak:
        peak.write("5")  # the peak begins anew
    before = status("VmRSS")
    {call}
    return status("VmHWM") - before

work(1000)
print(work({intervals}))
"""


@pytest.mark.process
@pytest.mark.parametrize("call", ["mf.coefficients(rec, 30)", "mf.fit(rec, model, harmonics=30)"])
def test_a_long_record_takes_little_memory_beside_its_own(call):
    if not sys.platform.startswith("linux"):
        pytest.skip("the peak of a process's memory is read from Linux's /proc")
    script = EXTRA.replace("{call}", call).replace("{intervals}", str(INTERVALS))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(done.stdout) <= MOST


@pytest.mark.parametrize("rule", ["gregory", "parabolic"])
def test_coefficients_of_a_long_record_are_exact_to_rounding(rule):
    t = np.arange(INTERVALS + 1) / INTERVALS
    v = np.random.default_rng(3).standard_normal(t.size) + 5 * t + np.sin(40 * t**2)
    got = mf.coefficients(mf.Record(v, dt=0.01), 32, rule=rule).y[0]
    weighted = naive.weights(rule, INTERVALS) * v / INTERVALS
    for m in (0, 1, 17, 32):
        angle = 2 * np.pi * ((m * np.arange(t.size)) % INTERVALS) / INTERVALS
        want = complex(math.fsum(weighted * np.cos(angle)), -math.fsum(weighted * np.sin(angle)))
        assert abs(got[m] - want) <= 1e-14 * np.abs(got).max(), m
