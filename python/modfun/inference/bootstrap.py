"""The bootstrap: refits of records that a fit itself might have produced."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._core import normal_rows
from ..base.arguments import public, whole
from ..base.arrays import F64
from ..base.names import nearest
from ..base.progress import Progress
from ..base.student import confidence, root, student_tail
from ..base.tables import Table
from ..errors import DataError, FitError, SpecError
from ..fitting.by_response import by_response
from ..fitting.fit import fit_many, threads_of
from ..fitting.restarts import compared
from ..fitting.single import fit_quietly
from ..models.free import Free, priors_of, to_plain
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.batches import Batch
from ..records.record import Record
from ..results.derived import as_function
from ..results.diagnosis import growth
from ..results.fit import Fit
from ..results.many import FitMany
from ..results.of_equations import EquationFit
from ..results.prediction import InitialState
from ..results.refits import starts_beside
from .bootstrap_noise import chosen, levels_in_time, white, wild

__all__ = ["Bootstrap", "bootstrap"]

KINDS = ("auto", "parametric", "wild")
BLOCK = 2**20  # samples held at a time
SLOW = 100  # refits of rate laws after which the bar moves
FAR = 1000.0  # of the largest sample: a response beyond it is no record that the fit might have produced


@dataclass(frozen=True, eq=False, repr=False)
class Bootstrap(FitMany):
    """Refits of resampled records, and what their scatter says; see `bootstrap` and `FitMany`.

    Figures are those of the `usable` replicates, status "ok" or "maxiter", as in studies; `failures` counts
    all that are not "ok". `*_mcse` is the Monte Carlo standard error of a figure: what another
    seed would change. The bootstrap's standard errors are `sd`; `bse`, as in `FitMany`, holds those that each
    refit states of itself.

    Attributes
    ----------
    fit : Fit
        The fit that was resampled.
    kind : str
        "parametric" or "wild", also where `bootstrap` chose it.
    why : str
        Why that kind was chosen, and that the noise changes over the record; empty where neither applies.
    seed : int
    """

    fit: Fit = field(kw_only=True)
    kind: str = field(kw_only=True)
    why: str = field(kw_only=True, default="")
    seed: int = field(kw_only=True)

    @property
    def sd(self) -> F64:
        """Standard deviations of the replicates, (p,): the bootstrap's standard errors of the fit."""
        return np.asarray(np.sqrt(np.diag(self.cov_params())))

    @property
    def sd_mcse(self) -> F64:
        """√((m₄ − m₂²)/R)/2sd with the central moments of R replicates (delta method); nan of two."""
        about = self._good(2) - self._good(2).mean(axis=0)
        if len(about) == 2:  # m₄ = m₂² whatever they are
            return np.full(about.shape[1], np.nan)
        spread = np.mean(about**4, axis=0) - np.mean(about**2, axis=0) ** 2
        return np.asarray(np.sqrt(np.maximum(spread, 0.0) / len(about)) / (2 * self.sd))

    @property
    def bias(self) -> F64:
        """Mean of the replicates less the fit's estimate, (p,): an estimate of the fit's own bias."""
        return np.asarray(self._good(1).mean(axis=0) - self.fit.params)

    @property
    def bias_mcse(self) -> F64:
        """sd/√R."""
        return np.asarray(self.sd / np.sqrt(len(self._good(2))))

    def cov_params(self) -> F64:
        """Covariance matrix of the replicates, (p, p)."""
        return np.atleast_2d(np.cov(self._good(2), rowvar=False))

    def conf_int(self, level: float = 0.95) -> F64:
        """Confidence intervals of the parameters, (p, 2): quantiles of the replicates.

        Parameters
        ----------
        level : float

        Notes
        -----
        Refits of the parametric kind are drawn with a noise level that the fit only estimated. Their
        quantiles are therefore those at which Student's t, with the degrees of freedom of the residuals,
        has its tails: those at 2.1 and 97.9 % make an interval of 95 % with 30 degrees. Lines of the wild
        kind are enlarged already. Of R replicates the k-th in order is the quantile k/(R + 1).
        """
        return self._ends(level, self._good(2), self.fit.params)[0]

    def derived(self, **expressions: str | Callable[[Mapping[str, float]], float]) -> Table:
        """Functions of the parameters with standard errors and intervals from the refits.

        Parameters
        ----------
        **expressions : str or callable
            As in `Fit.derived`.

        Returns
        -------
        Table
            Columns name, value (at the fit's estimate), sd, low and high (95 %, as in `conf_int`), nan where
            a refit has no value.
        """
        value = self.fit.derived(**expressions)["value"]
        rows = self._good(2)
        found = np.empty((len(rows), len(value)))
        for k, (name, given) in enumerate(expressions.items()):
            function = as_function(name, given, self.param_names)
            found[:, k] = [function(dict(zip(self.param_names, row, strict=True))) for row in rows.tolist()]
        ends, _ = self._ends(0.95, found, np.asarray(value))
        return Table(
            {
                "name": list(expressions),
                "value": value,
                "sd": found.std(axis=0, ddof=1),
                "low": ends[:, 0],
                "high": ends[:, 1],
            }
        )

    def summary(self, level: float = 0.95) -> Table:
        """Estimate, standard error, bias and interval of each parameter, with Monte Carlo errors.

        Parameters
        ----------
        level : float
            Of the intervals, as in `conf_int`.

        Returns
        -------
        Table
            Columns parameter, value, bse (the fit's), sd, bias, low and high, `_mcse` beside what the
            number of replicates limits.
        """
        ends, errors = self._ends(level, self._good(2), self.fit.params)
        count = len(self._good(2))
        why = f" ({self.why})" if self.why else ""
        return Table(
            {
                "parameter": list(self.param_names),
                "value": self.fit.params,
                "bse": self.fit.bse,
                "sd": self.sd,
                "sd_mcse": self.sd_mcse,
                "bias": self.bias,
                "bias_mcse": self.bias_mcse,
                "low": ends[:, 0],
                "low_mcse": errors[:, 0],
                "high": ends[:, 1],
                "high_mcse": errors[:, 1],
            },
            title=f"{self.kind} bootstrap{why}, {count} of {len(self)} refits have an estimate, "
            f"seed {self.seed}; intervals of {100 * level:g} %",
        )

    def _ends(self, level: float, replicates: F64, estimate: F64) -> tuple[F64, F64]:
        """Limits of columns of replicates (R, p) and their Monte Carlo standard errors, each (p, 2).

        The k-th of R in order has a probability with a beta distribution of k and R + 1 - k, which gives each
        replicate the weight with which another draw of R has it there (Maritz and Jarrett, 1978).
        """
        from scipy.special import betainc

        level = confidence("conf_int", level)
        theta = np.sort(replicates, axis=0)
        tail = student_tail(self.fit.df_resid, level) if self.kind == "parametric" else (1 - level) / 2
        tails, count = np.array([tail, 1 - tail]), len(theta)
        place = tails[:, None] * (count + 1)
        shares = np.linspace(0, 1, count + 1)
        weights = np.diff(betainc(place, count + 1 - place, shares), axis=1)
        about = theta - estimate
        spread = weights @ about**2 - (weights @ about) ** 2
        return np.quantile(theta, tails, axis=0, method="weibull").T, root(spread).T

    def _good(self, least: int) -> F64:
        good = self.params[self.usable]
        if len(good) < least:
            counts = ", ".join(f"{n} {word}" for word, n in self.failures.items())
            raise FitError(
                f"bootstrap: {len(good)} of {len(self)} refits have an estimate ({counts}), {least} are "
                "needed; give more replicates, or a structure or band that the records determine"
            )
        return good

    def __repr__(self) -> str:
        return repr(self.summary())

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


