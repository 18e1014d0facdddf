"""The results of a Monte Carlo study: its figures, and what users do with them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arguments import public
from ..base.optional import optional
from ..base.tables import Table
from ..errors import SpecError
from ..records.record import Record
from .drawing import study
from .drawing_estimates import histogram, quantiles
from .figures import Figures
from .page import write_study
from .paired import paired
from .replicate import replicate
from .selection import selected

__all__ = ["Results"]


@public
class Results(Figures):
    """Figures of a study; arrays are (cell…, estimator, parameter), `*_mcse` the Monte Carlo error.

    The axes of the cells are those given as a dict or a list, in the order system, input, initial_state,
    noise, nsr; `axes` names them all. Estimates that were found (status "ok", or "maxiter": the iteration did
    not settle) enter the figures, the others are counted in `failures`. A few that did not settle may make
    most of a spread; tables that have any count them in a column `maxiter`. A standard error that the
    replicates are too few to tell is nan.

    Attributes
    ----------
    axes : dict of str to tuple
        Labels of each axis, estimator and parameter last.
    truth : ndarray
        True parameters; nan where the structure fitted does not hold the system, as are then bias, median,
        rmse and coverage.
    bias, bias_mcse : ndarray
        Mean error. Standard error sd/√R.
    sd, sd_mcse : ndarray
        Standard deviation over R replicates. Standard error √((m₄ − m₂²)/R)/2sd (delta method) with the
        central moments m₂, m₄ of the estimates.
    rmse, rmse_mcse : ndarray
        Root mean square error. Standard error √(var(e²)/R)/2rmse (delta method).
    median, median_mcse : ndarray
        Median error, of counts in bins 0.4 to 0.8 % of the error wide; nan beyond 2²⁰ times the truth.
        Standard error 1.2533 sd/√R, as for normal estimates.
    coverage, coverage_mcse : ndarray
        Share c of 95 % intervals that contain the true value: of each estimator's `cov_type`; of functions,
        those of the Fit that they returned. Standard error √(c̃(1 − c̃)/R) with half a case added on both
        sides, c̃ = (cR + ½)/(R + 1), so that it is not 0 where all or none do.
    failures : ndarray of int, (cell…, estimator)
        Replicates without an estimate.
    status : dict of str to ndarray of int, (cell…, estimator)
        Replicates by outcome: "ok", "maxiter", "rank", "nonfinite", "raised".
    nit : ndarray, (cell…, estimator)
        Mean number of iterations.
    samples : ndarray, (cell…, estimator, replicate, parameter), or None
        Estimates, nan where there is none; None unless kept.
    metrics : dict of str to Metric
        What the study's `metrics` said: mean and sd of each over (cell…, estimator).
    seconds : dict of str to float
        Time of each estimator, noise included, of all processes together. Methods in the compiled core
        share their noise; their common time is split as they take alone.
    messages : Table
        What functions raised, or returned that is not finite, and why records or metrics are missing: cell,
        estimator, first replicate, count and text, a row for each of the first hundred different texts of a
        cell and estimator. `status` counts all.
    notes : tuple of str
        What has to be known to read the tables, which have it in their titles.
    replicates : int

    See Also
    --------
    modfun.MonteCarlo : Makes it.
    modfun.load : Reads that of a directory.
    modfun.plot.study : Draws it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, Fig. 2; T. P. Morris, I. R. White, M. J. Crowther,
    Stat. Med. 38, 2019.

    Examples
    --------
    >>> import modfun as mf
    >>> estimator = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=6)
    >>> study = mf.MonteCarlo(
    ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2,
    ...     estimators={"ml": estimator}, seed=1,
    ... )
    >>> results = study.run(replicates=1000, progress=False)
    >>> results.bias.shape, results.param_names
    ((1, 3), ('a1', 'a2', 'b0'))
    """

    def to_pandas(self) -> Any:
        """The rows of `table` as a pandas.DataFrame (extra ``pandas``)."""
        return self.table().to_pandas()

    def to_xarray(self) -> Any:
        """All figures as an xarray.Dataset (extra ``xarray``).

        Dimensions are those of `axes`, and replicate where samples were kept; each figure has its
        Monte Carlo standard error beside it as ``<figure>_mcse``. Those of a metric are ``<metric>_mean``
        and so on.
        """
        xarray = optional("xarray", "xarray", "Results.to_xarray")
        cell = tuple(name for name in self.axes if name != "parameter")
        figures = ("bias", "sd", "rmse", "median", "coverage")
        names = ["truth", *(n for name in figures for n in (name, f"{name}_mcse")), "crlb"]
        variables = {name: ((*cell, "parameter"), getattr(self, name)) for name in names}
        variables |= {name: (cell, getattr(self, name)) for name in ("failures", "nit")}
        variables |= {f"status_{word}": (cell, counts) for word, counts in self.status.items()}
        for name, metric in self.metrics.items():
            shown = [n for word in ("mean", "sd") for n in (word, f"{word}_mcse")]
            shown += ["count", "failures"]
            variables |= {f"{name}_{figure}": (cell, getattr(metric, figure)) for figure in shown}
        if self.samples is not None:
            variables["samples"] = ((*cell, "replicate", "parameter"), self.samples)
        return xarray.Dataset(
            variables,
            coords={name: list(labels) for name, labels in self.axes.items()},
            attrs={"replicates": self.replicates, "seed": self._plan.seed},
        )

    # Parts -----------------------------------------------------------------------------------------

    if not TYPE_CHECKING:  # type checkers know that there are no brackets

        def __getitem__(self, label: Any) -> Any:
            plain = isinstance(label, str | float | int)
            axes = [name for name, labels in self.axes.items() if plain and label in labels]
            here = " or ".join(f"sel({name}={label!r})" for name in axes) or "sel(...), with labels of axes"
            raise SpecError(f"Results are not indexed with []: use {here}")

    def sel(self, **labels: Any) -> Results:
        """The results of some labels alone: cells, estimators, parameters.

        Parameters
        ----------
        **labels
            A label or a list of labels by axis, as in `axes`: ``nsr=0.2, estimator=["ml", "awls"]``.

        Returns
        -------
        Results
            Its arrays keep all axes, those of one label with length 1. `replicate` still fits with all
            estimators.

        Raises
        ------
        SpecError
            An axis or a label that is not in the study.

        Examples
        --------
        >>> import modfun as mf
        >>> study = mf.MonteCarlo(
        ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256,
        ...     nsr=[0.1, 0.2], estimators=["ls", "ml"],
        ... )
        >>> results = study.run(replicates=200, progress=False)
        >>> part = results.sel(nsr=0.2, estimator="ml", parameter="a1")
        >>> part.bias.shape, bool(part.sd.item() == results.sd[1, 1, 0])
        ((1, 1, 1), True)
        """
        return selected(self, labels)

    def compare(self, first: str, second: str) -> Table:
        """Compare two estimators on the same records, with the uncertainty of the comparison.

        They share the noise of each replicate, so that their difference is known better than `rmse_mcse` and
        `bias_mcse` of either suggest. The study has to keep its estimates, ``study.run(keep="samples")``.
        Replicates count in which both have an estimate.

        Parameters
        ----------
        first, second : str
            Names of estimators.

        Returns
        -------
        Table
            One row per cell and parameter: `rmse` and `bias` of the first less those of the second, their
            paired Monte Carlo standard errors (of `rmse` by the delta method), and the ratios `*_z`, which
            beyond ±2 or so are no chance. `closer` is the share of records in which the first is nearer to
            the true value, with its standard error: outliers hardly change it. `count` is the number of
            records.

        Raises
        ------
        SpecError
            An estimator that is not in the study, or estimates that were not kept.

        Examples
        --------
        >>> import modfun as mf
        >>> study = mf.MonteCarlo(
        ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256,
        ...     nsr=0.4, estimators=["ls", "ml"], seed=1,
        ... )
        >>> results = study.run(replicates=500, progress=False, keep="samples")
        >>> bool(results.compare("ml", "ls")["rmse_z"][0] < -10)
        True
        """
        return paired(self, first, second)

    # One replicate ---------------------------------------------------------------------------------

    def replicate(self, number: int, **cell: Any) -> tuple[Record, dict[str, Any]]:
        """One replicate made again from its address, and fitted.

        Parameters
        ----------
        number : int
            From 0 to replicates − 1.
        **cell
            Label of each axis with several: ``system="eq24", nsr=0.2``.

        Returns
        -------
        record : Record
        fits : dict of str to Fit
            By estimator; what a function returned as it is, or the exception that was raised.

        Raises
        ------
        SpecError
            A cell that is not in the study, or noise that was drawn as coefficients by several rules or
            windows, which no record has.
        DataError
            A function of yours made no record in this replicate; its own exception is the cause.
        """
        grid = [a.name for a in self._plan.axes]
        alone = {name: own[0] for name, own in self.axes.items() if name in grid and len(own) == 1}
        return replicate(self._plan, self.draw, self.replicates, number, alone | cell)

    def report(
        self,
        path: str | os.PathLike[str],
        *,
        directory: str | os.PathLike[str] | None = None,
        title: str | None = None,
    ) -> Path:
        """Write a page about the study: tables, figure, failures, provenance (extra ``report``).

        Parameters
        ----------
        path : path
            Ends in .html; a page that is there is replaced, once the new one is whole.
        directory : path, optional
            That of the study: hashes of its files, its runs and study.toml join the provenance.
        title : str, optional

        Returns
        -------
        Path
            Where it was written.

        Raises
        ------
        SpecError
            A place that cannot be written, or no directory of a study.
        ImportError
            jinja2 or matplotlib is not installed.
        """
        return write_study(self, path, directory=directory, title=title)

    # Looks -----------------------------------------------------------------------------------------

    def plot(self, ax: Any = None) -> Any:
        """Draw bias and standard deviation against NSR, as the report's Fig. 2; see `mf.plot.study`."""
        return study(self, ax=ax)

    def plot_histogram(self, ax: Any = None) -> Any:
        """Draw how the estimates are distributed, a panel per parameter; see `mf.plot.histogram`."""
        return histogram(self, ax=ax)

    def plot_quantiles(self, ax: Any = None) -> Any:
        """Draw the estimates against normal quantiles, a panel per parameter; see `mf.plot.quantiles`."""
        return quantiles(self, ax=ax)

    def __repr__(self) -> str:
        return repr(self._shown())

    def _repr_html_(self) -> str:
        return self._shown()._repr_html_()

    def _shown(self) -> Table:
        return self.relative() if np.any(np.isfinite(self.truth)) else self.table()
