"""Initial states by least squares and by the observer of the report: the figures of docs/initial_state.md.

    python benches/initial_state.py            # tables
    python benches/initial_state.py --figures  # docs/figures/initial_state.png as well

Needs SciPy.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import modfun as mf
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import place_poles

F64 = NDArray[np.float64]
FIGURES = Path(__file__).parents[1] / "docs" / "figures"
CHIRP = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
SYSTEMS = {
    "well damped, ζ = 0.53": mf.tf([5], [1, 3, 8]),
    "light, ζ = 0.1": mf.tf([1, 4], [1, 0.4, 4]),
    "third order": mf.tf([4, 9], np.poly([-1.0, -0.6 + 2.94j, -0.6 - 2.94j]).real),
}
LEVELS = (0.02, 0.05, 0.1, 0.2, 0.4)
FACTORS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)


def over_noise(replicates: int = 100) -> dict[str, dict[float, float]]:
    """Error of the initial state, rms over y and y' in % of their rms, after a fit; and S/E in dB."""
    system, model = SYSTEMS["well damped, ζ = 0.53"], mf.TransferFunction(poles=2, zeros=0)
    est = mf.Estimator(model, band=8.0, trend=None)
    size = np.sqrt(np.mean(system_states(system) ** 2, axis=1))
    found: dict[str, dict[float, float]] = {}
    for nsr in LEVELS:
        errors: dict[str, list[F64]] = {}
        ratios: dict[str, list[float]] = {}
        for k in range(replicates):
            true = size * np.random.default_rng([7, k]).standard_normal(2)
            rec = mf.simulate(system, **CHIRP, initial_state=true, nsr=nsr, seed=3, replicate=k)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mf.ModfunWarning)  # of standard errors, which are not used
                fit = est(rec)
            for name, options in (
                ("least squares", {}),
                ("observer", {"method": "observer"}),
                ("observer, 4 times as fast", {"method": "observer", "eigenvalues": faster(fit.model, 4.0)}),
            ):
                state = fit.initial_state(**options).state
                errors.setdefault(name, []).append((state - true) / size)
                y = fit.model.simulate(u=rec.u, dt=rec.dt, initial_state=state)
                ratios.setdefault(name, []).append(
                    20 * np.log10(np.std(rec.y) / np.sqrt(np.mean((rec.y[0] - y) ** 2)))
                )
        for name, own in errors.items():
            found.setdefault(name, {})[nsr] = float(100 * np.sqrt(np.mean(np.square(own))))
            found.setdefault(f"S/E, {name}", {})[nsr] = float(np.mean(ratios[name]))
    return found


def over_eigenvalues(replicates: int = 2000) -> dict[str, dict[str, list[float]]]:
    """Error of the observer over that of least squares, the model known, noise 10 %."""
    found = {}
    for name, system in SYSTEMS.items():
        ss = system.to_ss()
        a, c, dt = ss.A, ss.C, CHIRP["duration"] / CHIRP["intervals"]
        rng = np.random.default_rng(11)
        states = system_states(system)
        size = np.sqrt(np.mean(states**2, axis=1))[:, None]
        free = np.array([c @ expm(a * dt * k) for k in range(CHIRP["intervals"] + 1)])[:, 0]
        true = size * rng.standard_normal((len(a), replicates))
        level = 0.1 * np.sqrt(np.mean(states[0] ** 2))
        noise = level * rng.standard_normal((len(free), replicates))
        y = free @ true + noise
        best = rms((np.linalg.lstsq(free, y, rcond=None)[0] - true) / size)
        found[name] = {}
        for start in ("its own answer", "zero"):
            states = [observed(a, c, y, dt, faster(system, k), start) for k in FACTORS]
            found[name][start] = [rms((x - true) / size) / best for x in states]
    return found


def rms(errors: F64) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def faster(system: mf.LTI, factor: float) -> NDArray[np.complex128]:
    """The observer's eigenvalues: frequencies of the modes, decaying `factor` times as fast as they do."""
    poles = system.poles()
    return factor * poles.real + 1j * poles.imag


