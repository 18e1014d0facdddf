"""Frequency responses beside Welch's and the local polynomial method: every figure of docs/response.md.

    python benches/frequency_response.py            # tables
    python benches/frequency_response.py --figures  # docs/figures/frf_*.png as well

Needs SciPy, and MODFUN_DATA for the measured structure and the definition of the simulated one.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import cont2discrete, csd

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]
Method = Callable[[mf.Record, F64], Any]
FIGURES = Path(__file__).parents[1] / "docs" / "figures"


def welch(rec: mf.Record, omega: F64, segments: int = 8) -> C128:
    """H1 = S_yu S_uu⁻¹ by Hann windows that overlap by half, interpolated to `omega`."""
    length = rec.y.shape[1] // segments
    words = {"fs": 2 * np.pi / rec.dt, "nperseg": length, "window": "hann", "detrend": "constant"}
    grid = csd(rec.u[0], rec.u[0], **words)[0]
    suu = np.array([[csd(b, a, **words)[1] for b in rec.u] for a in rec.u])
    syu = np.array([[csd(b, a, **words)[1] for b in rec.u] for a in rec.y])
    gains = np.einsum("ijk,kjl->ilk", syu, np.linalg.inv(suu.transpose(2, 0, 1)))
    flat = gains.reshape(-1, grid.size)
    return np.array([np.interp(omega, grid, row) for row in flat]).reshape(*gains.shape[:2], -1)


def etfe(rec: mf.Record, omega: F64) -> C128:
    """Y/U line by line, of one input."""
    y, u = np.fft.rfft(rec.y[0]), np.fft.rfft(rec.u[0])
    lines = 2 * np.pi * np.arange(y.size) / (rec.y.shape[1] * rec.dt)
    return np.interp(omega, lines, y / u)[None, None]


def local(**options: Any) -> Method:
    return lambda rec, omega: mf.frf(rec, omega, progress=False, **options)


def sampled(a: F64, b: F64, c: F64, dt: float) -> tuple[F64, F64, F64]:
    """A held system from sample to sample."""
    ad, bd, cd, _, _ = cont2discrete((a, b, c, np.zeros((c.shape[0], b.shape[1]))), dt)
    return ad, bd, cd


def response(system: tuple[F64, F64, F64], omega: F64, dt: float) -> C128:
    a, b, c = system
    eye = np.eye(a.shape[0])
    return np.array([c @ np.linalg.solve(np.exp(1j * w * dt) * eye - a, b) for w in omega]).transpose(1, 2, 0)


def run(system: tuple[F64, F64, F64], u: F64, x: F64) -> F64:
    a, b, c = system
    y = np.empty((c.shape[0], u.shape[1]))
    for k in range(u.shape[1]):
        y[:, k] = c @ x
        x = a @ x + b @ u[:, k]
    return y


def distance(found: C128, true: C128) -> float:
    return float(np.sqrt(np.sum(np.abs(found - true) ** 2) / np.sum(np.abs(true) ** 2)))


def compare(
    methods: dict[str, Method], make: Callable[[int], mf.Record], omega: F64, true: C128, seeds: int
) -> Any:
    """Median relative error, share of gains within their 95 % circle, and time, a method."""
    rows = []
    for name, method in methods.items():
        errors, inside, spent = [], [], []
        for seed in range(seeds):
            rec = make(seed)
            start = time.perf_counter()
            got = method(rec, omega)
            spent.append(time.perf_counter() - start)
            gains = getattr(got, "response", got)
            errors.append(distance(gains, true))
            if isinstance(got, mf.FrequencyResponse):
                inside.append(np.mean(np.abs(gains - true) <= got.radius()))
        rows.append((name, np.median(errors), np.mean(inside) if inside else np.nan, np.median(spent)))
    columns = zip(*rows, strict=True)
    return mf.Table(
        dict(zip(("method", "relative error", "within 95 %", "seconds"), map(list, columns), strict=True))
    )


def two_modes(seeds: int = 20) -> Any:
    """3 Hz with ζ = .02 and 8 Hz with ζ = .03, 64 Hz, 32 s, white input, any initial state."""
    dt, count = 1 / 64, 2049
    w = 2 * np.pi * np.array([3.0, 8.0])
    blocks = [np.array([[0, 1], [-(v**2), -2 * z * v]]) for v, z in zip(w, (0.02, 0.03), strict=True)]
    a, b = block_diag(*blocks), np.array([[0], [w[0] ** 2], [0], [w[1] ** 2]])
    system = sampled(a, b, np.array([[1.0, 0.0, 1.0, 0.0]]), dt)
    omega = 2 * np.pi * np.arange(1, 1024) / ((count - 1) * dt)

    def make(seed: int) -> mf.Record:
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((1, count))
        y = run(system, u, rng.standard_normal(4) * np.array([1, w[0], 1, w[1]]))
        return mf.Record(
            y=y + 0.01 * y.std() * rng.standard_normal(y.shape), u=u, dt=dt, intersample="smooth"
        )

    methods = {
        "Y/U": etfe,
        "Welch, 4 segments": lambda r, o: welch(r, o, 4),
        "Welch, 8 segments": welch,
        "modulating, h = 6": local(method="modulating", halfwidth=6),
        "modulating, windows of 8 and 16 s": local(method="modulating", windows=[16.0, 8.0], halfwidth=3),
        "lpm, R = 2, h = 6": local(method="lpm", halfwidth=6),
        "lrm, R = 2, h = 6": local(halfwidth=6),
        "lrm, default": local(),
        "lrm, default, awls": local(weighting="awls"),
    }
    return compare(methods, make, omega, response(system, omega, dt), seeds)


def simulated(folder: Path, count: int, noise: float, seeds: int = 10) -> Any:
    """The simulated two-input two-output structure of three modes; errors over bins 1 … N/2 − 1."""
    name = "definition.json" if count == 2048 else f"definition_N{count}.json"
    told = json.loads((folder / "frf_2x2_simulated" / name).read_text())
    a, b, c = (np.array(told[key], float) for key in "ABC")
    dt = told["Ts"]
    system = sampled(a, b, c, dt)

    def make(seed: int) -> mf.Record:
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((count, 2)).T
        y = run(system, u, np.zeros(6))
        return mf.Record(
            y=y + noise * y.std(axis=1)[:, None] * rng.standard_normal((count, 2)).T,
            u=u,
            dt=dt,
            intersample="smooth",
        )

    omega = 2 * np.pi * np.arange(1, count // 2) / (count * dt)
    omega = omega[omega <= np.pi / dt * (count - 2) / (count - 1)]
    methods = {
        "Welch, 8 segments": welch,
        "lpm, R = 2, 15 lines": local(method="lpm", halfwidth=7),
        "lrm, R = 2, 19 lines": local(halfwidth=9),
        "lrm, default": local(),
        "lrm, default, awls": local(weighting="awls"),
    }
    return compare(methods, make, omega, response(system, omega, dt), seeds)


def speed() -> Any:
    """All lines of a 2 × 2 record of 65,536 samples on one thread."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal((2, 65536))
    y = np.array([np.convolve(row, np.exp(-np.arange(200) / 40), "same") for row in u])
    rec = mf.Record(y=y + 0.01 * rng.standard_normal(y.shape), u=u, dt=0.01, intersample="smooth")
    rows = []
    for name, options in (
        ("lpm, h = 7", {"method": "lpm", "halfwidth": 7}),
        ("lrm, h = 9", {"halfwidth": 9}),
        ("lrm, h = 9, awls", {"halfwidth": 9, "weighting": "awls"}),
        ("lrm, default (half-widths by cross-validation)", {}),
    ):
        spent = []
        for _ in range(5):
            start = time.perf_counter()
            mf.frf(rec, threads=1, progress=False, **options)
            spent.append(time.perf_counter() - start)
        rows.append((name, np.median(spent), np.min(spent)))
    columns = zip(*rows, strict=True)
    return mf.Table(dict(zip(("method", "median s", "least s"), map(list, columns), strict=True)))


