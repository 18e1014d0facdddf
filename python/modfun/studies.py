"""Monte Carlo studies: estimators on simulated records over a grid of systems, inputs and noise levels."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import ModfunWarning, SpecError
from .estimation import _threads
from .options import Options
from .progress import Progress
from .results import Fit
from .structures import TransferFunction
from .study_plan import Contender, Group, axis, contenders, groups, levels
from .study_results import Results
from .study_summary import STATUS, Summary, from_core, from_samples

__all__ = ["MonteCarlo", "Results"]

F64 = NDArray[np.float64]
LEVEL = 0.95
TIMED = 512  # replicates that tell how the common time of estimators splits between them

# Words of later versions; anything else unknown gets the nearest names.
_LATER = {
    "generate": "generators of records",
    "truth": "generators of records",
    "grid": "generators of records",
    "metrics": "metrics of your own",
}


class MonteCarlo:
    """A study of estimators on simulated records.

    Inputs, noise-free responses (exact between the samples) and default bands are worked out here, once;
    `run` adds noise and estimates. Noise is white, its streams addressed by seed, replicate and (system,
    input, initial state): all noise levels and estimators see the same numbers, so that they compare
    without the noise of the comparison.

    Parameters
    ----------
    system : LTI or dict of name to LTI
        One output. A dict is an axis of the study with names, here and below.
    input : str, array_like, callable, list of these, or dict of name to any of these
        One signal an input of the system: text such as ``"sin(t**2/5)"``, intervals + 1 samples, or a
        function of t.
    duration : float
        Length T of a record, s.
    intervals : int
        Number of sampling intervals N; a record has N + 1 samples.
    nsr : float or list of float, default 0
        Standard deviation of the noise over the root mean square of the noise-free response from rest.
    noise : {"white"}
        What the noise is.
    initial_state : {"zero", "random"}, array_like, or dict of name to these
        "random": normal in each replicate, each state with the root mean square it has in the response
        from rest. An array: the states, of a transfer function y, y', … of the free response.
    estimators : list of str, or dict of name to str, Estimator or callable
        Methods of `fit` ("ls", "wls", "awls", "ml"); or by name methods, Estimators, rivals, or functions
        ``mine(record, rng)`` that return a dict of parameters, an array of them in the order of
        `TransferFunction.param_names`, or a Fit. What a function raises is a counted failure.
    model : TransferFunction, optional
        Structure fitted by method names and expected of functions; default: the system's own.
    replicates : int, default 200
        Records a cell.
    seed : int, default 0
        Together with the address of a replicate it fixes every random number.
    intersample : {"smooth", "zoh", "foh"} or a sequence of them
        What the input does between its samples.
    **options
        Options of `fit` for the method names: band, harmonics, trend, rule, extended, tol, maxiter,
        cov_type. With neither band nor harmonics the band is chosen for each system and input on the
        noise-free response and used for every replicate.

    Raises
    ------
    SpecError, DataError
        At once, for anything that could not be run.

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
        system: Any,
        input: Any,
        duration: float,
        intervals: int,
        nsr: float | Sequence[float] = 0.0,
        noise: str = "white",
        initial_state: Any = "zero",
        estimators: Any,
        model: TransferFunction | None = None,
        replicates: int = 200,
        seed: int = 0,
        intersample: str | Sequence[str] = "smooth",
        **options: Any,
    ) -> None:
        for name, what in _LATER.items():
            if name in options:
                raise SpecError(f"MonteCarlo: {name}= is not available yet; {what} come in a later version")
        if not (isinstance(noise, str) and noise == "white"):
            raise SpecError(
                f"MonteCarlo: noise={noise!r} is not available yet: other noise comes in a later version; "
                "use 'white'"
            )
        if options:
            Options.checked("MonteCarlo", **options)
        if "method" in options:
            raise SpecError("MonteCarlo: method= is given by estimators=, as estimators=['ls', 'ml']")
        self.replicates = _whole("replicates", replicates, 1, 10**9)
        self.seed = _whole("seed", seed, 0, 2**64 - 1)
        self.axes = (
            axis("system", system), axis("input", input), axis("initial_state", initial_state), levels(nsr),
        )  # fmt: skip
        self.groups = groups(
            *self.axes, duration=duration, intervals=intervals, intersample=intersample
        )  # fmt: skip
        self.contenders = contenders(estimators, options, model, self.groups)

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators."""
        return tuple(c.name for c in self.contenders)

    def sigma(self, group: Group) -> F64:
        """Noise standard deviation at each level of a group."""
        return np.array(self.axes[3].values) * float(group.rest.rms[0])

    def __repr__(self) -> str:
        sizes = " x ".join(f"{len(a.values)} {a.name}" for a in self.axes if a.given) or "1 cell"
        return (
            f"MonteCarlo({sizes}, estimators {', '.join(self.estimators)}, {self.replicates} replicates, "
            f"seed {self.seed})"
        )

    def run(
        self,
        *,
        threads: int | None = None,
        progress: str | bool = "auto",
        keep: str = "summary",
        draw: str = "samples",
        coverage: bool = True,
    ) -> Results:
        """Run all replicates.

        Parameters
        ----------
        threads : int, optional
            Default: MODFUN_NUM_THREADS, else the cores this process may use. The numbers do not depend on
            it. Functions of yours run in the calling thread.
        progress : {"auto", True, False}
            On standard error; "auto": from two seconds on.
        keep : {"summary", "samples"}
            "samples" keeps every estimate in `Results.samples`.
        draw : {"samples", "coefficients"}
            "coefficients" draws the noise of the Fourier coefficients instead of that of the samples: the
            same distribution at less work, other random numbers. Not for functions.
        coverage : bool
            Whether to count how often the 95 % intervals hold the truth.

        Returns
        -------
        Results
        """
        for name, value, words in (
            ("keep", keep, ("summary", "samples")), ("draw", draw, ("samples", "coefficients")),
        ):  # fmt: skip
            if value not in words:
                raise SpecError(f"run: {name}={value!r} is unknown; choose {' or '.join(map(repr, words))}")
        if not isinstance(coverage, bool | np.bool_):
            raise SpecError(f"run: coverage={coverage!r} must be True or False")
        users = [c.name for c in self.contenders if c.call is not None]
        if users and draw == "coefficients":
            raise SpecError(
                f"run: draw='coefficients' makes no samples, which {', '.join(users)} would need; "
                "use draw='samples', or a study of its own for the methods"
            )
        count = _threads(threads)
        cells: dict[tuple[int, int, str], Summary] = {}
        seconds: dict[str, float] = {}
        messages: list[dict[str, Any]] = []
        kinds = {c.estimators[0].options.cov_type for c in self.contenders if c.call is None}
        for kind in sorted(kinds):
            chosen = [
                c for c in self.contenders if c.call is None and c.estimators[0].options.cov_type == kind
            ]
            self._compiled(chosen, kind if coverage else None, count, progress, keep, draw, cells, seconds)
        called = [c for c in self.contenders if c.call is not None]
        if called:
            self._called(called, coverage, progress, keep, cells, seconds, messages)
            for user in called:
                if messages and all(s.count == 0 for (_, _, name), s in cells.items() if name == user.name):
                    warnings.warn(
                        f"run: {user.name} failed in every replicate; the first said: {messages[0]['text']}",
                        ModfunWarning,
                        stacklevel=2,
                    )
        return Results.collect(self, cells, {n: seconds[n] for n in self.estimators}, messages, draw)

    def _compiled(
        self,
        chosen: list[Contender],
        cov_type: str | None,
        threads: int,
        progress: str | bool,
        keep: str,
        draw: str,
        cells: dict[tuple[int, int, str], Summary],
        seconds: dict[str, float],
    ) -> None:
        """Replicates in the compiled core, all estimators on the same noise."""

        def go(
            few: Sequence[Contender], first: Sequence[Group], replicates: int, show: Any
        ) -> tuple[Any, float]:
            start = time.perf_counter()
            found = _core.monte_carlo(
                [self._signals(g, few) for g in first],
                [[c.core(g) for c in few] for g in first],
                seed=self.seed,
                first=0,
                replicates=replicates,
                draw=draw,
                cov_type=cov_type,
                level=LEVEL,
                samples=keep == "samples",
                threads=threads,
                progress=show,
            )
            return found, time.perf_counter() - start

        names = ", ".join(c.name for c in chosen)
        with Progress(progress, names) as bar:
            found, spent = go(chosen, self.groups, self.replicates, bar if bar.on else None)
        for g, by_level in zip(self.groups, found, strict=True):
            for level, by_estimator in enumerate(by_level):
                for c, one in zip(chosen, by_estimator, strict=True):
                    cells[g.index, level, c.name] = from_core(one, c.truth[g.index])
        shares = [1.0]
        if len(chosen) > 1:  # they share their noise and its sums; a short run of each tells who costs what
            few = min(self.replicates, TIMED)
            shares = [min(go([c], self.groups[:1], few, None)[1] for _ in range(2)) for c in chosen]
        for c, share in zip(chosen, shares, strict=True):
            seconds[c.name] = spent * share / sum(shares)

    def _signals(self, group: Group, few: Sequence[Contender]) -> dict[str, Any]:
        return {
            "group": group.index,
            "dt": group.rest.dt,
            "y": group.y,
            "u": group.rest.u,
            "free": group.free,
            "sigma": self.sigma(group),
            "truth": [np.nan_to_num(c.truth[group.index]) for c in few],  # 0 where unknown
        }

    def _called(
        self,
        called: list[Contender],
        coverage: bool,
        progress: str | bool,
        keep: str,
        cells: dict[tuple[int, int, str], Summary],
        seconds: dict[str, float],
        messages: list[dict[str, Any]],
    ) -> None:
        """Replicates through functions, on the very samples that the core sees."""
        size = len(self.axes[3].values)
        total = len(self.groups) * self.replicates * size
        for c in called:
            seconds[c.name] = 0.0
        with Progress(progress, ", ".join(c.name for c in called)) as bar, warnings.catch_warnings():
            warnings.simplefilter("ignore", ModfunWarning)  # a study counts what a single fit would warn of
            for g in self.groups:
                gather = {(k, c.name): _Gather(c, g, self.replicates) for k in range(size) for c in called}
                for r in range(self.replicates):
                    for level, y in enumerate(g.outputs(self.seed, r, self.sigma(g).tolist())):
                        rec = g.record(y)
                        for c in called:
                            start = time.perf_counter()
                            text = gather[level, c.name].take(r, rec, self.generator(r, g))
                            seconds[c.name] += time.perf_counter() - start
                            if text is not None:
                                messages.append(
                                    {"group": g.index, "level": level, "estimator": c.name, "replicate": r,
                                     "text": text}
                                )  # fmt: skip
                        bar((g.index * self.replicates + r) * size + level + 1, total)
                for (level, name), one in gather.items():
                    cells[g.index, level, name] = one.summary(coverage, keep == "samples")

    def generator(self, replicate: int, group: Group) -> np.random.Generator:
        """Random numbers for functions, addressed by seed, replicate and group."""
        bits = np.random.Philox(key=[self.seed, group.index], counter=[0, 0, replicate, 0])
        return np.random.Generator(bits)


class _Gather:
    """Estimates of one function in one cell."""

    def __init__(self, contender: Contender, group: Group, replicates: int) -> None:
        self.contender = contender
        self.names = contender.names(group)
        self.truth = contender.truth[group.index]
        self.theta = np.full((replicates, len(self.names)), np.nan)
        self.bse = np.full_like(self.theta, np.nan)
        self.covered = np.full_like(self.theta, np.nan)
        self.status = np.zeros(replicates, dtype=np.uint8)
        self.nit: list[int] = []

    def take(self, replicate: int, rec: Any, rng: np.random.Generator) -> str | None:
        """Estimate from one record; the text of what was raised, if anything was."""
        assert self.contender.call is not None
        try:
            answer = self.contender.call(rec, rng)
        except Exception as error:
            self.status[replicate] = STATUS.index("raised")
            return f"{type(error).__name__}: {error}"
        theta = parameters(answer, self.names, self.contender.name)
        self.theta[replicate] = theta
        if isinstance(answer, Fit):
            self.status[replicate] = STATUS.index(answer.status)
            self.bse[replicate] = answer.bse
            self.nit.append(answer.nit)
            low, high = answer.interval(answer.params, answer.bse, LEVEL)
            self.covered[replicate] = (low <= self.truth) & (self.truth <= high)
        if not np.all(np.isfinite(theta)) and self.status[replicate] < 2:
            self.status[replicate] = STATUS.index("nonfinite")
        return None

    def summary(self, coverage: bool, keep: bool) -> Summary:
        """The figures of the cell."""
        covered = self.covered if coverage else np.full_like(self.covered, np.nan)
        nit = float(np.mean(self.nit)) if self.nit else float("nan")
        return from_samples(self.theta, self.bse, covered, self.status, self.truth, nit, keep)


def parameters(answer: Any, names: tuple[str, ...], who: str) -> F64:
    """What a function returned, in the order of the parameter names."""
    if isinstance(answer, Fit):
        answer = answer.estimates()
    if isinstance(answer, Mapping):
        missing = [name for name in names if name not in answer]
        if missing:
            raise SpecError(
                f"MonteCarlo: the estimator {who!r} returned {', '.join(map(str, answer)) or 'nothing'}; "
                f"{', '.join(missing)} of {', '.join(names)} is missing: return all, or give model="
            )
        answer = [answer[name] for name in names]
    try:
        theta = np.asarray(answer, dtype=np.float64)
    except (TypeError, ValueError):
        theta = np.empty(0)
    if theta.shape != (len(names),):
        raise SpecError(
            f"MonteCarlo: the estimator {who!r} returned {type(answer).__name__} of shape {theta.shape}; "
            f"return a dict, an array of {', '.join(names)}, or a Fit"
        )
    return theta


def _whole(name: str, value: Any, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise SpecError(f"MonteCarlo: {name}={value!r} must be a whole number from {least} to {most}")
    return int(value)
