"""Many fits at once: what `fit_many` returns, and how it gets there."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import SpecError
from .extras import optional
from .options import Options
from .records import Batch, Record
from .results import Fit
from .structures import TransferFunction
from .tables import Table, nearest

__all__ = ["FitMany"]

F64 = NDArray[np.float64]
STATUS = ("ok", "maxiter", "rank", "nonfinite")


@dataclass(frozen=True, eq=False, repr=False)
class FitMany:
    """Fits of many records by one structure.

    Attributes
    ----------
    params : (replicate, p) array
        Estimates; nan where the status allows none.
    bse : (replicate, p) array
        Standard errors of the chosen `cov_type`.
    status : (replicate,) array of str
        "ok", "maxiter", "rank" or "nonfinite".
    cost : (replicate,) array
    nit : (replicate,) array of int
    param_names : tuple of str
    df_resid : int
        Of the first record where they differ.
    band : (float, float)
        Lowest and highest frequency used, rad/s.
    structure : TransferFunction
    options : Options
    """

    params: F64
    bse: F64
    status: NDArray[np.str_]
    cost: F64
    nit: NDArray[np.intp]
    param_names: tuple[str, ...]
    df_resid: int
    band: tuple[float, float]
    structure: TransferFunction
    options: Options

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which estimates can be used."""
        return np.asarray(self.status == "ok")

    @property
    def failures(self) -> dict[str, int]:
        """Number of replicates by status, "ok" left out."""
        return {word: int(np.sum(self.status == word)) for word in STATUS[1:] if np.any(self.status == word)}

    def __len__(self) -> int:
        return int(self.params.shape[0])

    def __getitem__(self, name: str) -> F64:
        """Estimates of one parameter, (replicate,)."""
        if name not in self.param_names:
            raise SpecError(f"there is no parameter {name!r}; {nearest(name, self.param_names)}")
        return self.params[:, self.param_names.index(name)]

    def table(self) -> Table:
        """Mean, standard deviation, median and mean standard error of each parameter over the good fits."""
        good = self.success
        values, errors = self.params[good], self.bse[good]
        nothing = np.full(len(self.param_names), np.nan)
        some, two = bool(good.any()), int(good.sum()) > 1
        return Table(
            {
                "parameter": list(self.param_names),
                "mean": values.mean(axis=0) if some else nothing,
                "sd": values.std(axis=0, ddof=1) if two else nothing,
                "median": np.median(values, axis=0) if some else nothing,
                "mean_bse": errors.mean(axis=0) if some else nothing,
            },
            title=f"{int(good.sum())} of {len(self)} fits succeeded",
        )

    def to_pandas(self) -> Any:
        """A pandas.DataFrame (extra ``pandas``): a row a replicate, bse of a1 as column "a1_bse"."""
        columns: dict[str, Any] = dict(zip(self.param_names, self.params.T, strict=True))
        columns |= {f"{name}_bse": bse for name, bse in zip(self.param_names, self.bse.T, strict=True)}
        columns |= {"status": self.status, "cost": self.cost, "nit": self.nit}
        return optional("pandas", "pandas", "FitMany.to_pandas").DataFrame(columns)

    def to_xarray(self) -> Any:
        """An xarray.Dataset (extra ``xarray``): params and bse (replicate, parameter), status, cost, nit."""
        both, one = ("replicate", "parameter"), ("replicate",)
        return optional("xarray", "xarray", "FitMany.to_xarray").Dataset(
            {
                "params": (both, self.params),
                "bse": (both, self.bse),
                "status": (one, self.status),
                "cost": (one, self.cost),
                "nit": (one, self.nit),
            },
            coords={"parameter": list(self.param_names)},
        )

    def __repr__(self) -> str:
        failed = ", ".join(f"{n} {word}" for word, n in self.failures.items())
        low, high = self.band
        return (
            f"FitMany of {len(self)} records by {self.structure!r}: {int(self.success.sum())} ok"
            f"{', ' + failed if failed else ''}, {self.options.method}, band {low:.4g} to {high:.4g} rad/s"
        )

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def run_many(
    data: Batch | tuple[Record, ...],
    structure: TransferFunction,
    options: Options,
    threads: int,
    progress: str | bool,
    fit_one: Callable[[tuple[Record, ...], TransferFunction, Options], Fit],
) -> FitMany:
    """Choose the band once, then fit everything; see `estimation.fit_many`."""
    first = _first(data, fit_one, structure, options)
    chosen = options
    if options.band is None and options.harmonics is None and options.method in ("ml", "awls"):
        chosen = options.replace(harmonics=first.harmonics)
    if isinstance(data, Batch):
        return _batch(data, structure, options, chosen, threads, _Progress(progress, len(data)), first)
    fits = [first] + [
        fit_one((rec,), structure, chosen.replace(harmonics=None, band=first.band)) for rec in data[1:]
    ]
    return collect(fits, structure, options)


def collect(fits: list[Fit], structure: TransferFunction, options: Options) -> FitMany:
    """Single fits as one result; what differs between them is that of the first."""
    return FitMany(
        params=np.array([f.params for f in fits]),
        bse=np.array([f.bse for f in fits]),
        status=np.array([f.status for f in fits]),
        cost=np.array([f.cost for f in fits]),
        nit=np.array([f.nit for f in fits]),
        param_names=fits[0].param_names,
        df_resid=fits[0].df_resid,
        band=fits[0].band,
        structure=structure,
        options=options,
    )


def _first(
    data: Batch | tuple[Record, ...],
    fit_one: Callable[[tuple[Record, ...], TransferFunction, Options], Fit],
    structure: TransferFunction,
    options: Options,
) -> Fit:
    if not isinstance(data, Batch):
        return fit_one((data[0],), structure, options)
    finite = np.flatnonzero(np.all(np.isfinite(data.y), axis=(1, 2)))
    return fit_one((data[int(finite[0]) if finite.size else 0],), structure, options)


def _batch(
    data: Batch,
    structure: TransferFunction,
    asked: Options,
    chosen: Options,
    threads: int,
    show: _Progress,
    first: Fit,
) -> FitMany:
    found = _core.fit_many(
        data.y,
        data.u,
        data.dt,
        order=structure.poles,
        numerators=list(first.numerators),
        delays=list(first.delays),
        intersample=list(data.intersample),
        uncertainty=True,
        threads=threads,
        progress=show if show.on else None,
        **chosen.core(),
    )
    show.end()
    return FitMany(
        params=found["theta"],
        bse=found["bse_hc3" if asked.cov_type == "HC3" else "bse_nonrobust"],
        status=np.array(STATUS)[found["status"]],
        cost=found["cost"],
        nit=np.asarray(found["nit"], dtype=np.intp),
        param_names=first.param_names,
        df_resid=int(found["df_resid"]),
        band=first.band,
        structure=structure,
        options=asked,
    )


class _Progress:
    """One line on standard error, rewritten; silent for the first half second."""

    def __init__(self, asked: str | bool, total: int) -> None:
        self.on = sys.stderr.isatty() if asked == "auto" else bool(asked)
        self.start = time.monotonic()
        self.total = total
        self.shown = False

    def __call__(self, done: int, total: int) -> None:
        if time.monotonic() - self.start > 0.5:
            self.shown = True
            sys.stderr.write(f"\rfitting: {done} of {total}")
            sys.stderr.flush()

    def end(self) -> None:
        """Finish the line, if one was begun."""
        if self.shown:
            sys.stderr.write(f"\rfitting: {self.total} of {self.total}\n")
