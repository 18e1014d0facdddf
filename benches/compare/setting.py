"""The setting of all comparisons: the report's eq. (24), M = 6, N = 256, trapezoid, NSR 0.2, five steps.

A rival works on real vectors (Re V(0), …, Re V(8), Im V(1), …, Im V(8)) of Fourier coefficients, s counted in
the highest line's frequency, so that s = i z with z = m/8 and θ = UNIT · (scaled a1, a2, b0).
"""

import modfun as mf
import numpy as np

INTERVALS, DURATION, HARMONICS, ORDER, NSR, STEPS = 256, 10.0, 6, 2, 0.2, 5
INPUT = "sin(t**2/5)"
SAMPLES = INTERVALS + 1
LINES = HARMONICS + ORDER + 1  # m = 0 … M + n
COEFFICIENTS = 2 * LINES - 1
SYSTEM = mf.tf([5], [1, 3, 8])

CLEAN = mf.simulate(SYSTEM, input=INPUT, duration=DURATION, intervals=INTERVALS)
Y, U = CLEAN.y[0], CLEAN.u[0]
SIGMA = NSR * float(np.sqrt(np.mean(Y**2)))

M = np.arange(LINES)
Z = M / M[-1]
_TOP = 2 * np.pi * M[-1] / DURATION
UNIT = np.array([_TOP, _TOP**2, _TOP**2])
H = np.where(M == 0, 1.0, 0.5)  # variances of Re and of Im


def _dft() -> np.ndarray:
    """(17, 257): from samples to coefficients by the trapezoidal rule."""
    weights = np.ones(SAMPLES)
    weights[[0, -1]] = 0.5
    phase = 2 * np.pi * (np.outer(M, np.arange(SAMPLES)) % INTERVALS) / INTERVALS
    return np.vstack([np.cos(phase), -np.sin(phase[1:])]) * weights / INTERVALS


DFT = _dft()
Y0 = DFT @ Y  # noise-free coefficients
U0 = DFT @ U
NOISE = SIGMA * DFT  # from unit normals on the samples to the coefficients' noise
COLOUR = np.linalg.cholesky(NOISE @ NOISE.T)  # from 17 unit normals: the same distribution
UR, UI = U0[:LINES], np.concatenate([[0.0], U0[LINES:]])


def differences() -> tuple[np.ndarray, np.ndarray]:
    """D_R (8, 9) and D_I (7, 9): second differences for m = -1 … 6 from the lines 0 … 8.

    V(-1) is the conjugate of V(1), and the row m = -1 is real: it has no Im row.
    """
    re, im = np.zeros((HARMONICS + 2, LINES)), np.zeros((HARMONICS + 2, LINES))
    for row, m in enumerate(range(-1, HARMONICS + 1)):
        for j, c in enumerate((1.0, -2.0, 1.0)):
            re[row, abs(m + j)] += c
            im[row, abs(m + j)] += c * np.sign(m + j)
    return re, im[1:]
