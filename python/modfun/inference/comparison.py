"""Models beside each other: on one record, and on records that they were not fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.arguments import public
from ..base.arrays import F64
from ..base.tables import Table
from ..base.words import TRENDS
from ..errors import DataError, FitError, SpecError
from ..fitting.fit import Estimator, records_of
from ..fitting.single import fit_whole
from ..fitting.undeclared import fit_as_read
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from ..results.prediction import simulate_system
from ..results.scores import UNITS, of_response
from ..systems.lti import LTI
from ..systems.making import linear
from . import drawing
from .common import same_samples
from .criteria import Criteria, criteria_of

__all__ = ["Comparison", "CrossValidation", "compare", "cross_validate"]

BOUNDLESS = ("overflows", "leaves all bounds")  # what simulations of unstable models say
SCORES = ("signal_to_error", "fit_percent", "r2", "theil")
CRITERIA = ("aic", "bic")
BELOW = 0.1  # of −2 log Λ: what searches leave; at so small an F no decision depends on it


@public
class Comparison(Table):
    """Scores of several models on one record, one row per model and output; see `compare`.

    Columns: model, parameters (their number), output, signal_to_error (dB), fit_percent, r2, theil, aic and
    bic: of each model fitted again over the widest band of all of them. A model's own criteria count the
    lines of its own band, and do not compare; one whose delay starts the window late counts by what it gains
    over that window on the model of the longest. `likelihood_ratio` tests nested models.

    Where a fit of uneven samples is least squares of these, as of a dozen blood samples, criteria are of the
    responses at the samples that count: N log(RSS/N) of each output and record, of logarithms where the noise
    is log-normal, with free initial states and trends among the unknowns. `title` says so, and why a fit has
    no criteria.

    `aic` and `bic` are nan in every row where the fits are not of the same records and outputs, differ in
    `noise` or `output_weights`, or one was loaded without its records; and in the row of a model that cannot
    be fitted over that band, beside which the other cannot be fitted over its window, or which has no
    parameters: a linear system was not fitted to this record, so that no criterion of fits holds for it. The
    scores of a model too unstable to be simulated over the record are nan; `title` names it.

    Parameters
    ----------
    fits : dict of str to Fit or LTI
    record : Record

    See Also
    --------
    modfun.compare : Makes it.
    modfun.plot.comparison : Draws it.

    References
    ----------
    J. R. Raol, G. Girija, J. Singh, Modelling and Parameter Estimation of Dynamic Systems, IEE, 2004 (the
    scores).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> other = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1))
    >>> table = mf.compare({"no zero": fit, "one zero": other}, rec)
    >>> table["model"].tolist()
    ['no zero', 'one zero']
    """

    __slots__ = ("_criteria", "fits", "record")

    fits: dict[str, Fit | LTI]
    record: Record
    _criteria: Criteria

    def __init__(self, fits: dict[str, Fit | LTI], record: Record) -> None:
        columns: dict[str, list[Any]] = {"model": [], "parameters": [], "output": []}
        columns |= {score: [] for score in (*SCORES, *CRITERIA)}
        criteria = criteria_of(_fitted(fits))
        left = list[str]()
        for name, model in fits.items():
            rows = _scores(name, fits, record)
            if rows is None:
                left.append(name)
                rows = [{"output": output} for output in model.outputs or record.outputs]
            for row in rows:
                columns["model"].append(name)
                columns["parameters"].append(model.params.size if isinstance(model, Fit) else 0)
                columns["output"].append(row["output"])
                for score in SCORES:
                    columns[score].append(row.get(score, np.nan))
                for criterion, value in zip(CRITERIA, criteria.of(name), strict=True):
                    columns[criterion].append(value)
        span = f"over {record.duration:g} s"
        notes = [f"Too unstable to be simulated {span}: {', '.join(map(repr, left))}."] if left else []
        super().__init__(columns, "\n".join([*notes, *criteria.notes]) or None, units=UNITS)
        object.__setattr__(self, "fits", fits)
        object.__setattr__(self, "record", record)
        object.__setattr__(self, "_criteria", criteria)

    def likelihood_ratio(self, smaller: str, larger: str) -> Table:
        """Test whether a model explains more than one that is nested in it.

        The residuals of a fit are a few dozen real equations, of which the level of the noise is estimated,
        too: −2 log Λ is then larger than chi-square, whose test at 5 % rejects true models in up to 11 % of
        records. F = (Λ^(−2/N) − 1)(N − p)/q, with N equations, p parameters of the larger model and q more
        than the smaller has, follows the F distribution as in regression: 4 to 6 %. Where the noise
        covariance of m outputs is fitted, N and N − p are divided by m.

        Parameters
        ----------
        smaller, larger : str
            Names of the models; each model that the smaller one can be, the larger one can be, too.

        Returns
        -------
        Table
            One row: `minus_2_log`, that is −2 log Λ; `F` with its `df` (q) and `df_resid` (N − p) degrees of
            freedom; `p_value`, the probability of so large an F where the smaller model is true. `F` and
            `p_value` are nan, with a `title` that says why, where the larger model explains less: its search
            ended elsewhere.

        Raises
        ------
        SpecError
            A name that is not in the table, models whose criteria do not compare, or a larger model that has
            no more parameters.

        See Also
        --------
        modfun.Fit.table : t values, which test one parameter against 0.

        References
        ----------
        G. A. F. Seber, C. J. Wild, Nonlinear Regression, Wiley, 1989, section 5.3.

        Examples
        --------
        >>> import modfun as mf
        >>> system = mf.tf([5], [1, 3, 8])
        >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
        >>> fits = {f"{z} zeros": mf.fit(rec, mf.TransferFunction(poles=2, zeros=z)) for z in (0, 1)}
        >>> test = mf.compare(fits).likelihood_ratio("0 zeros", "1 zeros")
        >>> bool(test["p_value"][0] > 0.05)
        True
        """
        from scipy.special import fdtrc

        models = self["model"].tolist()
        for name in (smaller, larger):
            if name not in models:
                raise SpecError(f"likelihood_ratio: no model {name!r}; there are {list(self.fits)}")
        of = self._criteria
        if not {smaller, larger} <= {*of.found}:
            aic = self["aic"][[models.index(smaller), models.index(larger)]].tolist()
            raise SpecError(
                f"likelihood_ratio: the aic of {smaller!r} and {larger!r} are {aic}; give fits of the same "
                f"records and outputs with the same noise={''.join([f'. {note}' for note in of.notes])}"
            )
        (before, few), (after, many) = of.found[smaller], of.found[larger]
        if (more := many - few) < 1:
            raise SpecError(
                f"likelihood_ratio: {larger!r} has {many} parameters, {smaller!r} {few}; give the model "
                "with fewer first"
            )
        rows, df, ratio = of.rows / of.together, (of.rows - many) / of.together, before - after
        large = max(float(np.expm1(ratio / rows)), 0.0) * df / more
        title = None
        if ratio < -BELOW:
            large = np.nan
            title = (
                f"No test: {larger!r} explains less than {smaller!r}, which no model does that the other is "
                f"nested in. The search of one ended elsewhere: fit {larger!r} again from the estimates of "
                f"{smaller!r}, Free(start), or compare models by aic and bic that are not nested."
            )
        row = [smaller, larger, ratio, large, more, df, float(fdtrc(more, df, large))]
        names = ("smaller", "larger", "minus_2_log", "F", "df", "df_resid", "p_value")
        return Table({name: [value] for name, value in zip(names, row, strict=True)}, title)

    def plot(self, *, ax: Any = None) -> Any:
        """Measured and simulated outputs; see `modfun.plot.comparison`."""
        simulated = {}
        scored = self["model"][np.isfinite(self["theil"])]
        for name, model in self.fits.items():
            if name not in scored:
                continue
            if isinstance(model, Fit):
                simulated[name] = model.predict(self.record)
            else:
                rec, y = _beside(name, self.fits, self.record)
                simulated[name] = rec._like(y=y, mask=None, sigma=None)
        return drawing.comparison(self.record, simulated, self, ax)

    def __reduce__(self) -> tuple[Any, ...]:
        return Comparison, (self.fits, self.record)


def _scores(name: str, models: Mapping[str, Fit | LTI], record: Record) -> list[dict[str, Any]] | None:
    """The scores of a model's outputs; None where its response grows beyond all numbers."""
    model = models[name]
    try:
        return list(
            model.score(record) if isinstance(model, Fit) else of_response(*_beside(name, models, record))
        )
    except DataError as error:
        if not any(words in str(error) for words in BOUNDLESS):
            raise
        return None


