"""Records the numerical tests share: the report's example [24] and random systems, from the oracles."""

import numpy as np
from oracle import systems
from oracle.lines import Record

THETA24 = np.array([3.0, 8.0, 5.0])


def eq24(intervals=256, start=None):
    """Noise-free record of the report's example, eq. (24): T = 10 s, (y, y') = `start` at time zero."""
    dt = 10 / intervals
    y, u = systems.simulate(*systems.EQ24, [systems.chirp], dt, intervals, start)
    return Record(y, u, dt, ("smooth",))


def white(record, nsr, count, seed):
    """`count` noisy outputs (replicate, time): white noise of `nsr` times the rms of the record's output."""
    sigma = nsr * np.sqrt(np.mean(record.y**2))
    return record.y + sigma * np.random.default_rng(seed).normal(size=(count, record.y.size))


def random_record(seed, order, zeros, inputs=1, intervals=320, nsr=0.05, duration=25.6):
    """A noisy record of a random system from a random state, and its true θ."""
    rng = np.random.default_rng(seed)
    den, nums = systems.random_system(rng, order, zeros, inputs)
    dt = duration / intervals
    drives = systems.random_inputs(rng, inputs, tones=24)
    y, u = systems.simulate(den, nums, drives, dt, intervals, rng.normal(size=order))
    y = y + nsr * np.sqrt(np.mean(y**2)) * rng.normal(size=y.size)
    return Record(y, u, dt, ("smooth",) * inputs), systems.parameters(den, nums)
