"""One thread of BLAS in every process of the tests, and a kind for every test (see `markers` in pyproject.toml)."""

import os

import pytest

# Read once, when NumPy is loaded. BLAS gains nothing on matrices as small as ours, and the threads of several
# workers of pytest-xdist wait for one another: more than three times the time on two cores.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
