"""Orders where an input acts on the output at once, as a force on an acceleration."""

import modfun as mf
import numpy as np
import pytest
from scipy import signal

W, Z, DT = 75.0, 0.01, 1 / 1024  # rad/s, damping ratio, s


def beam(seed: int, numerator: list[float]) -> mf.Record:
    """One mode hit by a half sine of 8 ms."""
    t = np.arange(1024) * DT
    fine = np.arange(1024 * 16) * DT / 16
    force = 50 * np.sin(np.pi * (fine - 0.05) / 0.008) * ((fine >= 0.05) & (fine < 0.058))
    _, y, _ = signal.lsim((numerator, [1.0, 2 * Z * W, W**2]), force, fine)
    y = y[::16] + 0.01 * np.std(y) * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=y, u=force[::16], dt=DT, outputs="a", inputs="F", intersample="smooth")


@pytest.mark.parametrize("seed", [0, 1])
def test_an_accelerometer_has_as_many_zeros_as_poles(seed):
    found = mf.select_order(beam(seed, [1.0, 0.0, 0.0]), poles=range(1, 4))
    best = found.best
    assert (best.structure.poles, best.structure.zeros) == (2, 2)
    assert np.abs(best.model.poles()) == pytest.approx([W, W], rel=0.01)
    (said,) = [note for note in found.notes if "as many zeros as poles" in note]
    assert "beyond the sampling rate of 6.43e+03 rad/s" in said


def test_a_displacement_of_the_same_beam_has_fewer():
    found = mf.select_order(beam(0, [1.0]), poles=range(1, 4))
    assert (found.best.structure.poles, found.best.structure.zeros) == (2, 0)
    assert not [note for note in found.notes if "as many zeros as poles" in note]