def _fitted(models: Mapping[str, Fit | LTI]) -> dict[str, Fit]:
    return {name: model for name, model in models.items() if isinstance(model, Fit)}


def _beside(name: str, models: Mapping[str, Fit | LTI], record: Record) -> tuple[Record, F64]:
    """The channels of the record that a linear system among models has, and its response, (output, time).

    Channels without names are those of the first fit; the trend is the most general of the fits'.
    """
    system, fits = models[name], list(_fitted(models).values())
    assert isinstance(system, LTI)
    first = fits[0] if fits else record
    outputs, inputs = system.outputs or first.outputs, system.inputs or first.inputs
    if system.shape != (len(outputs), len(inputs)):
        raise SpecError(
            f"compare: {name!r} has {system.shape[0]} output(s) and {system.shape[1]} input(s), beside "
            f"outputs {list(outputs)} and inputs {list(inputs)}; take the channels of the record that the "
            "system has, rec.select(outputs=[...], inputs=[...])"
        )
    rec = record if (record.outputs, record.inputs) == (outputs, inputs) else record.select(outputs, inputs)
    if fits and fits[0].inputs == inputs and fits[0].intersample:
        rec = rec._read_like(fits[0].intersample)
    trend = max((fit.trend for fit in fits), key=TRENDS.index, default="constant")
    return rec, simulate_system(system, trend, rec)


