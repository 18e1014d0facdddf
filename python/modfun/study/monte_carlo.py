"""Monte Carlo studies: estimators on simulated records over a grid of systems, inputs and noise levels."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack, cast, overload

import numpy as np

from ..base.arguments import public, whole
from ..base.names import close, nearest
from ..equations.nonlinear import NonlinearModel
from ..errors import ModfunWarning, SpecError
from ..experiments.simulation import doubtful_nsr
from ..fitting.fit import threads_of
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..signals import Signals
from ..systems.lti import LTI
from ..systems.making import linear
from .axes import Axis, axis, levels
from .contenders import Contender, contenders
from .generated import Generated, cells, grid_axes
from .groups import Group, groups
from .plan import Plan
from .results import Results

__all__ = ["MonteCarlo", "Results"]

MOST = 10**9


class RunOptions(TypedDict, total=False):
    """What `MonteCarlo.run` takes besides `shard`; see there."""

    replicates: int | None
    until: Mapping[str, float] | None
    threads: int | None
    executor: Any
    directory: str | Path | None
    progress: str | bool
    keep: str
    draw: str
    coverage: bool


@public
class MonteCarlo:
    """A study of estimators on simulated records.

    Inputs, noise-free responses (exact between the samples) and default bands are worked out here, once;
    `run` adds noise and estimates. Random numbers are addressed by seed, replicate and (system, input,
    initial state), or cell of the `grid`: all noise levels and estimators see the same numbers, so that they
    compare without the noise of the comparison.

    Parameters
    ----------
    system : LTI or NonlinearModel, or of python-control or SciPy, or dict of name to these
        A dict is an axis of the study with names, here and below.
    input : Signals, str, array_like, callable, list of these, or dict of name to any of these
        `mf.signals`, which bring their duration, sampling, form between samples and names; or one signal an
        input of the system: text such as ``"sin(t**2/5)"``, intervals + 1 samples, or a
        function of t.
    duration : float
        Length T of a record, s.
    intervals : int
        Number of sampling intervals N; a record has N + 1 samples.
    nsr : float or list of float, default 0
        Standard deviation of the noise over the root mean square of the noise-free response from rest; of
        equations, which need not rest at zero, the response from an `initial_state` given in numbers.
    noise : "white", callable, or dict of name to these
        What the noise is. ``noise(rng, y, dt)`` returns noise of unit standard deviation for each sample of
        the noise-free output y, shape (time,); it is multiplied by nsr and the root mean square of the
        response from rest, not scaled otherwise, and serves all noise levels.
    process_noise : float, sequence of float or ProcessNoise, default 0
        Level of noise that drives linear systems themselves, as `simulate` takes it: drawn anew in each
        replicate, the same at all noise levels.
    initial_state : {"zero", "random"}, array_like, callable, or dict of name to these
        "random": normal in each replicate, each state with the root mean square it has in the response
        from rest. An array: the states, of a transfer function y, y', … of the free response, of equations
        in the order of `NonlinearModel.states`. A function:
        ``initial_state(rng)`` returns such an array. What estimators know of it is an option of theirs,
        ``mf.Estimator(structure, initial_state="rest")``.
    generate : callable
        Instead of all the above: ``generate(cell, rng)`` returns the Record of a replicate in a cell of
        `grid`, a dict of its labels. Sampling, length and inputs may differ between replicates, the names
        of the channels may not.
    grid : dict of str to list of numbers or texts, optional
        Axes of a study with `generate`; without it there is one cell.
    truth : dict of str to float, or callable, optional
        True parameters of a study with `generate`, or ``truth(cell)`` that returns them; without the truth
        of a parameter its bias, median, rmse and coverage are nan.
    estimators : list of str, or dict of name to str, Estimator or callable
        Methods of `fit` ("ls", "wls", "awls", "ml"); or by name methods, Estimators, rivals, or functions
        ``mine(record, rng)`` that return a dict of parameters, an array of them in the order of
        `TransferFunction.param_names` (of `truth`, where there is no structure), or a Fit. Coverage
        is that of a Fit's intervals, or of a dict with standard errors, "a1_se" beside "a1", of value ± 1.96
        of these; that of other answers is nan.
    metrics : dict of str to callable, optional
        ``metric(fit, record)`` returns a number that is summed up in `Results.metrics`; fit is a Fit, or
        what a function of yours returned. Fits are then made one by one, some hundred times slower: about a
        millisecond for a transfer function, ten for a nonlinear equation. What needs estimates alone is
        computed at once from `Results.samples`, ``run(keep="samples")``.
    model : TransferFunction, Equation or StateSpace, optional
        Structure fitted by method names and expected of functions; default: the system's own.
    replicates : int, default 200
        Records a cell.
    seed : int, default 0
        Together with the address of a replicate it fixes every random number; an rng given to a function
        of yours is a NumPy Generator with that address.
    intersample : {"auto", "smooth", "zoh", "foh"} or a sequence of them, optional
        What the input does between its samples; default: as in `simulate`.
    **options
        Options of `fit` for the method names: band, harmonics, trend, rule, extended, tol, maxiter,
        cov_type, robust, stable, reference. With neither band nor harmonics the band is chosen for each
        system and input on the noise-free response and used for every replicate. With `generate` it is the
        band of the first record of each cell, or, where the inputs or times of the second differ, the median
        (of each edge) of the bands of the first 20. Robust fits choose their own. A reference is an input, or
        a channel that the records of `generate` keep.

    Raises
    ------
    SpecError, DataError
        At once, for anything that could not be run.

    Warns
    -----
    ModfunWarning
        Where a level of nsr is above 2, as numbers in per cent or decibel are.

    See Also
    --------
    modfun.Results : What `run` returns.
    modfun.simulate : One record.
    modfun.Estimator : A structure with its options.

    Notes
    -----
    What a function of yours raises, and what it returns that is not finite, is counted as a failure of that
    replicate, its text kept in `Results.messages`. An estimator or a metric that fails in each of the first
    hundred replicates of every cell stops the study with a SpecError. What is wrong in kind (no Record,
    another shape, a name that is missing) ends the run with a SpecError. A function for other processes or
    for a directory must be importable, and a change of its source makes another study of it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.3; T. P. Morris, I. R. White, M. J.
    Crowther, Using simulation studies to evaluate statistical methods, Stat. Med. 38, 2019 (Monte Carlo
    standard errors).

    Examples
    --------
    >>> import modfun as mf
    >>> study = mf.MonteCarlo(
    ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256,
    ...     nsr=[0.0, 0.2], estimators=["ls", "ml"], harmonics=6, trend=None, replicates=100, seed=1)
    >>> study.run().bias.shape  # (nsr, estimator, parameter)
    (2, 2, 3)
    """

    def __init__(
        self,
        *,
        system: Any = None,
        input: Any = None,
        duration: float | None = None,
        intervals: int | None = None,
        nsr: float | Sequence[float] | None = None,
        noise: Any = None,
        process_noise: Any = None,
        initial_state: Any = None,
        generate: Callable[..., Record] | None = None,
        grid: Mapping[str, Sequence[Any]] | None = None,
        truth: Mapping[str, float] | Callable[..., Mapping[str, float]] | None = None,
        estimators: Any,
        metrics: Mapping[str, Callable[..., float]] | None = None,
        model: TransferFunction | None = None,
        replicates: int = 200,
        seed: int = 0,
        intersample: str | Sequence[str] | None = None,
        **options: Any,
    ) -> None:
        if options:
            called = tuple(name for name in inspect.signature(MonteCarlo).parameters if name != "options")
            _refuse_late(options, called)
            Options.checked("MonteCarlo", called, **options)
        if "method" in options:
            raise SpecError("MonteCarlo: method= is given by estimators=, as estimators=['ls', 'ml']")
        self.replicates = whole("MonteCarlo", "replicates", replicates, 1, MOST)
        seed = whole("MonteCarlo", "seed", seed, 0, 2**64 - 1)
        simulated = {
            "system": system, "input": input, "duration": duration, "intervals": intervals, "nsr": nsr,
            "noise": noise, "process_noise": process_noise, "initial_state": initial_state,
            "intersample": intersample,
        }  # fmt: skip
        own = {"grid": grid, "truth": truth}
        axes: tuple[Axis, ...]
        found: tuple[Group | Generated, ...]
        if generate is not None:
            _refuse(simulated, "generate= makes the records, so that {} cannot be given beside it")
            axes = (*grid_axes(grid), Axis("", (0.0,), False))  # no level that anyone could name
            found, firsts = cells(axes[:-1], generate, truth, seed)
        else:
            _refuse(own, "{} belongs to generate=, a function that makes the records")
            axes, found = _simulated(**simulated)
            found = tuple(g.heard(seed) for g in found)
            firsts = [g.record(g.y) for g in found if isinstance(g, Group)]
            if (doubt := doubtful_nsr("MonteCarlo", max(axes[-1].labels))) is not None:
                warnings.warn(doubt, ModfunWarning, stacklevel=3)
        made = contenders(estimators, options, model, found, firsts, seed)
        _known_names(truth, made)
        self.plan = Plan(axes=axes, groups=found, contenders=made, metrics=_metrics(metrics), seed=seed)

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators."""
        return tuple(c.name for c in self.plan.contenders)

    def __repr__(self) -> str:
        sizes = " x ".join(f"{len(a.labels)} {a.name}" for a in self.plan.axes if a.given) or "1 cell"
        return (
            f"MonteCarlo({sizes}, estimators {', '.join(self.estimators)}, {self.replicates} replicates, "
            f"seed {self.plan.seed})"
        )

    @overload
    def run(self, *, shard: None = None, **options: Unpack[RunOptions]) -> Results: ...

    @overload
    def run(self, *, shard: tuple[int, int] | None, **options: Unpack[RunOptions]) -> Results | None: ...

    def run(
        self,
        *,
        replicates: int | None = None,
        until: Mapping[str, float] | None = None,
        threads: int | None = None,
        executor: Any = None,
        directory: str | Path | None = None,
        shard: tuple[int, int] | None = None,
        progress: str | bool = "auto",
        keep: str = "summary",
        draw: str = "auto",
        coverage: bool = True,
    ) -> Results | None:
        """Run all replicates.

        They are computed in parts of a fixed size and summed up in the order of the parts: any number of
        threads, any executor, shards and a study that was killed and goes on give the same numbers.

        Parameters
        ----------
        replicates : int, optional
            Records a cell; default: the study's own number. With `until` the most, by default a billion.
        until : dict of str to float, optional
            ``{"bias": 0.001}`` goes on until the Monte Carlo standard error of this figure ("bias", "sd",
            "rmse", "median", "coverage") is at most that in every cell, for every estimator and parameter
            whose truth is known; where none is, "sd" of every parameter. Limits are in the units of the
            parameter, not in per cent as tables print them; of "coverage" a fraction. They are looked at
            after each part, so that any engine stops at the same.
        threads : int, optional
            Default: MODFUN_NUM_THREADS, else the cores this process may use. Functions of yours run in the
            calling thread.
        executor : executor or callable, optional
            What computes parts instead of threads here, one thread each: an executor with `submit`, as of
            concurrent.futures, dask or mpi4py, or a function as ``map``. Functions of yours must be
            importable there.
        directory : str or Path, optional
            Where parts are kept as they are made. Run again, a killed study goes on where it stopped, and
            one with more replicates adds to those there; with fewer, it returns all that is there and warns.
        shard : (int, int), optional
            (k, n): only parts k, k + n, k + 2n, … of the directory, for one of n processes.
        progress : {"auto", True, False}
            On standard error; "auto": from two seconds on.
        keep : {"summary", "samples"}
            "samples" keeps every estimate in `Results.samples`: in memory, or with `directory` in the file
            samples.npy, (replicate, group, nsr, estimator, parameter), which is mapped; groups are systems,
            inputs and initial states in C order, or cells of `grid`.
        draw : {"auto", "coefficients", "samples"}
            Estimators see a record only through a few Fourier coefficients. "coefficients" draws their noise
            with the exact covariance that the quadrature rule gives it, and `Results.replicate` completes
            the record; "samples" draws a number for each sample: the same distribution, other random
            numbers. "auto" takes coefficients where that is less work, no function of yours needs a record,
            and all estimators use one rule and one window; in a directory, what was drawn there.
        coverage : bool
            Whether to count how often the 95 % intervals contain the true value.

        Returns
        -------
        Results, or None
            None for a shard while parts of others are missing.

        Raises
        ------
        SpecError
            Options that do not go together; a directory of another study; a function that another process
            could not import.
        ModfunError
            A worker that died, a file that cannot be written: what is in the directory is kept.
        """
        from .run import run  # what runs a study is not needed to import modfun
        from .work import Work

        for name, value, words in (
            ("keep", keep, ("summary", "samples")), ("draw", draw, ("auto", "coefficients", "samples")),
        ):  # fmt: skip
            if value not in words:
                raise SpecError(f"run: {name}={value!r} is unknown; {nearest(value, words)}")
        if not isinstance(coverage, bool | np.bool_):
            raise SpecError(f"run: coverage={coverage!r} must be True or False")
        users = dict.fromkeys(what for what, _ in self.plan.functions)
        if draw == "coefficients" and (users or self.plan.made):
            needing = ", ".join(users) or "estimators that are fitted in Python"
            raise SpecError(
                f"run: draw='coefficients' makes no samples, which {needing} would need; use "
                "draw='samples', or a study of its own for the methods"
            )
        most = MOST if until is not None else self.replicates
        if replicates is not None:
            most = whole("run", "replicates", replicates, 1, MOST)
        work = Work(self.plan, draw, bool(coverage), keep == "samples")
        found = run(
            work, most, until, threads=threads_of(threads), executor=executor, directory=directory,
            shard=shard, progress=progress,
        )  # fmt: skip
        if replicates is not None and found is not None and found.replicates > most:
            warnings.warn(
                f"run: replicates={most}, but directory={str(directory)!r} holds {found.replicates} of this "
                "study, which are all in the results; another directory, or none, gives fewer",
                ModfunWarning,
                stacklevel=3,
            )
        return found


