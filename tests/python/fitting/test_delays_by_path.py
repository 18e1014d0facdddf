"""Known delays of each path, in any order: coefficients belong to the outputs and inputs in their names."""

from __future__ import annotations

from itertools import product

import modfun as mf
import numpy as np
import pytest

DEN = [1.0, 0.4]
GAINS = {("y1", "u1"): 0.8, ("y1", "u2"): -1.2, ("y2", "u1"): 0.55, ("y2", "u2"): -1.6}


def record(delay: list[list[float]]) -> mf.Record:
    rng = np.random.default_rng(3)
    t = 0.25 * np.arange(400)
    u = [np.repeat(rng.choice([-1.0, 1.0], 400 // each), each) for each in (20, 16)]
    numerators = [[[GAINS[y, u]] for u in ("u1", "u2")] for y in ("y1", "y2")]
    return mf.simulate(
        mf.tf(numerators, DEN, delay=delay),
        input=u,
        duration=float(t[-1]),
        intervals=t.size - 1,
        intersample="zoh",
        nsr=0.01,
        seed=1,
    )


def missed(fit: mf.Fit) -> dict[str, float]:
    """Standard errors between each gain and the truth."""
    return {
        f"b0[{y},{u}]": float(abs(fit[f"b0[{y},{u}]"] - gain) / fit.bse[f"b0[{y},{u}]"])
        for (y, u), gain in GAINS.items()
    }


@pytest.mark.parametrize("delays", [*product((1.0, 3.0), repeat=4), (1, 3, 7, 3), (7, 3, 1, 3), (1, 3, 7, 1)])
def test_gains_are_those_of_the_paths_in_their_names(delays: tuple[float, ...]) -> None:
    delay = [list(delays[:2]), list(delays[2:])]
    fit = mf.fit(record(delay), mf.TransferFunction(poles=1, zeros=0, denominator="separate", delay=delay))
    assert max(missed(fit).values()) < 5  # 0.3 % by chance, Student of 25 degrees


def test_a_known_delay_that_another_output_has_too_beside_a_free_one() -> None:
    rec = record([[1.0, 3.0], [2.0, 3.0]])
    delay = [[1.0, 3.0], [mf.Free(max=4.0), 3.0]]
    fit = mf.fit(rec, mf.TransferFunction(poles=1, zeros=0, denominator="separate", delay=delay))
    assert max(missed(fit).values()) < 5
    assert fit["delay[y2,u1]"] == pytest.approx(2.0, abs=0.05)


def test_the_summary_names_a_known_delay_once() -> None:
    delay = [[1.0, 3.0], [7.0, 3.0]]
    fit = mf.fit(record(delay), mf.TransferFunction(poles=1, zeros=0, denominator="common", delay=delay))
    assert str(fit.summary()).count("u2 delayed 3 s") == 1