@public
class CrossValidation(Table):
    """Scores on records left out of the fit, one row per estimator, record and output; see `cross_validate`.

    Columns: model, record (index of the one left out), output, signal_to_error (dB), fit_percent, r2, theil,
    status (of the fit to the others; "overflow": the model is too unstable to be simulated).

    Parameters
    ----------
    columns : mapping of str to sequence
    title : str, optional
    units : mapping of str to str, optional

    See Also
    --------
    modfun.cross_validate : Makes it.
    modfun.plot.cross_validation : Draws it.

    References
    ----------
    M. Stone, Cross-validatory choice and assessment of statistical predictions, J. R. Stat. Soc. B 36,
    1974.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.04, duration=10.0)
    >>> records = [mf.simulate(system, input=chirp, nsr=0.1, seed=seed) for seed in range(3)]
    >>> two = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=12)
    >>> cv = mf.cross_validate(records, {"two": two})
    >>> len(cv)
    3
    """

    __slots__ = ()

    def summary(self) -> Table:
        """Median scores over the records, one row per estimator and output, with the worst fit_percent."""
        keys = list(dict.fromkeys(zip(self["model"], self["output"], strict=True)))
        columns: dict[str, list[Any]] = {"model": [m for m, _ in keys], "output": [o for _, o in keys]}
        of = [(self["model"] == m) & (self["output"] == o) for m, o in keys]
        for score in SCORES:
            # A record without a score counts as the worst.
            worst = np.inf if score == "theil" else -np.inf
            values = np.where(np.isnan(self[score]), worst, self[score])
            columns[score] = [float(np.median(values[rows])) for rows in of]
        columns["worst_fit_percent"] = [
            float(np.min(np.nan_to_num(self["fit_percent"][rows], nan=-np.inf))) for rows in of
        ]
        return Table(columns, units=UNITS | {"worst_fit_percent": "%"})

    def plot(self, *, ax: Any = None) -> Any:
        """fit_percent of each record left out; see `modfun.plot.cross_validation`."""
        return drawing.cross_validation(self, ax)


@public
def compare(models: Mapping[str, Fit | LTI] | Sequence[Fit | LTI], rec: Record | None = None) -> Comparison:
    """Score several models on one record: simulations, initial state and trend fitted, as `Fit.score`.

    Parameters
    ----------
    models : mapping of str to Fit or LTI, or sequence of these
        By name; in a sequence each is named by its poles and zeros. A linear system (`mf.tf`, `mf.ss`, or of
        python-control or SciPy), such as a published model, has the channels of its names, or those of the
        first fit, and the most general trend of the fits ("constant" without fits).
    rec : Record, optional
        With the channels of the models; default: the one that the fits have in common.

    Returns
    -------
    Comparison
        A Table with `.plot()`. Its columns `aic` and `bic` are of one band for all, or of few uneven samples
        themselves, and nan where they do not compare; see `Comparison`.

    Raises
    ------
    SpecError
        No model, things that are no models, or a system with other numbers of channels.
    DataError
        A record with other channels, or none that is common.

    See Also
    --------
    modfun.cross_validate : On records that were not fitted.
    modfun.Fit.score : One fit.

    References
    ----------
    J. R. Raol, G. Girija, J. Singh, Modelling and Parameter Estimation of Dynamic Systems, IEE, 2004 (the
    scores).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> other = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1))
    >>> table = mf.compare({"no zero": fit, "one zero": other}, rec)
    >>> table["model"].tolist()
    ['no zero', 'one zero']
    """
    fits = {name: linear(model, "compare") for name, model in _named(models, "compare").items()}
    _refuse_others(fits, (Fit, LTI), "compare", "a Fit or a linear system")
    if rec is None:
        own = [fit.records for fit in _fitted(fits).values()]
        rec = own[0][0] if own and own[0] is not None else None
        if rec is None or any(r is None or len(r) != 1 or not same_samples(r[0], rec) for r in own):
            raise DataError("compare: the fits do not share one record of their own; give compare(fits, rec)")
    if not isinstance(rec, Record):
        raise SpecError(f"compare: rec is {type(rec).__name__!r}; give a Record")
    return Comparison(fits, rec)


