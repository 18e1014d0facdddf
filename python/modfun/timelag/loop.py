"""A delay system simulated, open loop or with a sampled law."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import real, reals
from ..base.arrays import F64
from ..base.samples import MOST_SAMPLES
from ..errors import DataError, ModfunWarning, SpecError
from ..signals import Signals
from ..signals.sources import is_samples, sources
from ..systems.propagate import intersample_kinds
from .design import Controller, as_design, sampled_words, seconds
from .motion import History, Motion, Trajectory, drive, history
from .plant import Plant

__all__ = ["simulated"]


def simulated(
    plant: Plant,
    feedback: Any,
    duration: float,
    dt: float,
    past: Any,
    x0: ArrayLike | None,
    u: Any,
    input_past: Any,
    intersample: str | Sequence[str],
) -> Trajectory:
    """`DelaySystem.simulate`."""
    dt = seconds(dt)
    ratio = real("simulating", "duration", duration) / dt
    if not ratio <= MOST_SAMPLES:
        raise SpecError(
            f"simulating: duration={duration!r} is {ratio:.3g} intervals of {dt:g} s; give a shorter time, "
            "or raise dt"
        )
    intervals = int(np.floor(ratio * (1 + 1e-12) + 1e-9))
    if intervals < 1:
        raise SpecError(f"simulating: duration={duration!r} must be at least one interval dt = {dt:g} s")
    n, inputs = plant.order, plant.shape[1]
    before = history(past, n, "history")
    start = before(np.zeros(1))[:, 0] if x0 is None else reals("simulating", "initial_state", x0)
    if start.shape != (n,) or not np.all(np.isfinite(start)):
        raise SpecError(f"simulating: initial_state has shape {start.shape}; give {n} finite numbers")
    motion = Motion(plant, dt, intervals)
    grid: F64 = np.arange(intervals + 1.0) * dt
    outside = _outside(u, inputs, grid, intersample)
    memory = np.zeros((motion.back, inputs))
    given = history(input_past, inputs, "input_history")
    if feedback is None and (input_past is not None or u is None):
        outside = _joined(given, outside)
    elif feedback is not None:
        memory = given(dt * np.arange(-motion.back, 0.0)).T.copy()
        outside = _joined(lambda t: np.zeros((inputs, t.size)), outside)
    seen: list[F64] = []
    law = None if feedback is None else _law(plant, feedback, motion, before, memory, seen)
    pieces, held = motion.run(before, start, outside, law, memory)

    first = motion.back * motion.pieces
    x = np.concatenate([start[:, None], pieces[first + motion.pieces - 1 :: motion.pieces, -1].T], axis=1)
    driven = _steps(held, motion.back, dt, outside)
    return Trajectory(
        plant=plant,
        t=grid,
        x=x,
        u=driven(grid),
        y=plant.C @ x,
        z=np.array(seen).T if seen else None,
        state=motion.between(pieces, before, intervals),
        input=driven,
    )


Law = Callable[[int, F64, F64, F64], F64]


def _outside(u: Any, inputs: int, grid: F64, intersample: str | Sequence[str]) -> History:
    """Inputs from outside at any instant."""
    if u is None:
        return lambda t: np.zeros((inputs, np.size(t)))
    if isinstance(u, Signals):
        u.agree("simulating", dt=grid[1], duration=grid[-1])
        intersample = u.intersample
    found = sources(u, inputs)
    kinds = intersample_kinds(intersample, found)
    for source in found:
        if is_samples(source) and np.ndim(source) and np.size(source) != grid.size:  # type: ignore[arg-type]
            raise DataError(
                f"simulating: u has {np.size(source)} samples for {grid.size} instants (duration/dt + 1)"  # type: ignore[arg-type]
            )
    own = [drive(source, kind, grid) for source, kind in zip(found, kinds, strict=True)]
    return lambda t: np.reshape([one(t) for one in own], (inputs, np.size(t)))


def _joined(past: History, then: History) -> History:
    return lambda t: np.where(t < 0, past(t), then(t))


def _steps(held: F64, back: int, dt: float, outside: History) -> History:
    """What is held from sample to sample, and what comes from outside."""

    def at(t: ArrayLike) -> F64:
        t = np.atleast_1d(np.asarray(t, dtype=np.float64))
        place = np.clip(np.floor(t / dt + 1e-9).astype(int) + back, 0, len(held) - 1)
        found: F64 = outside(t) + held[place].T
        return found

    return at


def _law(plant: Plant, feedback: Any, motion: Motion, before: History, memory: F64, seen: list[F64]) -> Law:
    """The feedback at a sample; z goes to `seen`."""
    inputs, dt, back = plant.shape[1], motion.dt, motion.back
    if not inputs:
        raise SpecError("simulating: the system has no inputs to feed back to; give B")
    if callable(feedback):

        def own(k: int, x: F64, pieces: F64, held: F64) -> F64:
            done = motion.between(pieces, before, k)

            def state(t: ArrayLike) -> F64:
                t = np.atleast_1d(np.asarray(t, dtype=np.float64))
                return np.where(t >= k * dt * (1 - 1e-12), x[:, None], done(t))

            steps = _steps(held[: back + k], back, dt, lambda t: np.zeros((inputs, t.size)))
            u = np.atleast_1d(reals("simulating", "what the law gives", feedback(k * dt, state, steps)))
            if u.shape != (inputs,) or not np.all(np.isfinite(u)):
                raise DataError(
                    f"simulating: at t = {k * dt:g} s the law gives {u}; {inputs} finite number(s) are needed"
                )
            return u

        return own
    k, transformation = as_design(plant, feedback)
    controller = Controller(transformation, k, dt)
    if (poles := controller.poles())[0].real >= 0:
        warnings.warn(sampled_words(poles, dt), ModfunWarning, stacklevel=5)
    reach = np.arange(1.0, len(controller.states) + 1)
    controller.reset(before(-dt * reach), memory[::-1].T)

    def law(_: int, x: F64, pieces: F64, held: F64) -> F64:
        u = controller.step(x)
        seen.append(controller.z)
        return u

    return law
