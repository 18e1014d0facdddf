"""A rod of 2,999 cells as a model of four poles, and Bode points as a model of two; a fit made smaller.

python examples/reduce_model.py
"""

from typing import Any

import modfun as mf
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]


def rod(cells: int) -> tuple[Any, Array, Array]:
    """x' = Ax + Bu, y = Cx: heated at one third of its length, measured at two thirds; A is sparse."""
    ones = np.ones(cells) * (cells + 1.0) ** 2
    a = sparse.diags([ones[1:], -2 * ones, ones[1:]], [-1, 0, 1], format="csc")
    b, c = np.zeros((cells, 1)), np.zeros((1, cells))
    b[cells // 3, 0], c[0, 2 * cells // 3] = cells + 1.0, 1.0
    return a, b, c


def main() -> None:
    red = mf.reduce(rod(2999), 4, dcgain=True)
    print(red.summary())
    print(f"dc gain {red.model.dcgain():.6f}, exact 1/9 = {1 / 9:.6f}\n")

    # Bode points as they stand in a drawing: rad/s, dB, degrees.
    omega = np.array([0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0])
    magnitude = np.array([-4.1, -4.0, -3.3, -1.0, 0.3, -5.5, -19.1, -38.9])
    phase = np.array([-2.2, -6.7, -24.0, -56.0, -108.0, -155.0, -179.0, -189.0])
    points = mf.FrequencyResponse(omega=omega, magnitude_db=magnitude, phase_deg=phase)
    small = mf.reduce(points, mf.TransferFunction(poles=2, zeros=0), weight="relative")
    print(small.model)
    print(f"largest relative error on the points: {small.errors['largest_relative'][0]:.3f}\n")

    # Two outputs fitted with a denominator each share their poles: the third Hankel value says so.
    truth = mf.tf([[[1, 2]], [[3]]], [1, 0.8, 4])
    rec = mf.simulate(truth, input="sin(t**2/5)", duration=20.0, intervals=1000, nsr=0.02, seed=0)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="separate"))
    common = mf.reduce(fit, mf.TransferFunction(poles=2, zeros=1, denominator="common"))
    print("Hankel singular values of both models together:", np.round(common.hankel, 4))
    print(common.model)


if __name__ == "__main__":
    main()
