"""The compiled core: C-contiguous float64 in, NumPy arrays and plain objects out."""

from collections.abc import Callable, Sequence
from typing import Any, NotRequired, Self, TypedDict, Unpack, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "STREAM_VERSION",
    "Fitter",
    "JointFitter",
    "Stream",
    "Study",
    "TermsFitter",
    "__version__",
    "_panic_for_tests",
    "_wait_for_tests",
    "coefficients",
    "corners",
    "count_errors",
    "figures",
    "gauss_legendre",
    "integrate",
    "line_colour",
    "line_correlation",
    "line_event",
    "local_responses",
    "merge_moments",
    "noise_level",
    "normal_rows",
    "normals",
    "pooled_power",
    "quadrature_weights",
    "quantiles",
    "sharpest",
    "simulate",
    "simulate_uneven",
    "sinusoids",
    "thread_count",
    "unforeseen",
]

__version__: str
STREAM_VERSION: int

_F64 = NDArray[np.float64]
_C128 = NDArray[np.complex128]
_I64 = NDArray[np.int64]

# From samples to Fourier coefficients ----------------------------------------------------------

def coefficients(
    samples: _F64,
    harmonics: int,
    kinds: Sequence[str],
    delays: Sequence[float],
    lead: int,
    t: _F64 | None,
) -> _C128: ...
def quadrature_weights(rule: str, intervals: int, t: _F64 | None) -> _F64: ...
def noise_level(samples: _F64, order: int) -> _F64: ...
def corners(samples: _F64) -> tuple[list[int], list[int]]: ...

# Residual lines --------------------------------------------------------------------------------

def line_correlation(residuals: list[_C128], lags: int | None = None) -> tuple[float, _F64] | None: ...
def line_colour(residuals: list[_C128]) -> tuple[float, float] | None: ...
def line_event(residuals: _C128) -> tuple[int, float] | None: ...
def pooled_power(residuals: list[_C128]) -> _F64: ...
def sharpest(samples: _F64) -> float: ...
def unforeseen(samples: _F64) -> float: ...

# Frequency responses ---------------------------------------------------------------------------

def local_responses(
    pieces: Sequence[tuple[float, int, bool, _C128, _C128]],
    omega: _F64,
    family: str,
    degree: int,
    weighting: str,
    threads: int | None,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, Any]: ...

# Exact responses -------------------------------------------------------------------------------

def gauss_legendre() -> tuple[_F64, _F64]: ...
def simulate(
    a: _F64,
    b: _F64,
    c: _F64,
    d: _F64,
    x0: _F64,
    u: _F64,
    dt: float,
    kind: str,
    nodes: _F64 | None,
) -> _F64: ...
def simulate_uneven(
    a: _F64, b: _F64, c: _F64, d: _F64, x0: _F64, u: _F64, held: list[bool], t: _F64
) -> _F64: ...
def integrate(
    formulas: tuple[list[tuple[str, float, int, int]], list[int]],
    grid: _F64,
    drives: _F64,
    pasts: list[tuple[int, float]],
    starts: _F64,
    theta: _F64,
    relative: float,
    absolute: _F64,
    most: int,
) -> tuple[_F64 | None, float | None, float | None]: ...

# Random streams --------------------------------------------------------------------------------

def normal_rows(
    seed: int, purpose: str, channel: int, first: int, group: int, replicates: int, length: int
) -> _F64: ...
def normals(seed: int, purpose: str, channel: int, replicate: int, group: int, count: int) -> _F64: ...

# Sinusoids -------------------------------------------------------------------------------------

def sinusoids(
    records: _F64,
    weights: _F64,
    *,
    count: int,
    choose: bool,
    damped: bool,
    complex: bool,
    trend: int,
    band: tuple[float, float],
    lines: int,
    awls: bool,
    threads: int | None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]: ...

# Estimation ------------------------------------------------------------------------------------

class _Options(TypedDict):
    order: int
    numerators: Sequence[int | None]
    delays: Sequence[float]
    intersample: Sequence[Sequence[str]]
    method: str
    noise: str
    trend: str | None
    rule: str
    extended: bool
    band: tuple[float, float] | None
    harmonics: int | None
    tol: float
    maxiter: int
    transient: NotRequired[int]

@final
class Fitter:
    def __new__(
        cls,
        samples: Sequence[int],
        time: Sequence[float | _F64],
        *,
        beside: Fitter | None = None,
        **options: Unpack[_Options],
    ) -> Self: ...
    def fit(
        self, y: Sequence[_F64], u: Sequence[_F64], *, starts: Sequence[Sequence[float]] | None = None
    ) -> dict[str, Any]: ...
    def fit_many(
        self,
        y: _F64 | Sequence[_F64],
        u: _F64 | Sequence[_F64],
        *,
        threads: int | None,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, Any]: ...

@final
class Stream:
    def __new__(
        cls,
        channels: int,
        remembered: int,
        samples: int,
        dt: float,
        weights: Sequence[float],
        **options: Any,
    ) -> Self: ...
    @property
    def count(self) -> int: ...
    def past(self) -> _F64: ...
    def push(self, samples: _F64) -> None: ...
    def follow(self, samples: _F64, every: int) -> dict[str, Any]: ...
    def now(self) -> dict[str, Any]: ...
    def fit(self) -> dict[str, Any]: ...
    def clear(self) -> None: ...

@final
class TermsFitter:
    def __new__(
        cls, samples: list[int], time: list[float | _F64], uneven: list[_F64 | None], **options: Any
    ) -> TermsFitter: ...
    def fit(self, records: list[_F64]) -> dict[str, Any]: ...
    def fit_many(
        self,
        records: list[_F64],
        shared: _F64,
        *,
        threads: int | None,
        progress: Callable[[int, int], object] | None = ...,
    ) -> dict[str, Any]: ...

@final
class JointFitter:
    def __new__(
        cls,
        samples: Sequence[int],
        time: Sequence[float | _F64],
        variances: Sequence[_F64 | None],
        **options: Any,
    ) -> Self: ...
    def fit(
        self, y: Sequence[_F64], u: Sequence[_F64], *, near: Sequence[float] | None = None
    ) -> dict[str, Any]: ...
    def fit_many(
        self,
        y: _F64 | Sequence[_F64],
        u: _F64 | Sequence[_F64],
        *,
        threads: int | None,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, Any]: ...

# Threads and faults ----------------------------------------------------------------------------

def thread_count(asked: int | None = None) -> int: ...
def _panic_for_tests(threads: int) -> None: ...
def _wait_for_tests(threads: int, progress: Callable[[int, int], None] | None = None) -> None: ...

# Monte Carlo -----------------------------------------------------------------------------------

@final
class Study:
    def __new__(
        cls, groups: Sequence[dict[str, Any]], shape: tuple[int, int], *, draw: str, level: float
    ) -> Self: ...
    @property
    def coefficients_pay(self) -> bool: ...
    def noise(self, group: int, seed: int, replicate: int) -> _F64: ...
    def part(
        self,
        *,
        seed: int,
        first: int,
        replicates: int,
        samples: bool,
        threads: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, Any]: ...

def merge_moments(before: _F64, next: _F64) -> _F64: ...
def figures(moments: _F64) -> dict[str, _F64]: ...
def count_errors(errors: _F64, truth: _F64, figures: Sequence[int]) -> tuple[_F64, _I64, _I64]: ...
def quantiles(bins: _I64, counts: _I64, truth: _F64, share: float) -> _F64: ...