def structure(folder: Path) -> mf.Record:
    """The steel structure of DaISy: two shakers, two accelerometers, 1024 Hz."""
    path = folder / "daisy_flexible_structure_2x2" / "flex_0_4096.csv"
    return mf.read(path, time="t_s", outputs=["y1", "y2"], inputs=["u1", "u2"], intersample="smooth")


def measured(folder: Path) -> Any:
    """What each method calls noise on the measured structure, and how far the halves of the record differ."""
    rec = structure(folder)
    half = rec.t[rec.t.size // 2]
    parts = rec.window(rec.t[0], half), rec.window(half, rec.t[-1])
    omega = 2 * np.pi * np.arange(10.0, 500.0, 0.5)
    rows = []
    for name, method in {
        "Welch, 8 segments": welch,
        "lpm, R = 2, 15 lines": local(method="lpm", halfwidth=7),
        "lrm, R = 2, 19 lines": local(halfwidth=9),
        "lrm, default": local(),
    }.items():
        first, second = (getattr(got, "response", got) for got in (method(part, omega) for part in parts))
        apart = np.sqrt(np.sum(np.abs(first - second) ** 2) / np.sum(np.abs(first) ** 2))
        got = method(rec, omega)
        noise = np.full(2, np.nan)
        if isinstance(got, mf.FrequencyResponse):
            lines = mf.coefficients(rec, rec.intervals // 2).y[:, 10:]
            level = np.einsum("kii->ik", got.noise_cov).real
            noise = np.sqrt(level.mean(axis=1) / np.mean(np.abs(lines) ** 2, axis=1))
        rows.append((name, apart, *noise))
    columns = zip(*rows, strict=True)
    names = ("method", "halves apart", "noise of y1", "noise of y2")
    return mf.Table(dict(zip(names, map(list, columns), strict=True)))


def by_gains(records: int = 200) -> Any:
    """A structure fitted to the gains of records, beside fits to the records: the damping of a mode, %."""
    structure, true = mf.TransferFunction(poles=2, zeros=0), 0.6
    made = [
        mf.simulate(
            mf.tf([9], [1, true, 9]), input=np.random.default_rng(seed).standard_normal(2049), duration=102.4,
            intervals=2048, nsr=0.1, seed=seed, intersample="zoh",
        )
        for seed in range(records)
    ]  # fmt: skip
    rows = []
    for name, options in (
        ("the records", None),
        ("lrm, h = 8", {"halfwidth": 8}),
        ("lrm, default", {}),
        ("lpm, default", {"method": "lpm"}),
    ):
        if options is None:
            fits = [mf.fit(rec, structure) for rec in made]
        else:
            fits = [mf.fit(mf.frf(rec, band=(0.1, 12), progress=False, **options), structure) for rec in made]
        found = np.array([fit["a1"] for fit in fits])
        inside = [fit.conf_int()[0, 0] <= true <= fit.conf_int()[0, 1] for fit in fits]
        figures = (
            found.mean() / true - 1,
            found.std() / true,
            np.median([fit.bse[0] for fit in fits]) / true,
        )
        rows.append((name, *(100 * np.array(figures)), np.mean(inside)))
    columns = zip(*rows, strict=True)
    names = ("fit to", "bias", "sd", "median standard error", "within 95 %")
    return mf.Table(dict(zip(names, map(list, columns), strict=True)))


def figures(folder: Path | None) -> None:
    """Pictures of docs/response.md."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    system = mf.tf([9.0], [1.0, 0.12, 9.0])
    rng = np.random.default_rng(3)
    rec = mf.simulate(
        system, input=rng.standard_normal(1025), duration=102.4, intervals=1024, nsr=0.1, seed=1,
        intersample="zoh", initial_state=[1.0, -2.0],
    )  # fmt: skip
    omega = np.linspace(0.3, 8.0, 400)
    true = np.abs(system.frequency_response(omega).response[0, 0])
    found = mf.frf(rec, omega, progress=False)
    plain = mf.frf(rec, omega, method="lpm", progress=False)
    fig, ax = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
    ax.semilogy(omega, np.abs(welch(rec, omega)[0, 0]), color="0.6", linewidth=1, label="Welch, 8 segments")
    ax.semilogy(omega, np.abs(plain.response[0, 0]), color="C1", linewidth=1, label="lpm")
    gain, radius = np.abs(found.response[0, 0]), found.radius()[0, 0]
    ax.fill_between(
        omega, np.maximum(gain - radius, 1e-3), gain + radius, color="C0", alpha=0.25, linewidth=0
    )
    ax.semilogy(omega, gain, color="C0", linewidth=1.4, label="lrm, with 95 % band")
    ax.semilogy(omega, true, color="k", linewidth=0.9, linestyle="--", label="truth")
    ax.set(xlabel="frequency (rad/s)", ylabel="gain", xlim=(0.3, 8), ylim=(0.02, 60))
    ax.grid(True, which="both", alpha=0.25)
    ax.legend(frameon=False, ncols=2)
    fig.savefig(FIGURES / "frf_resonance.png", dpi=110)
    plt.close(fig)
    if folder is not None:
        got = mf.frf(structure(folder), progress=False)
        fig, axes = plt.subplots(
            3, 2, figsize=(8.4, 6.4), sharex=True, layout="constrained", height_ratios=(3, 3, 1.4)
        )
        hz = got.omega / (2 * np.pi)
        for i in range(2):
            for j in range(2):
                here = axes[i, j]
                gain, radius = np.abs(got.response[i, j]), got.radius()[i, j]
                here.fill_between(
                    hz, np.maximum(gain - radius, 1e-3), gain + radius, color="C0", alpha=0.3, linewidth=0
                )
                here.semilogy(hz, gain, color="C0", linewidth=0.9)
                here.set_title(f"{got.inputs[j]} → {got.outputs[i]}", fontsize=10)
                here.set_ylim(5e-3, 20)
                here.grid(True, alpha=0.25)
            axes[2, i].plot(hz, got.coherence[i], linewidth=0.8)
            axes[2, i].set(ylim=(0.5, 1.02), xlabel="frequency (Hz)", title=f"coherence of {got.outputs[i]}")
            axes[2, i].title.set_fontsize(10)
            axes[2, i].grid(True, alpha=0.25)
            axes[i, 0].set_ylabel("gain")
        fig.savefig(FIGURES / "frf_structure.png", dpi=110)
        plt.close(fig)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", action="store_true")
    asked = parser.parse_args()
    where = os.environ.get("MODFUN_DATA")
    folder = Path(where) if where else None
    print("Two modes, 40 dB, 20 records\n")
    print(two_modes())
    if folder is None:
        print("\nMODFUN_DATA is not set: the simulated and the measured structure are left out")
    else:
        for count in (2048, 16384):
            for noise in (0.0, 0.01, 0.1):
                print(f"\nSimulated structure, N = {count}, noise {100 * noise:g} %, 10 records\n")
                print(simulated(folder, count, noise))
        print("\nMeasured structure: distance between the halves' responses, noise over rms\n")
        print(measured(folder))
    print("\nDamping of a mode by way of gains, 200 records, %\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        print(by_gains())
    print("\nAll 32,767 lines of a 2 × 2 record of 65,536 samples, one thread\n")
    print(speed())
    if asked.figures:
        figures(folder)


if __name__ == "__main__":
    main()