def _refuse_late(options: Mapping[str, Any], own: tuple[str, ...]) -> None:
    """Refuse what `run` takes, also where it is misspelt."""
    late = RunOptions.__annotations__.keys() - set(own)
    known = [*own, *Options.__dataclass_fields__, *late]
    meant = {name: found[0] for name in options if (found := close(name, known)) and found[0] in late}
    if meant:
        first = min(meant)
        raise SpecError(
            f"MonteCarlo: {', '.join(sorted(meant))} is no part of a study but of its run: "
            f"study.run({meant[first]}={options[first]!r})"
        )


def _refuse(given: Mapping[str, Any], text: str) -> None:
    named = [f"{name}=" for name, value in given.items() if value is not None]
    if named:
        raise SpecError(f"MonteCarlo: {text.format(', '.join(named))}")


def _simulated(
    system: Any, input: Any, duration: Any, intervals: Any, nsr: Any, noise: Any,
    process_noise: Any, initial_state: Any, intersample: Any,
) -> tuple[tuple[Axis, ...], tuple[Group, ...]]:  # fmt: skip
    """Axes and groups of a study of systems."""
    needed = {"system": system, "input": input, "duration": duration, "intervals": intervals}
    if all(isinstance(one, Signals) for one in (input.values() if isinstance(input, Mapping) else [input])):
        del needed["duration"], needed["intervals"]  # each has its own
    if not _driven(system):
        del needed["input"]
    missing = [f"{name}=" for name, value in needed.items() if value is None]
    if missing:
        raise SpecError(
            f"MonteCarlo: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing; give it, or "
            "generate=, a function that makes the records"
        )
    for name, value in (("duration", duration), ("intervals", intervals)):
        if np.ndim(value):
            raise SpecError(
                f"MonteCarlo: {name}={value!r} must be one number; a study varies system, input, "
                f"initial_state, noise and nsr: make one for each {name}, or vary anything with "
                "generate=, a function that makes the records, and grid="
            )
    (systems, of_system), (inputs, of_input), (states, of_state) = (
        axis("system", system), axis("input", input),
        axis("initial_state", "zero" if initial_state is None else initial_state),
    )  # fmt: skip
    noises, of_noise = axis("noise", "white" if noise is None else noise)
    nsrs = levels(0.0 if nsr is None else nsr)
    of_system = tuple(linear(one, "MonteCarlo") for one in of_system)
    found = groups(
        of_system, of_input, of_state, nsrs, [_noise(one) for one in of_noise],
        0.0 if process_noise is None else process_noise,
        duration=duration, intervals=intervals, intersample=intersample,
    )  # fmt: skip
    return (systems, inputs, states, noises, nsrs), found