@public
def cross_validate(
    records: Sequence[Record],
    estimators: Mapping[str, Estimator | TransferFunction] | Sequence[Estimator | TransferFunction],
) -> CrossValidation:
    """Fit to all records but one, score on that one, for each in turn.

    Parameters
    ----------
    records : sequence of Record
        Two at least, with the same channels; ``rec.split(every=...)`` makes several of one.
    estimators : mapping of str to Estimator, or sequence of Estimator
        By name; in a sequence each is named by its poles and zeros. A structure stands for its Estimator.

    Returns
    -------
    CrossValidation
        A Table with `.summary()` and `.plot()`. What could not be fitted or simulated has nan for scores.

    Raises
    ------
    SpecError, DataError
        As `fit`, or fewer than two records.

    See Also
    --------
    modfun.compare : On one record.
    modfun.select_order : The number of poles by a criterion.

    References
    ----------
    M. Stone, Cross-validatory choice and assessment of statistical predictions, J. R. Stat. Soc. B 36,
    1974.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.04, duration=10.0)
    >>> records = [mf.simulate(system, input=chirp, nsr=0.1, seed=seed) for seed in range(3)]
    >>> two = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=12)
    >>> cv = mf.cross_validate(records, {"two": two})
    >>> len(cv)
    3
    """
    all_records = records_of(records, "cross_validate")
    if len(all_records) < 2:
        raise DataError(
            "cross_validate: one record leaves nothing to fit when it is left out; "
            "give several, or pieces of it: rec.split(every=...)"
        )
    named = _named(estimators, "cross_validate")
    _refuse_others(named, (Estimator, TransferFunction), "cross_validate", "an Estimator")
    made = {
        name: Estimator(given) if isinstance(given, TransferFunction) else given
        for name, given in named.items()
    }
    names = ("model", "record", "output", *SCORES, "status")
    columns: dict[str, list[Any]] = {name: [] for name in names}
    for name, estimator in made.items():
        for k, rec in enumerate(all_records):
            others = all_records[:k] + all_records[k + 1 :]
            fit = fit_as_read(others, estimator.model, estimator.options, fit_whole)
            status = fit.status
            rows: list[dict[str, Any]] = [{"output": output} for output in rec.outputs]
            try:
                rows = list(fit.score(rec))
            except FitError:
                pass
            except DataError:
                status = "overflow"
            for row in rows:
                values = [name, k, row["output"], *(row.get(score, np.nan) for score in SCORES), status]
                for key, value in zip(names, values, strict=True):
                    columns[key].append(value)
    return CrossValidation(columns, units=UNITS)


def _named(given: Any, what: str) -> dict[str, Any]:
    """Models or estimators by name."""
    if isinstance(given, Mapping):
        named = {str(name): value for name, value in given.items()}
    elif isinstance(given, Sequence) and not isinstance(given, str):
        named = {}
        for value in given:
            label = _label(value)
            same = sum(name == label or name.startswith(f"{label} (") for name in named)
            named[f"{label} ({same + 1})" if same else label] = value
    else:
        raise SpecError(
            f"{what}: what is compared comes first, and it is a {type(given).__name__}; give it by name, "
            f'{what}({{"n=2": ...}}, ...), or as a list'
        )
    if not named:
        raise SpecError(f"{what}: nothing was given")
    return named


def _refuse_others(named: Mapping[str, Any], kinds: tuple[type, ...], what: str, word: str) -> None:
    for name, value in named.items():
        if not isinstance(value, kinds):
            raise SpecError(f"{what}: {name!r} is {type(value).__name__!r}, not {word}")


def _label(value: Any) -> str:
    structure = value.structure if isinstance(value, Fit) else getattr(value, "model", value)
    if not isinstance(structure, TransferFunction):
        return type(value).__name__
    words = [
        f"{_counted(given)} {word}{'' if given == 1 else 's'}"
        for given, word in ((structure.poles, "pole"), (structure.zeros, "zero"))
        if given is not None
    ]
    return ", ".join(words)


def _counted(given: Any) -> str:
    """A number, or numbers in a row; outputs apart by semicolons."""
    if not isinstance(given, tuple):
        return "none" if given is None else str(given)
    apart = "; " if any(isinstance(one, tuple) for one in given) else ", "
    return apart.join(_counted(one) for one in given)