@public
def bootstrap(
    fit: Fit,
    *,
    replicates: int = 1000,
    seed: int = 0,
    kind: str = "auto",
    threads: int | None = None,
    progress: str | bool = "auto",
) -> Bootstrap:
    """Standard errors, bias and intervals of a fit from refits of records like its own.

    A replicate is the fitted model's response to the fit's inputs, from the initial state and with the
    trend found for each record, plus noise; it is fitted by the same structure and options, the band
    held at the fit's. Means of priors are drawn anew, too, around the estimates. The kinds differ
    in the noise and in what they take for granted:

    "auto"
        "wild" where the fit's noise is coloured, or its residual lines contradict one level over the band
        or the level of the high band, with a p-value below 0.01 as in `Fit.check`; else "parametric".
        Noise that "wild" cannot draw is drawn "parametric": that of uneven samples, masks, sigma and a past.
        The summary's title names the kind and why.
    "parametric"
        Independent normal samples of covariance `fit.noise_cov`, the level seen in the fit's band ("ls"
        and "wls", which do not weight by output noise: that of the residuals in time), times the sigma of
        a record that has one. Right where the noise of the outputs is white, like `cov_type="nonrobust"`;
        takes more than normal theory for granted in nothing else, so it shows the bias and the skewness
        of an estimate. In AR(0.9) noise on records of 10 s, 95 % intervals contained the truth in 66 to
        88 % of the records, the fewer the wider the band; those of "wild" did in 91 to 95 %.
    "wild"
        The fit's residuals y − ŷ in time with each line of their spectrum turned by an angle of its own,
        all angles equally likely and the same for all outputs: independent lines of the power seen at
        each frequency, whatever the colour of the noise, as HC3 takes it. A fit leaves residuals smaller
        than the noise, so the real and imaginary part of each line in the fit's band are first divided by
        1 − h, as in HC3, h being the leverage of the parameters, end conditions and trend on it. Takes for
        granted that the structure can describe the system, and that the noise is stationary but for its
        level.

    Where the noise changes over the record, as `Fit.check` reports it, both kinds draw it with the level in
    time that the residuals show.

    Parameters
    ----------
    fit : Fit
        With status "ok" and its records. Several records are refitted together.
    replicates : int, default 1000
    seed : int, default 0
        Every random number is addressed by seed, replicate and record.
    kind : {"auto", "parametric", "wild"}
    threads : int, optional
        For the fit of one evenly sampled record; default: MODFUN_NUM_THREADS, else the cores this
        process may use. The numbers do not depend on it. Other fits are repeated one after the other.
    progress : {"auto", True, False}
        On standard error; "auto": from two seconds on.

    Returns
    -------
    Bootstrap

    Raises
    ------
    FitError
        A fit that did not succeed, one without its records (as loaded from a file), or an estimate so
        unstable that it cannot be simulated.
    SpecError
        An unknown word, or noise that the kind cannot draw: that of inputs, and coloured noise with
        "parametric".
    DataError
        Uneven sampling, masked samples or a sigma with "wild", which needs a spectrum.

    See Also
    --------
    modfun.Fit.conf_int : Intervals by formula.
    modfun.MonteCarlo : Studies with a known truth.

    References
    ----------
    B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, Chapman & Hall, 1993.

    Examples
    --------
    >>> import modfun as mf
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> mf.bootstrap(fit, replicates=200, kind="wild").conf_int(0.9).shape
    (3, 2)
    """
    records = _records(fit)
    if kind not in KINDS:
        raise SpecError(f"bootstrap: kind={kind!r} is not available; {nearest(kind, KINDS)}")
    count = whole("bootstrap", "replicates", replicates, 2, 10**9)
    address = whole("bootstrap", "seed", seed, 0, 2**64 - 1)
    workers = threads_of(threads)
    held = _held(fit)
    found = _simulated(fit, records)
    clean = [y for y, _ in found]
    kind, why = chosen(fit, records) if kind == "auto" else (kind, "")
    levels = levels_in_time(fit, records)
    if levels is not None:
        why += f"{'; ' if why else ''}the noise changes over the record and is drawn so"
    noise = (white if kind == "parametric" else wild)(fit, records, found, address, levels)

    parts: list[FitMany] = []
    with Progress(progress, f"{kind} bootstrap") as bar:
        for block in _blocks(count, fit, records):
            ys = [np.add(y, e, out=e) for y, e in zip(clean, noise(block), strict=True)]
            structures = _redrawn(fit, block, address)
            parts.append(_refit(fit, records, ys, held, workers, structures))
            bar(block.stop, count)
    names = ["params", "bse_even", "status", "cost", "nit"]  # the noise of refits does not change
    figures: dict[str, Any] = {n: np.concatenate([getattr(part, n) for part in parts]) for n in names}
    each = [np.broadcast_to(part.degrees, part.params.shape) for part in parts]
    return Bootstrap(
        **figures,
        degrees=np.concatenate(each),
        param_names=fit.param_names,
        df_resid=fit.df_resid,
        band=fit.band,
        structure=fit.structure,
        options=held,
        fit=fit,
        kind=kind,
        why=why,
        seed=address,
    )


