"""Fits of many records by one structure: what `fit_many` returns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import html
from ..base.arguments import public
from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.elsewhere import FITS, Elsewhere
from ..base.named import Named
from ..base.names import nearest
from ..base.optional import optional
from ..base.student import confidence, root, student_interval
from ..base.tables import Table
from ..base.words import STATUS, USABLE
from ..errors import ModfunError, SpecError
from ..models.options import Options
from .estimates import Estimates
from .fit import Fit
from .odd_records import Odd, odd_records
from .prediction import misses
from .process_noise import level_names, levels_of, of_many
from .uneven_noise import UNEVEN

__all__ = ["FitMany"]

# Standard errors. Fits of the same lines agree to 1e-6 of one; what single fits do beside is for larger ones.
APART = 3.0
NOT_BY_CHANCE = 1.001 * UNEVEN  # probability of as many changing records by chance: of 1 of 1 it is `UNEVEN`


@public
@dataclass(frozen=True, eq=False, repr=False)
class FitMany(Elsewhere):
    """Fits of many records by one structure.

    Attributes
    ----------
    params : (replicate, p) array
        Estimates; nan where the status allows none.
    bse : (replicate, p) array
        Standard errors of the chosen `cov_type`. Spectral ones allow for noise that changes over a record:
        when they are first asked for, a test looks for it in every record, and records where p < 0.01 are
        fitted again one by one.
    bse_even : (replicate, p) array
        The same for noise that does not change, known from the start.
    changing : (replicate,) array of bool
        Which records have noise that changes, as the test finds and `bse` allows for. All False for
        options that have no such test.
    status : (replicate,) array of str
        "ok", "maxiter", "rank" or "nonfinite"; the last also of a record whose fit ended in a FitError.
    cost : (replicate,) array
    nit : (replicate,) array of int
    param_names : tuple of str
    df_resid : int
        Of the first record where they differ.
    band : (float, float)
        Lowest and highest frequency used, rad/s.
    structure : TransferFunction, Equation or StateSpace
    options : Options
    degrees : int or (replicate, p) array
        Degrees of freedom of the intervals params ± t·bse.
    levels : tuple of two (replicate, level) arrays, or None
        With ``noise="process"`` or a `ProcessNoise`: the levels of `Fit.process_noise` and their
        standard errors.
    level_names : tuple of str
        What each of them is of, such as "measurement of y" and "process of y".
    odd : (replicate,) array of bool
        Which records are unlike the others: they leave more than three times as much, or an estimate is 20
        standard errors from the median of all. ``params[~odd]`` leaves them out.
    doubts : tuple of str
        Which records are odd. What single fits of the first, the middle, the last and the oddest record warn
        of, such as an input that is missing, and where their estimates are more than three standard errors
        from those here and closer to the samples: looked for when first asked, printed with the table.
    notes : tuple of str
        How inputs that nobody declared are read where their samples leave it open, and how many fits ended
        in a FitError, with the text of the first; in sentences.

    See Also
    --------
    modfun.fit_many : Makes it.
    modfun.Fit : One fit.

    References
    ----------
    R. Koenker, J. Econometrics 17, 1981, for noise that changes; the guide docs/howto/read_uncertainty.md.

    Examples
    --------
    >>> import modfun as mf
    >>> import numpy as np
    >>> clean = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> noise = 0.02 * np.random.default_rng(1).standard_normal((20, 1, 257))
    >>> batch = mf.Batch(y=clean.y + noise, u=clean.u, dt=clean.dt, intersample="smooth")
    >>> many = mf.fit_many(batch, mf.TransferFunction(poles=2, zeros=0), progress=False)
    >>> many.params.shape, many.failures
    ((20, 3), {})
    """

    _elsewhere = FITS

    params: F64
    bse_even: F64
    status: NDArray[np.str_]
    cost: F64
    nit: NDArray[np.intp]
    param_names: tuple[str, ...]
    df_resid: int
    band: tuple[float, float]
    structure: Any
    options: Options
    degrees: Any
    levels: tuple[F64, F64] | None = None
    level_names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    alone: Callable[[int], Fit] | None = None
    look: Callable[[FitMany], tuple[NDArray[np.bool_], F64]] | None = None

    @cached_property
    def _looked(self) -> tuple[NDArray[np.bool_], F64]:
        if self.look is None:
            return np.zeros(len(self), bool), self.bse_even
        return self.look(self)

    @cached_property
    def _odd(self) -> Odd:
        return odd_records(self.params, self.bse_even, self.cost, self.usable, self.param_names)

    @property
    def odd(self) -> NDArray[np.bool_]:
        return self._odd.records

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What fits of a few records alone warn of; looked for when first asked, printed with the table."""
        good = np.flatnonzero(self.usable)
        if self.alone is None or good.size == 0:
            return self._odd.texts
        few = _few(good.tolist(), self._odd)
        apart: dict[int, str] = {}
        said: dict[int, str] = {}
        for r in few:
            try:
                fit = self.alone(r)
                remarks = fit.remarks()
            except ModfunError:  # what a single fit refuses, such as an input that hardly moves
                continue
            if text := _apart(self.params[r], fit):
                apart[r] = text
            if remarks:
                said[r] = remarks[0].removeprefix("fit: ")
        doubts = {"have other estimates than among many": apart, "raise doubts": said}
        return self._odd.texts + tuple(
            [
                f"{len(found)} of {len(few)} records that were fitted alone {what}; record "
                + "{}: {}".format(*next(iter(found.items())))
                for what, found in doubts.items()
                if found
            ]
        )

    @property
    def bse(self) -> F64:
        return self._looked[1]

    @property
    def changing(self) -> NDArray[np.bool_]:
        return self._looked[0]

    def conf_int(self, level: float = 0.95) -> F64:
        """Confidence intervals, (replicate, p, 2), from Student's t; nan where there is no estimate."""
        level = confidence("conf_int", level)
        return np.stack(student_interval(self.params, self.bse, self.degrees, level), axis=-1)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which fits settled."""
        return np.asarray(self.status == "ok")

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Which records have an estimate, settled or not: the rule of `Fit.usable` and of studies.

        To leave out those that did not settle would make the others look better than they are.
        """
        found = np.isin(self.status, USABLE) & np.isfinite(self.params).all(axis=1)
        return np.asarray(found)

    @property
    def failures(self) -> dict[str, int]:
        """Number of replicates by status, "ok" left out."""
        return {word: int(np.sum(self.status == word)) for word in STATUS[1:] if np.any(self.status == word)}

    def __len__(self) -> int:
        return int(self.params.shape[0])

    def __getitem__(self, name: str) -> F64:
        """Estimates of one parameter, (replicate,)."""
        if not isinstance(name, str):
            raise SpecError(
                f"FitMany: [{name!r}] is no parameter; params[{name!r}] holds the estimates of one record, "
                f"and mf.fit(records[{name!r}], model) returns its whole fit"
            )
        if name not in self.param_names:
            raise SpecError(f"there is no parameter {name!r}; {nearest(name, self.param_names)}")
        return self.params[:, self.param_names.index(name)]

    def table(self) -> Table:
        """Mean, standard deviation, median, mean standard error of each parameter: the `usable` fits."""
        good = self.usable
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
            title=f"{int(good.sum())} of {len(self)} fits have an estimate"
            + self._of_changes()
            + "".join(f"\n{text}" for text in self.doubts),
        )

    def _of_changes(self) -> str:
        """How many records have noise that changes, if more than chance finds: 1 in 100."""
        from scipy.special import bdtrc

        count, rows = int(self.changing[self.usable].sum()), int(self.usable.sum())
        chance = bdtrc(count - 1, rows, UNEVEN) if count else 1.0
        return f"; the noise of {count} changes over the record" if chance < NOT_BY_CHANCE else ""

    def process_noise(self) -> Table:
        """Levels of noise="process" over the `usable` fits: mean, standard deviation, median, mean error."""
        return of_many(self.levels, self.usable, self.level_names, self.options.noise)

    def to_pandas(self) -> Any:
        """A pandas.DataFrame (extra ``pandas``): one row per replicate, bse of a1 as column "a1_bse"."""
        columns: dict[str, Any] = dict(zip(self.param_names, self.params.T, strict=True))
        columns |= {f"{name}_bse": bse for name, bse in zip(self.param_names, self.bse.T, strict=True)}
        if self.levels is not None:
            columns |= dict(zip(self.level_names, self.levels[0].T, strict=True))
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
        line = (
            f"FitMany of {len(self)} records by {self.structure!r}: {int(self.success.sum())} ok"
            f"{', ' + failed if failed else ''}, {self.options.method}, band {low:.4g} to {high:.4g} rad/s"
        )
        return "\n".join((line, *self.notes, *self.doubts))

    def _repr_html_(self) -> str:
        return self.table()._repr_html_() + html.listing((*self.notes, *self.doubts))

    @staticmethod
    def of_fits(
        fits: Sequence[Fit | None], structure: Any, options: Options, notes: tuple[str, ...] = ()
    ) -> FitMany:
        """Single fits as one result, None for a record without; what differs is that of the first."""
        found = {k: f for k, f in enumerate(fits) if f is not None}
        good = list(found.values())
        first, place = good[0], list(found)

        def rows(values: Any, missing: Any = np.nan) -> Any:
            own = np.asarray(values)
            every = np.full((len(fits), *own.shape[1:]), missing, np.result_type(own, np.asarray(missing)))
            every[place] = own
            return every

        driven = _driven([_of_fit(f) for f in good], first.layout, options)
        if "levels" in driven:
            driven["levels"] = tuple([rows(values) for values in driven["levels"]])
        made = FitMany(
            params=rows([f.params for f in good]),
            bse_even=rows([root(np.diag(Estimates.cov_params(f))) for f in good]),
            status=rows([f.status for f in good], "nonfinite"),
            cost=rows([f.cost for f in good]),
            nit=rows([f.nit for f in good], 0),
            param_names=first.param_names,
            df_resid=first.df_resid,
            degrees=rows([np.broadcast_to(f.degrees, f.params.shape) for f in good]),
            band=first.band,
            structure=structure,
            options=options,
            notes=notes,
            **driven,
        )
        odd, looked = made._odd, (rows([f.changing for f in good], False), rows([f.bse for f in good]))
        kept = {r: found[r] for r in _few(place, odd)}
        made = replace(made, alone=kept.__getitem__)
        made.__dict__.update(_odd=odd, _looked=looked)
        return made

    def with_fits(self, fits: Mapping[int, Fit]) -> FitMany:
        """The same with single fits of equations to some records in the place of those among many."""
        if not fits:
            return self
        rows, good, before = list(fits), list(fits.values()), self.look

        def put(into: Any, values: Any) -> Any:
            made = np.array(into)
            made[rows] = values
            return made

        def look(many: FitMany) -> tuple[NDArray[np.bool_], F64]:
            changing, bse = (np.zeros(len(many), bool), many.bse_even) if before is None else before(many)
            return put(changing, changed), put(bse, errors)

        even = [root(np.diag(Estimates.cov_params(f))) for f in good]
        tested = before is not None
        changed = [tested and f.changing for f in good]
        errors = [f.spread for f in good] if tested else even
        degrees = np.broadcast_to(self.degrees, self.params.shape)
        return replace(
            self,
            params=put(self.params, [f.params if f.status in USABLE else np.nan * f.params for f in good]),
            bse_even=put(self.bse_even, even),
            status=put(self.status, [f.status for f in good]),
            cost=put(self.cost, [_cost(f) for f in good]),
            nit=put(self.nit, [f.nit for f in good]),
            degrees=put(degrees, [np.broadcast_to(f.degrees, f.params.shape) for f in good]),
            look=look,
        )

    @staticmethod
    def of_core(
        found: Mapping[str, Any],
        layout: Any,
        structure: Any,
        options: Options,
        alone: Callable[[int], Fit],
        look: Callable[[FitMany], tuple[NDArray[np.bool_], F64]] | None,
        notes: tuple[str, ...] = (),
    ) -> FitMany:
        """The core's answer for a batch; `alone` fits one record, `look` finds noise that changes."""
        (low, high), omega0 = found["lines"][0], found["omega0"][0]
        status = np.array(STATUS).take(found["status"])
        ended = np.isin(status, USABLE)[:, None]  # elsewhere the core leaves what it began with
        return FitMany(
            params=np.where(ended, found["theta"], np.nan),
            bse_even=found[f"bse_{options.cov_type.lower()}"],
            status=status,
            cost=found["cost"],
            nit=found["nit"],
            param_names=layout.param_names,
            df_resid=found["df_resid"],
            degrees=found.get(f"df_{options.cov_type.lower()}", found["df_resid"]),
            band=(low * omega0, high * omega0),
            structure=structure,
            options=options,
            notes=notes,
            alone=alone,
            look=look,
            **_driven(
                zip(found["process_levels"], found["bse_process_levels"], strict=True)
                if "process_levels" in found
                else [],
                layout,
                options,
            ),
        )


