"""Cascaded tanks of which only the lower level is measured: equal outlets and the pump's gain.

h' = -k √h + k4 u, y' = k √h - k √y, levels in volts; h is eliminated. Both tanks are equal, so that what one
loses the other gains, and so are their outlets: with outlets of their own, the record tells k but not the
lower tank's apart from the gain (standard errors over 100 %). Tanks that overflow are another model: the fit
uses the record before the first overflow, the simulation after it stops levels at 10.

python examples/tanks.py [FOLDER]     # of cascaded_tanks_est's CSV file; default: $MODFUN_DATA
"""

import os
import sys
from pathlib import Path

import modfun as mf
import numpy as np

DT = 4.0  # s
FITTED = 140  # intervals before the first overflow
FULL = 10.0


def read(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Pump and lower level, V."""
    _, u, y = np.loadtxt(folder / "cascaded_tanks_est" / "cts_est.csv", delimiter=",", skiprows=1).T
    return u, y


def simulated(k: float, gain: float, u: np.ndarray, upper: float, lower: float) -> np.ndarray:
    """Lower level; what flows over is lost. Steps of .4 s between samples, straight input."""
    out = np.empty(u.size)
    step = DT / 10
    for n in range(u.size):
        out[n] = lower
        for part in range(10):
            pump = u[n] + (u[min(n + 1, u.size - 1)] - u[n]) * part / 10
            through = k * np.sqrt(upper)
            lower = np.clip(lower + step * (through - k * np.sqrt(lower)), 0.0, FULL)
            upper = np.clip(upper + step * (gain * pump - through), 0.0, FULL)
    return out


def levels(fit: mf.Fit, u: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The lower level over the whole record; the upper tank begins where the lower one's slope says."""
    k, gain = fit.params[[fit.param_names.index(n) for n in ("k", "k4")]]
    slope = np.polyfit(DT * np.arange(10), y[:10], 1)[0]
    return simulated(k, gain, u, (slope / k + np.sqrt(y[0])) ** 2, y[0])


def main(folder: Path) -> tuple[mf.Fit, float]:
    """Fit the start of the record, simulate all of it; the fit and the rest's error in V."""
    u, y = read(folder)
    tanks = mf.Equation(
        ["h' = -k*sqrt(h) + k4*u", "y' = k*sqrt(h) - k*sqrt(y)"],
        outputs=["y"],
        params={"k": mf.Free(0.05, min=0.005, max=0.2), "k4": mf.Free(0.05, min=0.005, max=0.2)},
    )
    fit = mf.fit(mf.Record(y=y[: FITTED + 1], u=u[: FITTED + 1], dt=DT), tanks)
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        print(f"{name} = {value:.3g} ± {error:.1g}")
    found = levels(fit, u, y)
    rms = float(np.sqrt(np.mean((y - found)[FITTED:] ** 2)))
    print(f"simulated, the rest of the record: error {rms:.2f} V rms of {np.std(y[FITTED:]):.2f} V")
    return fit, rms


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    main(Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA")))