def _simulated(fit: Fit, records: tuple[Record, ...]) -> list[tuple[F64, InitialState]]:
    """Responses of the fit to each record's inputs, which have to stay within sight of the record."""
    grows = growth(fit)
    try:
        with np.errstate(all="ignore"):  # what overflows is refused below
            found = [fit.simulate(rec) for rec in records]
    except DataError:
        if not grows > 0:
            raise
        found = []
    pairs = zip(records, found, strict=False)
    if found and all(np.max(np.abs(y)) <= FAR * np.max(np.abs(rec.y)) for rec, (y, _) in pairs):
        return found
    pole = f" (fastest growing pole {grows:.4g} rad/s)" if grows > 0 else ""
    raise FitError(
        f"bootstrap: the response of the estimate leaves the record far behind{pole}, so there is nothing "
        "like it to refit; fit with stable=True, or a structure or band that the record determines"
    )


# Refits -------------------------------------------------------------------------------------------


def _held(fit: Fit) -> Options:
    """The fit's options with the band that a rule chose written down."""
    if fit.options.band is not None or fit.options.harmonics is not None:
        return fit.options
    if len(fit.lines) == 1 and not fit.with_past:
        return fit.options.replace(harmonics=fit.harmonics)
    return fit.options.replace(band=fit.band)


