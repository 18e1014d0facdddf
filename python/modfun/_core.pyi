"""The compiled core: C-contiguous float64 in, NumPy arrays and plain objects out."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]

# From samples to Fourier coefficients ----------------------------------------------------------

def coefficients(
    samples: F64,
    harmonics: int,
    kinds: Sequence[str],
    delays: Sequence[float],
    lead: int,
    t: F64 | None,
) -> C128: ...
def quadrature_weights(rule: str, intervals: int, t: F64 | None) -> F64: ...
def noise_level(samples: F64, order: int) -> F64: ...

# Exact responses -------------------------------------------------------------------------------

def gauss_legendre() -> tuple[F64, F64]: ...
def simulate(
    a: F64,
    b: F64,
    c: F64,
    d: F64,
    x0: F64,
    u: F64,
    dt: float,
    kind: str,
    nodes: F64 | None,
) -> F64: ...

# Random streams --------------------------------------------------------------------------------

def normals(seed: int, purpose: str, channel: int, replicate: int, group: int, count: int) -> F64: ...

# Estimation ------------------------------------------------------------------------------------

def fit(
    y: Sequence[F64],
    u: Sequence[F64],
    time: Sequence[float | F64],
    *,
    order: int,
    numerators: Sequence[int | None],
    delays: Sequence[float],
    intersample: Sequence[str],
    method: str,
    noise: str,
    trend: str | None,
    rule: str,
    extended: bool,
    band: tuple[float, float] | None,
    harmonics: int | None,
    tol: float,
    maxiter: int,
) -> dict[str, Any]: ...
def fit_many(
    y: F64,
    u: F64,
    dt: float,
    *,
    order: int,
    numerators: Sequence[int | None],
    delays: Sequence[float],
    intersample: Sequence[str],
    method: str,
    noise: str,
    trend: str | None,
    rule: str,
    extended: bool,
    band: tuple[float, float] | None,
    harmonics: int | None,
    tol: float,
    maxiter: int,
    uncertainty: bool,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> dict[str, Any]: ...

# Threads and faults ----------------------------------------------------------------------------

def thread_count(asked: int | None = None) -> int: ...
def _panic_for_tests(threads: int) -> None: ...
def _wait_for_tests(threads: int, progress: Callable[[int, int], None] | None = None) -> None: ...

# Monte Carlo -----------------------------------------------------------------------------------

def monte_carlo(
    groups: Sequence[dict[str, Any]],
    estimators: Sequence[Sequence[dict[str, Any]]],
    *,
    seed: int,
    first: int,
    replicates: int,
    draw: str,
    cov_type: str | None,
    level: float,
    samples: bool,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> list[list[list[dict[str, Any]]]]: ...
