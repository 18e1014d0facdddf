"""EMPS, an electric drive with friction: mass and friction from the first half of a record.

M q'' + Fv q' + Fc sign(q') + OF = force. The position q is measured to micrometres; what is wrong is the
balance of forces (friction is not quite Coulomb's), so that the noise is in the equation. The sign of the
velocity comes from the measured position, low-pass filtered forwards and backwards at 100 Hz and
differentiated: that noise does not turn its sign is assumed, and so but for a few samples at reversals.

python examples/emps.py [FOLDER]     # of emps_est's CSV file; default: $MODFUN_DATA
"""

import os
import sys
from pathlib import Path

import modfun as mf
import numpy as np
from scipy.signal import butter, sosfiltfilt

GAIN = 35.1507  # N/V, given with the record
DT = 1e-3  # s
TOP = 20.0  # Hz


def read(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position in m, velocity in m/s, force in N."""
    _, _, q, volts = np.loadtxt(folder / "emps_est" / "data_emps.csv", delimiter=",", skiprows=1).T
    low_pass = butter(4, 100, fs=1 / DT, output="sos")
    return q, np.gradient(sosfiltfilt(low_pass, q), DT), GAIN * volts


def record(q: np.ndarray, velocity: np.ndarray, force: np.ndarray) -> mf.Record:
    return mf.Record(
        y=q, u=[force, np.sign(velocity)], dt=DT, outputs=["q"], inputs=["force", "s"], units={"q": "m"}
    )


def simulated(params: dict[str, float], force: np.ndarray, q: float, velocity: float) -> np.ndarray:
    """Position under the measured force alone, with friction that holds where the force is small."""
    out = np.empty(force.size)
    for k, push in enumerate(force - params["OF"]):
        out[k] = q
        drag = params["Fc"] * np.sign(velocity) if velocity else np.clip(push, -params["Fc"], params["Fc"])
        new = velocity + DT / params["M"] * (push - params["Fv"] * velocity - drag)
        velocity = 0.0 if new * velocity < 0 else new
        q += DT * velocity
    return out


def main(folder: Path) -> tuple[mf.Fit, float]:
    """Fit the first half, simulate the second; the fit and the error's rms in m."""
    q, velocity, force = read(folder)
    middle = q.size // 2
    drive = mf.Equation("M*q'' + Fv*q' + Fc*s + OF = force", outputs=["q"], inputs=["force", "s"])
    first = record(q[:middle], velocity[:middle], force[:middle])
    fit = mf.fit(first, drive, noise="equation", method="wls", band=(0, 2 * np.pi * TOP))
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        print(f"{name} = {value:.4g} ± {error:.1g}")
    both = mf.fit(first, drive, noise="process", band=(0, 2 * np.pi * TOP))  # and noise on q
    print(f"with noise of both kinds: {both}\n{both.process_noise()}")
    params = dict(zip(fit.param_names, fit.params, strict=True))
    found = simulated(params, force[middle:], q[middle], velocity[middle])
    error = q[middle:] - found
    rms = float(np.sqrt(np.mean(error**2)))
    print(f"simulated, second half: error {1e3 * rms:.2f} mm rms of {1e3 * np.std(q[middle:]):.0f} mm")
    return fit, rms


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    main(Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA")))