def _blocks(count: int, fit: Fit, records: tuple[Record, ...]) -> Iterator[range]:
    size = max(1, BLOCK // sum(rec.t.size for rec in records))
    layout: Any = fit.layout
    if isinstance(fit, EquationFit) and compared(layout.compiled):  # some may be fitted alone
        size = min(size, SLOW)
    for start in range(0, count, size):
        yield range(start, min(start + size, count))


def _redrawn(fit: Fit, block: range, seed: int) -> list[Any]:
    """The structure for each replicate, with means of priors as the fitted system might have given them."""
    priors = priors_of(fit.structure)
    if not priors:
        return [fit.structure] * len(block)
    rows = normal_rows(seed, "bootstrap", 1, block.start, 0, len(block), len(priors))
    return [_with_means(fit, dict(zip(priors, row.tolist(), strict=True))) for row in rows]


def _with_means(fit: Fit, errors: dict[str, float]) -> Any:
    """The structure with the means of its priors at the estimates and so many standard deviations off."""
    structure, priors = fit.structure, priors_of(fit.structure)
    moved = {
        name: Free(
            min(max(fit[name] + error * (priors[name].sd or 0.0), priors[name].min), priors[name].max),
            min=priors[name].min, max=priors[name].max, sd=priors[name].sd,
        )
        for name, error in errors.items()
    }  # fmt: skip
    params = {name: moved.get(name, given) for name, given in structure.params}
    if not isinstance(structure, TransferFunction):
        plain = {name: to_plain(given) for name, given in params.items()}
        return type(structure).from_dict({**structure.to_dict(), "params": plain})
    words = {name: getattr(structure, name) for name in ("poles", "zeros", "denominator")}
    return TransferFunction(**words, delay=moved.get("delay", structure.delay), params=params)


def _refit(
    fit: Fit, records: tuple[Record, ...], ys: list[F64], held: Options, threads: int, structures: list[Any]
) -> FitMany:
    """Fits of replicates whose samples are `ys`, (replicate, output, time) a record."""
    first = records[0]
    led_on = getattr(fit, "by_response", False)  # sums alone may have no answer in any replicate
    alike = (
        first.mask is None and first.sigma is None and not first.functions and not priors_of(fit.structure)
    )
    alike = alike and not led_on
    if len(records) == 1 and first.dt is not None and alike:
        batch = Batch(
            y=ys[0],
            u=first.u if first.inputs else None,
            dt=first.dt,
            outputs=first.outputs,
            inputs=first.inputs,
            intersample=first.intersample,
        )
        return fit_many(batch, fit.structure, threads=threads, progress=False, **held.given())
    fits = [
        fit_quietly(
            tuple(rec._like(y=y) for rec, y in zip(records, own, strict=True)),
            structure,
            held,
            **starts_beside(fit, structure),
        )
        for structure, *own in zip(structures, *ys, strict=True)
    ]
    return FitMany.of_fits([by_response(one) for one in fits] if led_on else fits, fit.structure, held)


# What users give ----------------------------------------------------------------------------------


def _records(fit: Fit) -> tuple[Record, ...]:
    if not isinstance(fit, Fit):
        raise SpecError(f"bootstrap: expected a Fit, as from mf.fit, got {type(fit).__name__}")
    if not fit.success:
        raise FitError(f"bootstrap: the fit did not succeed (status {fit.status!r}). {fit.message}")
    if fit.window_weights:
        raise SpecError(
            "bootstrap: the fit weighs its windows (a stream that forgets), and refits would not; bootstrap "
            "mf.fit(stream.record(), fit.structure, **fit.options.given())"
        )
    if fit.records is None:
        raise FitError(
            "bootstrap: this fit was loaded or made without its samples; fit the records again: "
            "mf.fit(records, fit.structure, **fit.options.given())"
        )
    return fit.records