def _cost(fit: Any) -> float:
    """The cost of a fit of equations as the core counts it: that of one channel in units of its noise."""
    return float(fit.cost if fit.levels.shape[1] > 1 else fit.cost / fit.levels[0, 0] ** 2)


def _few(records: Sequence[int], odd: Odd) -> list[int]:
    """The first, the middle and the last of these, and the oddest."""
    few = {records[0], records[len(records) // 2], records[-1]}
    return sorted(few if odd.worst is None else few | {odd.worst})


def _apart(params: F64, fit: Fit) -> str | None:
    """Where estimates of a record among many are far from those of its own fit, and suit it less.

    Of two minima that are as likely either search may find one: the response tells which is the better.
    """
    error = fit.bse
    told = np.isfinite(error) & (error > 0) & fit.success
    steps = np.abs(params - fit.params) / np.where(told, error, np.inf)
    k = int(np.argmax(steps))
    if fit.records is None or not steps[k] > APART:
        return None
    size = sum([rec.y.size for rec in fit.records])
    there = replace(fit, params=Named(params, fit.param_names))
    own, here = (float(np.sqrt(misses(one) / size)) for one in (fit, there))
    if not here > own:
        return None
    return (
        f"{fit.param_names[k]} = {fit.params[k]:.4g} ± {error[k]:.2g} instead of {params[k]:.4g}, and the "
        f"response leaves {100 * own:.3g} % of the outputs instead of {100 * here:.3g} %; fit each record by "
        "itself, mf.fit(data[k], model)"
    )


def _of_fit(fit: Fit) -> tuple[F64, F64] | None:
    """Levels of a fit and their standard errors, as the core has them."""
    if fit.process_levels is None:
        return None
    values, cov, _ = fit.process_levels
    return values, root(np.diag(cov)[-values.size :])


def _driven(found: Iterable[tuple[F64, F64] | None], layout: Any, options: Options) -> dict[str, Any]:
    """Fields of the levels of noise, one row a fit; none where there are no such levels."""
    each = [own for own in found if own is not None]
    if not each or not options.drives:
        return {}
    levels = levels_of(np.array([values for values, _ in each]), np.array([errors for _, errors in each]))
    return {"levels": levels, "level_names": level_names(layout, options, levels[0].shape[1])}
