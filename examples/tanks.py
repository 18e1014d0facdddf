"""Cascaded tanks of which only the lower level is measured: equal outlets and the pump's gain.

h' = -k √h + k4 u, y' = k √h - k √y, levels in volts; h is eliminated. Both tanks are equal, so that what one
loses the other gains, and so are their outlets: with outlets of their own, the record tells k but not the
lower tank's apart from the gain (standard errors over 100 %). Tanks that overflow are another model: windows
are those in which the lower one does not, and the simulation stops levels at 10.

Eliminating h leaves third derivatives of y multiplied by powers of y, and a fit of these is right in few
windows only. Output error integrates both levels and needs no derivative: here it is what to use.

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
# Intervals of eight windows in which the lower level stays below the rim.
WINDOWS = ((0, 140), (20, 140), (40, 140), (60, 140), (280, 420), (420, 560), (560, 700), (700, 840))
TANKS = mf.Equation(
    ["h' = -k*sqrt(h) + k4*u", "y' = k*sqrt(h) - k*sqrt(y)"],
    outputs=["y"],
    params={"k": mf.Free(0.05, min=0.005, max=0.2), "k4": mf.Free(0.05, min=0.005, max=0.2)},
)


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


def windows(u: np.ndarray, y: np.ndarray) -> mf.Table:
    """Fit and output error in each window; V left by output error."""
    rows = []
    rival = mf.rivals.output_error(TANKS, start={"k": 0.04, "k4": 0.03})
    for first, last in WINDOWS:
        rec = mf.Record(y=y[first : last + 1], u=u[first : last + 1], dt=DT)
        fit = mf.fit(rec, TANKS)
        other = rival.solve(rec)
        own = dict(zip(fit.param_names, zip(fit.params, fit.bse, strict=True), strict=True))
        words = [
            f"{value:.4f} on its bound" if value <= 0.005 else f"{value:.4f} ± {error:.4f}"
            for value, error in (own["k"], own["k4"])
        ]
        words += [f"{other.params[name]:.4f} ± {other.bse[name]:.4f}" for name in ("k", "k4")]
        rows.append(
            [f"{first * DT:.0f} to {last * DT:.0f}", *words, round(other.noise_cov[0][0, 0] ** 0.5, 2)]
        )
    names = ["s", "k, fit", "k4, fit", "k, output error", "k4, output error", "left, V"]
    return mf.Table(dict(zip(names, zip(*rows, strict=True), strict=True)))


def under_noise(u: np.ndarray, y: np.ndarray, level: float = 0.02, repeats: int = 8) -> mf.Table:
    """In how many fits to output error's simulation of each window, with noise, k is right to 20 %."""
    rows = []
    rival = mf.rivals.output_error(TANKS, start={"k": 0.04, "k4": 0.03})
    for first, last in WINDOWS:
        pump = u[first : last + 1]
        found = rival.solve(mf.Record(y=y[first : last + 1], u=pump, dt=DT))
        right = 0
        for seed in range(repeats):
            noise = level * np.random.default_rng(seed).standard_normal(pump.size)
            try:
                fit = mf.fit(mf.Record(y=found.simulated[0] + noise, u=pump, dt=DT), TANKS)
            except mf.DataError:  # the band was chosen too narrow for five unknowns
                continue
            right += abs(fit["k"] / found.params["k"] - 1) < 0.2
        rows.append([f"{first * DT:.0f} to {last * DT:.0f}", f"{right} of {repeats}"])
    names = ["s", f"right with {level:g} V of noise"]
    return mf.Table(dict(zip(names, zip(*rows, strict=True), strict=True)))


def main(folder: Path) -> tuple[mf.Fit, float]:
    """Fit the start of the record, simulate all of it; the fit and the rest's error in V."""
    u, y = read(folder)
    fit = mf.fit(mf.Record(y=y[: FITTED + 1], u=u[: FITTED + 1], dt=DT), TANKS)
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        print(f"{name} = {value:.3g} ± {error:.1g}")
    found = levels(fit, u, y)
    rms = float(np.sqrt(np.mean((y - found)[FITTED:] ** 2)))
    print(f"simulated, the rest of the record: error {rms:.2f} V rms of {np.std(y[FITTED:]):.2f} V")
    print(windows(u, y))
    return fit, rms


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    place = Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA"))
    main(place)
    print(under_noise(*read(place)))
