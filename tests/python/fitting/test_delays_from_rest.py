"""Step tests of plants with dead time that begin at rest: the delay is right, and has a standard error."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest

DEN = [1, 95 / 1200, 1 / 1200]  # 80 s and 15 s
TIMES = 2.0 * np.arange(300)
U = np.where(TIMES >= 60, 45.0, 35.0)


def heated(seed: int, noise: float = 0.1, delay: float = 11.0) -> mf.Record:
    """A step of 10 that takes a temperature up by 6 K."""
    y = 41 + mf.tf([0.6 / 1200], DEN, delay=delay).simulate(u=U - 35, dt=2.0, intersample="zoh")
    y = y + noise * np.random.default_rng(seed).standard_normal(300)
    return mf.Record(y, U, dt=2.0, intersample="zoh")


def fitted(record: mf.Record, most: float = 30.0, start: float | None = None) -> mf.Fit:
    late = mf.Free(start, min=0, max=most)
    return mf.fit(record, mf.TransferFunction(poles=2, zeros=0, delay=late), initial_state="rest")


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        ((1012, 1038, 1060, 1088), {}),  # the delay had a standard error of 0
        ((1030, 1055, 1075, 1087, 1098), {}),  # a pole at 0.1 rad/s, the delay on its bound
        ((1006, 1022, 1088), {"most": 60.0}),  # a delay of 32±2 s, or a search without an end
        ((1030,), {"start": 11.0}),
    ],
)
def test_delays_from_rest_are_right(seeds: tuple[int, ...], words: dict[str, float]) -> None:
    for seed in seeds:
        fit = fitted(heated(seed), **words)
        assert fit.status == "ok"
        assert not fit.at_bound
        assert 0.5 < fit.bse["delay"] < 4
        assert np.all(np.abs(fit.params - [*DEN[1:], 0.6 / 1200, 11.0]) < 3.5 * fit.bse)


@pytest.mark.parametrize(("noise", "delay", "seeds"), [(0.03, 11.0, (1000, 1030)), (0.1, 1.5, (1001, 1020))])
def test_little_noise_and_short_delays(noise: float, delay: float, seeds: tuple[int, ...]) -> None:
    """Delays were on the bound of 30 s, or 11 standard errors off."""
    for seed in seeds:
        fit = fitted(heated(seed, noise, delay))
        assert float(fit.model.poles().real.max()) < 0
        assert abs(fit["delay"] - delay) < 3.5 * fit.bse["delay"]


def test_a_slow_plant_leaves_the_way_of_sums_that_fold() -> None:
    """Searches begun at the answer beside left it at some levels, and the search of the level had no end."""
    y = 41 + mf.tf([0.6 / 6000], [1, 415 / 6000, 1 / 6000], delay=11.0).simulate(
        u=U - 35, dt=2.0, intersample="zoh"
    )
    for seed in (1005, 1008, 1012):
        noise = 0.03 * np.random.default_rng(seed).standard_normal(300)
        fit = fitted(mf.Record(y + noise, U, dt=2.0, intersample="zoh"))
        assert fit.status == "ok"
        assert abs(fit["delay"] - 11) < 3.5 * fit.bse["delay"]


@pytest.mark.statistics
def test_intervals_of_delays_from_rest_hold() -> None:
    """60 records: root mean square of errors over standard errors 0.7 to 1.3 (false alarm 1 in 1,000)."""
    z = []
    for seed in range(60):
        fit = fitted(heated(seed))
        z.append((fit["delay"] - 11) / fit.bse["delay"])
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3
