"""A run of a study from its first part to its results: engine, directory, shard, stopping rule."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from itertools import islice
from math import ceil, prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import shown
from ..base.arrays import F64
from ..base.callables import importable
from ..base.progress import Progress
from ..base.writing import memory
from ..errors import ModfunWarning, SpecError
from .directory import Directory, drawn_there
from .engine import engine, tallies
from .generated import Generated
from .groups import Group
from .plan import Plan
from .results import Results
from .tally import STATUS, USED, Tally
from .work import Work, cheapest, parts

__all__ = ["collected", "far_from", "run", "summed"]

SAID = 300  # letters of an exception that an error repeats
HOPELESS = 100  # replicates after which an estimator that always raised stops a study
FIGURES = ("bias", "sd", "rmse", "median", "coverage")


def run(
    work: Work,
    most: int,
    until: Mapping[str, float] | None,
    *,
    threads: int,
    executor: Any,
    directory: str | Path | None,
    shard: tuple[int, int] | None,
    progress: str | bool,
) -> Results | None:
    """Run a study; see `MonteCarlo.run`."""
    _check(work, until, executor, directory, shard)
    if work.draw == "auto":
        draw = None if directory is None else drawn_there(directory)
        work = replace(work, draw=draw or cheapest(work.plan))
    size = work.part
    store: Directory | None = None
    least = 0
    if directory is not None:
        store = Directory.open(directory, work)
        least = store.replicates
        if until is None:
            store.want(most)
            most = store.replicates
        limits = None if until is None else {name: float(limit) for name, limit in until.items()}
        store.note(replicates=most, until=limits, shard=None if shard is None else [int(v) for v in shard])
    samples = _room(work, most) if work.samples and store is None else None
    wanted = most if until is None else min(size, most)  # as far as is known
    with Progress(progress, ", ".join(c.name for c in work.plan.contenders), unit="replicates") as bar:
        workers = engine(work, executor, threads, lambda done: bar(int(done), wanted))
        if shard is not None:
            assert store is not None
            own = islice(parts(size, most), *_slice(shard))
            with closing(tallies(own, workers, store)) as found:
                for part, _ in found:
                    bar(part.first + part.replicates, most)
            missing = len(store.missing())
            if missing:
                bar.say(f"shard {shard[0]} of {shard[1]} is done; {missing} parts of others are missing")
                return None
            kept = store.sampled(work.plan, check=False) if work.samples else None
            return collected(store, work.plan, work.draw, kept)
        total: Tally | None = None
        done = 0
        with closing(tallies(parts(size, most), workers, store)) as found:
            for part, tally in found:
                if samples is not None:
                    samples[part.first : part.first + part.replicates] = tally.samples
                total = tally if total is None else total.merge(tally)
                done = part.first + part.replicates
                _refuse_failing(work.plan, total, done)
                if until is not None:
                    if store is not None:
                        store.want(done)
                    far = far_from(total, work.plan, until)
                    if done >= least and far <= 1:
                        break
                    wanted = ceil(min(most, max(done + size, least, done * far * far)))
                bar(done, wanted)
    assert total is not None
    if until is not None and far_from(total, work.plan, until) > 1:
        warnings.warn(
            f"run: until={dict(until)} is not reached after {done} replicates; allow more with replicates=",
            ModfunWarning,
            stacklevel=4,
        )
    if store is not None:
        samples = store.sampled(work.plan, check=False) if work.samples else None
    return _results(work.plan, work.draw, total, done, samples)


def collected(store: Directory, plan: Plan, draw: str, samples: F64 | None) -> Results:
    """Results of a directory whose parts are all there."""
    return _results(plan, draw, summed(store), store.replicates, samples)


def summed(store: Directory) -> Tally:
    """Sums over all parts of a directory, which are all there."""
    total: Tally | None = None
    for _, tally in tallies(store.parts, None, store):
        total = tally if total is None else total.merge(tally)
    if total is None:
        raise SpecError(f"{str(store.path)!r} holds no replicates yet; run the study with this directory=")
    return total


def _results(plan: Plan, draw: str, total: Tally, replicates: int, samples: F64 | None) -> Results:
    found = Results.collect(plan, total, replicates, draw, samples)
    ran = total.status.sum(axis=-1)
    for k, c in enumerate(plan.contenders):
        texts = [one["text"] for one in total.raised if one["estimator"] == k]
        if texts and not np.any(ran[:, :, k] - total.status[:, :, k, USED:].sum(axis=-1)):
            warnings.warn(
                f"run: {c.name} failed in every replicate; the first said: {texts[0]}",
                ModfunWarning,
                stacklevel=5,
            )
    for name, text in _failing_metrics(plan, total):
        warnings.warn(
            f"run: metric {name!r} failed for every estimate; the first said: {text}",
            ModfunWarning,
            stacklevel=5,
        )
    if _identical(plan, total):
        warnings.warn(
            "run: every replicate gave the same estimates, so that sd and all Monte Carlo errors are 0 and "
            "say nothing; draw what is to differ between them from the rng that your functions are given",
            ModfunWarning,
            stacklevel=5,
        )
    return found


def _refuse_failing(plan: Plan, total: Tally, done: int) -> None:
    """Stop where an estimator or a metric has failed in each of a hundred first replicates, in every cell."""
    if done < HOPELESS:
        return
    for name, text in _failing_metrics(plan, total):
        raise SpecError(
            f"run: metric {name!r} failed for every estimate of the first {done} replicates, and the study "
            f"was stopped; the first said: {text}; mend that first, or leave the metric out"
        )
    ran, raised = total.status.sum(axis=-1), total.status[..., STATUS.index("raised")]
    for k, c in enumerate(plan.contenders):
        if np.all(ran[:, :, k] == raised[:, :, k]):
            text = _first(one["text"] for one in total.raised if one["estimator"] == k)
            raise SpecError(
                f"run: {c.name} failed in each of the first {done} replicates, and the study was stopped; "
                f"the first said: {text}; mend that first: replicates=1 shows it"
            )


def _failing_metrics(plan: Plan, total: Tally) -> Iterator[tuple[str, str]]:
    """Metrics without a value of any estimate, and what the first of them said."""
    if not total.status[..., :USED].any():
        return
    for k, (name, _) in enumerate(plan.metrics, len(plan.parameters)):
        if not total.moments[..., k, 0].any():
            own = f"metric {name!r}: "
            texts = (one["text"] for one in total.raised if one["text"].startswith(own))
            yield name, _first(texts).removeprefix(own)


def _first(texts: Iterable[str]) -> str:
    """The first text, cut where it is long."""
    text = next(iter(texts), "")
    return text if len(text) <= SAID else f"{text[:SAID]}…"


def _identical(plan: Plan, total: Tally) -> bool:
    """Whether estimates of records made by functions of the user never differ, in any cell with noise."""
    if not any(isinstance(g, Generated) or g.functions for g in plan.groups):
        return False
    noisy = np.array(
        [np.full(total.status.shape[1], True) if _varies(g) else plan.sigma(g) > 0 for g in plan.groups]
    )
    moments = total.moments[noisy][..., : len(plan.parameters), :]
    many = moments[..., 0] > 1
    return bool(many.any() and not moments[many][:, 2].any())


def _varies(group: Group | Generated) -> bool:
    """Whether the user, or a random state, makes replicates differ where there is no noise."""
    return isinstance(group, Generated) or group.state is not None or group.drawn or len(group.free) > 0


def far_from(total: Tally, plan: Plan, until: Mapping[str, float]) -> float:
    """How many times its limit the largest error is, of all figures asked for; it falls as 1/√replicates."""
    found = total.figures(plan.truth)
    known = ~np.isnan(plan.truth)
    everything = np.broadcast_to(np.arange(known.shape[-1]) < len(plan.parameters), known.shape)
    far = 0.0
    for name, limit in until.items():
        seen = everything if name == "sd" and not known.any() else known  # which needs no truth
        errors = found[f"{name}_mcse"][seen]
        errors = errors[~np.isnan(errors)]
        if not errors.size:
            raise SpecError(f"run: until={dict(until)!r}: {_unseen(total, known, name)}")
        far = max(far, float(errors.max()) / limit)
    return far


def _unseen(total: Tally, known: NDArray[np.bool_], name: str) -> str:
    """Why a figure has no error that could be seen."""
    counts = total.status.sum(axis=(0, 1, 2))
    if not counts[:USED].any():
        ends = ", ".join(f"{n} {word}" for word, n in zip(STATUS, counts.tolist(), strict=True) if n)
        first = f", the first with {total.raised[0]['text']}" if total.raised else ""
        return f"every replicate failed ({ends}){first}; mend that first: replicates=1 shows it"
    if name != "sd" and not known.any():
        return f"without a true parameter {name} has no error that could be seen; give truth=, or use sd"
    return f"this study has no {name} whose error could be seen"


def _check(work: Work, until: Mapping[str, float] | None, executor: Any, directory: Any, shard: Any) -> None:
    """Refuse what does not go together, before anything runs."""
    if until is not None:
        sound = isinstance(until, Mapping) and until and all(name in FIGURES for name in until)
        if not sound or not all(isinstance(v, int | float) and v > 0 for v in until.values()):
            raise SpecError(
                f"run: until={until!r}; give the largest Monte Carlo standard error of one or more figures "
                f"({', '.join(FIGURES)}), as {{'bias': 0.001}}"
            )
        if shard is not None:
            raise SpecError("run: until= needs all parts in one run, shard= does a share; give replicates=")
        if work.samples and directory is None:
            raise SpecError(
                "run: until= does not know how many samples to keep in memory; give directory=, or "
                "replicates= without until="
            )
    if shard is not None:
        if directory is None:
            raise SpecError("run: shard= leaves its parts in a directory for the others; give directory=")
        _slice(shard)
    if directory is not None:
        _place(directory)
    for what, call in work.plan.functions:
        if executor is not None and not _here(executor):
            importable(call, what, "the processes of executor=")
        if directory is not None:
            importable(call, what, "a reader of directory=")


def _slice(shard: Any) -> tuple[int, None, int]:
    """The parts of a shard (k, n), as arguments of islice."""
    try:
        k, n = shard
    except (TypeError, ValueError):
        k = n = None
    whole = all(isinstance(v, int | np.integer) and not isinstance(v, bool) for v in (k, n))
    if not (whole and 0 <= k < n):
        raise SpecError(f"run: shard={shard!r} must be (k, n), whole numbers with 0 <= k < n, as (3, 64)")
    return int(k), None, int(n)


def _place(directory: Any) -> None:
    """Refuse what no directory can be called."""
    try:
        os.stat(Path(directory))
    except FileNotFoundError:
        pass
    except (TypeError, ValueError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise SpecError(
            f"run: directory={shown(directory)} cannot name a directory ({why}); give a path as a text or a "
            "Path, as 'runs/a'"
        ) from error


def _here(executor: Any) -> bool:
    """Whether it runs in this process."""
    if executor is map:
        return True
    from concurrent.futures import ThreadPoolExecutor

    return isinstance(executor, ThreadPoolExecutor)


def _room(work: Work, replicates: int) -> F64:
    """Memory for all estimates, refused where it cannot be had."""
    size = 8 * replicates * prod(work.plan.shape)
    free = memory()
    if free is not None and size > free:
        raise SpecError(
            f"run: keep='samples' of {replicates} replicates needs {size / 2**30:.1f} GiB and "
            f"{free / 2**30:.1f} GiB of memory are free; give directory=, which keeps them in a file, or "
            "fewer replicates"
        )
    try:
        return np.full((replicates, *work.plan.shape), np.nan)
    except (MemoryError, ValueError) as error:  # a limit of the process, or more than can be addressed
        raise SpecError(
            f"run: keep='samples' of {replicates} replicates needs {size / 2**30:.1f} GiB, which this "
            "process cannot have; give directory=, which keeps them in a file, or fewer replicates"
        ) from error
