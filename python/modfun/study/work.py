"""One task of a study: what every process needs for any part of it, and how a part is computed."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from .._core import STREAM_VERSION, Study
from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.callables import source
from ..records.corners import without_corners
from .called import LEVEL, called
from .contenders import Contender
from .generated import Generated
from .groups import Group
from .plan import Plan
from .tally import STATUS, Tally

__all__ = ["Part", "Work", "cheapest", "compute", "noise", "parts"]

Progress = Callable[[int, int], None]

CHUNK = 512  # replicates the core gives to a thread at once
PART = 2e9  # ns of one thread that a part should take
CALLED = 64  # replicates of a part where functions of the user run: nobody knows how slow they are
LARGEST = 2**27  # bytes of estimates that a part may have


class Part(NamedTuple):
    """Replicates `first` to `first + replicates` of all groups."""

    number: int
    first: int
    replicates: int


def parts(size: int, replicates: int) -> Iterator[Part]:
    """The parts of so many replicates, the last one shorter where they do not divide."""
    for number in count():
        first = number * size
        if first >= replicates:
            return
        yield Part(number, first, min(size, replicates - first))


@dataclass(frozen=True, eq=False)
class Work:
    """A study as it is run: picklable, and equal where all numbers are.

    Attributes
    ----------
    plan : Plan
    draw : {"samples", "coefficients", "auto"}
        "auto" only until `run` has chosen.
    coverage : bool
    samples : bool
        Whether every estimate is kept; changes no number.
    """

    plan: Plan
    draw: str
    coverage: bool
    samples: bool

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Work) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def called(self) -> bool:
        """Whether records are made in Python: for functions of the user, or levels told by each record."""
        return bool(self.plan.functions) or self.plan.made

    @cached_property
    def part(self) -> int:
        """Replicates of a part: about two seconds of one thread, by sizes alone so that all agree on it."""
        if self.called:
            return CALLED
        one = sum(_nanoseconds(self, g) for g in self.plan.groups)
        most = min(PART / one, LARGEST / (8 * np.prod(self.plan.shape)))
        return CHUNK << int(np.log2(max(most / CHUNK, 1.0)))

    @cached_property
    def key(self) -> str:
        """Hash of all that changes numbers, and of nothing else."""
        digest = hashlib.sha256()

        def add(value: Any) -> None:
            if isinstance(value, np.ndarray):
                value = np.ascontiguousarray(value)
                digest.update(f"{value.dtype.str}{value.shape}".encode())
                digest.update(value.tobytes())
            else:
                digest.update(json.dumps(value).encode())
            digest.update(b"\n")

        plan = self.plan
        add(["modfun study", STREAM_VERSION, plan.seed, self.part, self.draw, self.coverage, LEVEL])
        for g in plan.groups:
            for value in (*g.described(), plan.sigma(g)):
                add(value)
            for c in plan.contenders:
                add([c.names(g), c.described(g), self._cov_type(c) if c.call is None else None])
                add(c.truth[g.index])
        add([source(call) for _, call in plan.metrics])
        return digest.hexdigest()

    def core(self, groups: Sequence[Group | Generated], chosen: Sequence[int]) -> Study:
        """Some groups and estimators laid out in the compiled core."""
        plan = self.plan
        given = [
            {
                "group": g.index,
                "dt": g.rest.dt,
                "y": g.y,
                "u": without_corners(g.rest.u, g.rest.kinds),
                "free": g.free,
                "scale": g.unit.tolist(),
                "sigma": plan.sigma(g),
                "estimators": [
                    {
                        "options": plan.contenders[k].core(g),
                        "truth": np.nan_to_num(plan.contenders[k].truth[g.index]),  # 0 where unknown
                        "cov_type": self._cov_type(plan.contenders[k]),
                        "position": k,
                        "columns": plan.columns(plan.contenders[k], g),
                    }
                    for k in chosen
                ],
            }
            for g in groups
            if isinstance(g, Group)
        ]
        return Study(given, plan.shape[2:], draw=self.draw, level=LEVEL)

    def _cov_type(self, contender: Contender) -> str | None:
        return contender.estimators[0].options.cov_type if self.coverage else None


def cheapest(plan: Plan) -> str:
    """How noise is drawn with the least work: as coefficients, unless a function needs samples."""
    work = Work(plan, "samples", True, False)
    return (
        "samples"
        if work.called or not work.core(plan.groups, _compiled_ones(plan)).coefficients_pay
        else "coefficients"
    )


def noise(plan: Plan, group: Group, replicate: int) -> F64:
    """Unit noise of a replicate, (output, time), whose coefficients are those that the core draws."""
    work = Work(plan, "coefficients", False, False)
    return work.core([group], _compiled_ones(plan)).noise(0, plan.seed, replicate)


def _compiled_ones(plan: Plan) -> list[int]:
    """Estimators that run in the core."""
    return [k for k, c in enumerate(plan.contenders) if c.call is None]


def compute(work: Work, part: Part, threads: int = 1, progress: Progress | None = None) -> Tally:
    """Sums over a part; the same bits for any number of threads, in any process."""
    tallies = []
    plan, (_, first, replicates) = work.plan, part
    if not plan.made and any(c.call is None for c in plan.contenders):
        tallies.append(_compiled(work, part, threads, progress))
    if work.called:
        tallies.append(called(plan, first, replicates, work.coverage, work.samples, progress))
    return reduce(Tally.beside, tallies)


def _compiled(work: Work, part: Part, threads: int, progress: Progress | None) -> Tally:
    """The estimators of the compiled core, all on the same noise."""
    shape = work.plan.shape
    study, shares = _laid_out(work)
    start = time.perf_counter()
    found = study.part(
        seed=work.plan.seed, first=part.first, replicates=part.replicates, samples=work.samples,
        threads=threads, progress=progress,
    )  # fmt: skip
    spent = time.perf_counter() - start
    moments = found["moments"].reshape(*shape, 5)
    status = np.zeros((*shape[:3], len(STATUS)), np.int64)
    status[..., :-1] = found["status"].reshape(*shape[:3], -1)
    return Tally(
        moments=moments,
        intervals=moments[..., 0].astype(np.int64) * work.coverage,
        covered=found["covered"].reshape(shape),
        status=status,
        fits=status.sum(axis=-1),
        iterations=found["iterations"].reshape(shape[:3]),
        bins=found["bins"],
        counts=found["counts"],
        seconds=spent * shares,
        samples=found["samples"].reshape(-1, *shape) if work.samples else None,
    )


@lru_cache(maxsize=2)
def _laid_out(work: Work) -> tuple[Study, F64]:
    """The study in the core, kept by the process, and the share of each estimator in its time.

    Estimators share their noise and its sums; a short run of each alone tells who costs what.
    """
    plan = work.plan
    chosen = _compiled_ones(plan)
    shares = np.zeros(len(plan.contenders))
    for k in chosen:
        alone = work.core(plan.groups[:1], [k]) if len(chosen) > 1 else None
        shares[k] = 1.0 if alone is None else min(_timed(alone, plan.seed) for _ in range(2))
    return work.core(plan.groups, chosen), shares / shares.sum()


def _timed(study: Study, seed: int) -> float:
    start = time.perf_counter()
    study.part(seed=seed, first=0, replicates=CHUNK, samples=False, threads=1)
    return time.perf_counter() - start


def _nanoseconds(work: Work, group: Group | Generated) -> float:
    """Roughly what one replicate of a group takes on one thread."""
    assert isinstance(group, Group)
    samples = group.y.shape[1]
    duration = samples * group.rest.dt
    fits, widest = 0.0, 0.0
    for c in work.plan.contenders:
        options = c.estimators[group.index].options
        top = (options.harmonics or 0) + max(c.layout(group).orders)
        lines = top if options.band is None else options.band[1] * duration / (2 * np.pi)
        plain = c.layout(group).plain and options.plain_noise
        passes = {"ls": 1, "wls": 1, "awls": 5, "ml": 7}[options.method] + 2 * work.coverage
        # Rows of a joint problem cost more than products that are summed, and alternate with the noise.
        passes *= 1 if plain else 10 * len(group.y)
        fits += 100.0 + passes * lines * (2 + 0.5 * len(c.truth[group.index]) ** 2)
        widest = max(widest, lines)
    made = len(group.y) * (2.0 * samples + 0.1 * samples * widest)
    return float(made + len(work.plan.axes[-1].labels) * fits)