def _noise(given: Any) -> Callable[..., Any] | None:
    """A function of the user, or None where noise is white."""
    if isinstance(given, str) and given == "white":
        return None
    if not callable(given):
        raise SpecError(
            f"MonteCarlo: noise={given!r} is not available; use 'white', a function of (rng, y, dt) that "
            "returns noise of unit standard deviation for each sample of y, or a dict of name to these"
        )
    return cast("Callable[..., Any]", given)


def _driven(system: Any) -> bool:
    """Whether a system has inputs (True for what is not a system)."""
    each = list(system.values()) if isinstance(system, Mapping) else [system]
    return any(not isinstance(one, LTI | NonlinearModel) or one.shape[1] > 0 for one in each)


def _known_names(truth: Any, made: Sequence[Contender]) -> None:
    """Refuse true parameters that no estimator has."""
    if not isinstance(truth, Mapping):
        return
    names = list(dict.fromkeys(name for c in made for own in c.params for name in own))
    for name in truth:
        if name not in names:
            raise SpecError(
                f"MonteCarlo: truth names {name!r}, which no estimator finds; {nearest(name, names)}"
            )


def _metrics(given: Any) -> tuple[tuple[str, Callable[..., Any]], ...]:
    if given is None:
        return ()
    if not isinstance(given, Mapping) or not all(isinstance(name, str) and name.strip() for name in given):
        raise SpecError(
            f"MonteCarlo: metrics={given!r}; give a dict from names to functions of (fit, record) that "
            "return a number"
        )
    for name, call in given.items():
        if not callable(call):
            raise SpecError(
                f"MonteCarlo: the metric {name!r} is a {type(call).__name__}; give a function of (fit, "
                "record) that returns a number"
            )
    return tuple(given.items())
