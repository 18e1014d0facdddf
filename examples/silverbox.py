"""Silverbox, an electronic Duffing oscillator: physical parameters from 1.7 s, checked on the 25 s after.

The record's last 8,192 samples are a whole period of a multisine of odd lines, in the steady state. How much
the gains of these lines scatter about a smooth response, beside the distortion of the fitted equation, is a
second check.

python examples/silverbox.py [FOLDER]     # of silverbox_multisine's CSV file; default: $MODFUN_DATA
"""

import os
import sys
from pathlib import Path

import modfun as mf
import numpy as np
from scipy.signal import resample_poly

DT = 2**14 / 1e7  # s
FITTED = 1024  # intervals
SETTLED = 300  # samples after which the unknown initial state is forgotten (m/d is 15 samples)
FINER = 8  # steps a sample in simulation
PERIOD = 8192  # samples
LINES = np.arange(1, 2684, 2)  # that the multisine has
NEAR = 5  # lines on each side, through which a parabola goes


def read(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Input and output, V."""
    path = folder / "silverbox_multisine" / "silverbox_50000_66384.csv"
    _, u, y = np.loadtxt(path, delimiter=",", skiprows=1).T
    return u, y


def simulated(fit: mf.Fit, u: np.ndarray) -> np.ndarray:
    """Response from rest, Runge-Kutta on the input between its samples."""
    m, d, k1, k3, c = fit.params[[fit.param_names.index(n) for n in ("m", "d", "k1", "k3", "c")]]
    fine, h = resample_poly(u, 2 * FINER, 1), DT / FINER
    y, v, out = 0.0, 0.0, []

    def rate(y: float, v: float, u: float) -> tuple[float, float]:
        return v, (u - c - d * v - k1 * y - k3 * y**3) / m

    for k in range(0, fine.size - 2, 2):
        if k % (2 * FINER) == 0:
            out.append(y)
        a = rate(y, v, fine[k])
        b = rate(y + h / 2 * a[0], v + h / 2 * a[1], fine[k + 1])
        e = rate(y + h / 2 * b[0], v + h / 2 * b[1], fine[k + 1])
        f = rate(y + h * e[0], v + h * e[1], fine[k + 2])
        y += h / 6 * (a[0] + 2 * b[0] + 2 * e[0] + f[0])
        v += h / 6 * (a[1] + 2 * b[1] + 2 * e[1] + f[1])
    return np.array(out)


def scatter(u: np.ndarray, y: np.ndarray) -> float:
    """Rms of the output, V, beside a smooth response: gains less parabolas through their neighbours."""
    inputs = np.fft.rfft(u[-PERIOD:])[LINES] / PERIOD
    gains = np.fft.rfft(y[-PERIOD:])[LINES] / PERIOD / inputs
    x = np.arange(-NEAR, NEAR + 1.0)
    smooth, _ = np.linalg.qr(np.stack([x**0, x, x**2], axis=1))
    around = np.lib.stride_tricks.sliding_window_view(gains, x.size)
    apart = around - around @ smooth @ smooth.T
    variance = np.sum(np.abs(apart) ** 2, axis=1) / (x.size - 3)
    return float(np.sqrt(2 * np.sum(variance * np.abs(inputs[NEAR:-NEAR]) ** 2)))


def distortion(fit: mf.Fit, u: np.ndarray, realisations: int = 24) -> float:
    """Rms of the output, V, that nonlinearity adds to the best linear response: the fitted equation's, under
    multisines of the record's amplitudes and other phases."""
    size = np.abs(np.fft.rfft(u[-PERIOD:]))
    rng, made = np.random.default_rng(0), []
    for _ in range(realisations):
        lines = np.zeros(size.size, dtype=complex)
        lines[LINES] = size[LINES] * np.exp(2j * np.pi * rng.random(LINES.size))
        periods = np.tile(np.fft.irfft(lines, PERIOD), 4)[: 3 * PERIOD + 1]
        run = mf.simulate(fit.model, input=periods, duration=3 * PERIOD * DT, intervals=3 * PERIOD)
        made.append(run.window(PERIOD * DT, 3 * PERIOD * DT))
    response = mf.frf(made, method="periodic")
    assert response.distortion is not None  # there are two periods
    return float(np.sqrt(2 * np.sum((response.distortion[0, 0] * size[LINES] / PERIOD) ** 2)))


def main(folder: Path) -> tuple[mf.Fit, float]:
    """Fit the first 1024 intervals, simulate the rest; the fit and the error's rms in V."""
    u, y = read(folder)
    # c is the offset of the input. The band ends at eight samples a period, above the resonance at 68 Hz.
    box = mf.Equation("m*y'' + d*y' + k1*y + k3*y**3 + c = u")
    fit = mf.fit(mf.Record(y=y[: FITTED + 1], u=u[: FITTED + 1], dt=DT), box, harmonics=126)
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        print(f"{name} = {value:.4g} ± {error:.1g}")
    rest = slice(FITTED, None)
    error = (y[rest] - simulated(fit, u[rest])[: y[rest].size])[SETTLED:]
    rms = float(np.sqrt(np.mean(error**2)))
    size = np.std(y[rest])
    print(f"simulated, the rest of the record: error {1e3 * rms:.2f} mV rms of {1e3 * size:.1f} mV")
    print(
        f"beside a smooth response: the record {1e3 * scatter(u, y):.2f} mV, "
        f"the fitted equation {1e3 * distortion(fit, u):.2f} mV"
    )
    return fit, rms


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    main(Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA")))