def system_states(system: mf.LTI) -> F64:
    """States y, y', … of the response from rest, (state, time)."""
    ss = system.to_ss()
    whole = mf.ss(ss.A, ss.B, np.eye(len(ss.A)), np.zeros((len(ss.A), 1)))
    return whole.simulate(
        u=CHIRP["input"], dt=CHIRP["duration"] / CHIRP["intervals"], intervals=CHIRP["intervals"]
    )


def observed(a: F64, c: F64, y: F64, dt: float, eigenvalues: NDArray[np.complex128], start: str) -> F64:
    """Initial states (state, replicate) of free responses (time, replicate), backwards from the last sample.

    From zero, as an observer usually starts, or from the state to which its own answer leads, as
    `fit.initial_state(method="observer")` does.
    """
    n, samples = len(a), len(y)
    back, forth = expm(-a * dt), expm(a * dt)
    placed = place_poles(back.T, (c @ back).T, np.exp(eigenvalues * dt))
    gain = placed.gain_matrix.T
    keep = np.eye(n) - gain @ c
    x, guess = np.zeros((n, y.shape[1])), np.eye(n)
    for k in range(samples - 1, -1, -1):
        move = keep if k == samples - 1 else keep @ back
        x, guess = move @ x + gain * y[k], move @ guess
    if start == "zero":
        return x
    return np.linalg.solve(np.eye(n) - guess @ np.linalg.matrix_power(forth, samples - 1), x)


def figure(noise: dict[str, dict[float, float]], ratios: dict[str, dict[str, list[float]]]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator

    fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    names = [name for name in noise if not name.startswith("S/E")]
    for name, marker in zip(names, "os^", strict=True):
        left.plot(
            [100 * nsr for nsr in LEVELS], list(noise[name].values()), f"{marker}-", label=name, markersize=4
        )
    left.set(
        xscale="log",
        yscale="log",
        xlabel="noise (% of the rms of y)",
        ylabel="error of y(0), y'(0) (% of rms)",
    )
    for k, (name, own) in enumerate(ratios.items()):
        right.plot(FACTORS, own["its own answer"], "o-", color=f"C{k}", label=name, markersize=4)
        right.plot(FACTORS, own["zero"], ":", color=f"C{k}")
    right.plot([], [], "k:", label="started from zero at the end")
    right.axhline(1.0, color="0.6", linewidth=0.8)
    right.set(xscale="log", yscale="log", ylim=(0.9, 30), ylabel="error, over that of least squares")
    right.set_xlabel("decay of the observer's error, over that of the modes")
    levels = [100 * nsr for nsr in LEVELS]
    for axis, ticks in (
        (left.xaxis, levels),
        (left.yaxis, [1, 2, 5, 10, 20, 50]),
        (right.xaxis, FACTORS),
        (right.yaxis, [1, 2, 5, 10, 20]),
    ):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    for here in (left, right):
        here.grid(True, alpha=0.3)
        here.legend(frameon=False, fontsize="small")
    fig.savefig(FIGURES / "initial_state.png", dpi=110)


def main(replicates: int = 100, draws: int = 2000, draw: bool = False) -> tuple[dict, dict]:
    """Prints the tables and returns them."""
    noise = over_noise(replicates)
    columns = {
        "": list(noise),
        **{f"{100 * nsr:g} %": [row[nsr] for row in noise.values()] for nsr in LEVELS},
    }
    print(
        mf.Table(columns, title="Fitted models: error of the initial state in %, S/E in dB, by noise"), "\n"
    )
    ratios = over_eigenvalues(draws)
    rows = {(name, start): row for name, own in ratios.items() for start, row in own.items()}
    columns = {"system": [name for name, _ in rows], "starts from": [start for _, start in rows]}
    columns |= {f"{k:g}": [row[i] for row in rows.values()] for i, k in enumerate(FACTORS)}
    print(mf.Table(columns, title="Error over that of least squares, by decay over that of the modes"))
    if draw:
        figure(noise, ratios)
    return noise, ratios


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figures", action="store_true")
    main(draw=parser.parse_args().figures)
