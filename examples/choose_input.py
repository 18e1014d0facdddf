"""Before the flight: which input lets one know the derivatives best?

The short period of an aircraft (Za, Zd, Ma, Mq, Md; angle of attack and pitch rate measured) under inputs
of equal length: the Cramér-Rao bound of each derivative, at equal peaks of the elevator and at equal peaks
of the angle of attack, and what maximum likelihood makes of simulated records. Then two inputs: aileron and
rudder at once, as orthogonal multisines, and one after the other.

    python examples/choose_input.py [--figures docs/figures]
"""

import argparse
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEG = np.pi / 180
DT, LENGTH = 0.02, 16.0  # s
RATE = 60 * DEG  # what the actuator follows, rad/s
ELEVATOR, ALPHA = 2 * DEG, 3 * DEG  # peaks allowed
NOISE = [0.1 * DEG, 0.2 * DEG]  # alpha in rad, q in rad/s

MODEL = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
GUESS = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}  # from the wind tunnel, say
OMEGA = float(np.sqrt(GUESS["Za"] * GUESS["Mq"] - GUESS["Ma"]))  # of the short period, rad/s

LATERAL = mf.StateSpace(
    [["Yb", 0.1, -1, 0.07], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.1, 0]],
    [[0, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]],
    states=["beta", "p", "r", "phi"],
    inputs=["da", "dr"],
)
LATERAL_GUESS = {
    "Yb": -0.2, "Lb": -15.0, "Lp": -2.5, "Lr": 1.0, "Nb": 4.5, "Np": -0.1, "Nr": -0.4,
    "Ydr": 0.04, "Lda": -18.0, "Ldr": 3.0, "Nda": -0.6, "Ndr": -3.0,
}  # fmt: skip
LATERAL_NOISE = [0.1 * DEG, 0.4 * DEG, 0.2 * DEG, 0.1 * DEG]


def inputs() -> dict[str, mf.signals.Signals]:
    """The candidates, 2 deg of elevator each."""
    s = mf.signals
    common: dict[str, Any] = {"dt": DT, "amplitude": ELEVATOR, "before": 1.0, "duration": LENGTH}
    half = {**common, "duration": LENGTH / 2}
    once = s.multistep("de", [3, 2, 1, 1], omega=OMEGA, rate=RATE, **half)
    return {
        "doublet": s.doublet("de", omega=OMEGA, rate=RATE, **common),
        "2-1-1": s.multistep("de", [2, 1, 1], omega=OMEGA, rate=RATE, **common),
        "3-2-1-1": s.multistep("de", [3, 2, 1, 1], omega=OMEGA, rate=RATE, **common),
        "3-2-1-1 twice": once.then(once),
        "chirp": s.chirp("de", band=(OMEGA / 3, 3 * OMEGA), **common),
        "multisine": s.multisine("de", band=(OMEGA / 3, 2 * OMEGA), **common),
        "PRBS": s.prbs("de", band=(OMEGA / 3, 2 * OMEGA), rate=RATE, after=0.2, **common),
    }


def longitudinal() -> dict[str, dict[str, float]]:
    """Bounds in % of the derivatives, and peaks, at 2 deg of elevator; the factor that makes alpha 3 deg."""
    rows = {}
    for name, de in inputs().items():
        bound = mf.crlb(MODEL, de, params=GUESS, sigma=NOISE, trend="constant")
        y = MODEL.model(GUESS).simulate(u=de)
        peak = float(np.abs(y[0]).max())
        percent = 100 * bound.sd / np.abs(bound.values)
        rows[name] = {
            "alpha": peak / DEG,
            "rms": float(np.sqrt(np.mean(de.u**2))) / DEG,
            **dict(zip(GUESS, percent, strict=True)),
            "all": bound.relative,
            "factor": ALPHA / peak,
            "all at 3 deg": bound.relative * peak / ALPHA,
        }
    return rows


def verified(name: str, replicates: int = 400) -> Array:
    """Standard deviation of maximum likelihood on simulated records over the bound, a derivative each."""
    de = inputs()[name]
    y = MODEL.model(GUESS).simulate(u=de)
    noise = np.random.default_rng(1).standard_normal((replicates, *y.shape)) * np.array(NOISE)[:, None]
    batch = mf.Batch(
        y=y + noise, u=de.u, dt=DT, outputs=MODEL.outputs, inputs=de.inputs, intersample=de.intersample
    )
    many = mf.fit_many(batch, MODEL, band=6 * OMEGA)
    bound = mf.crlb(MODEL, de, params=GUESS, sigma=NOISE, trend="constant")
    ratios: Array = many.params.std(axis=0, ddof=1) / bound.sd
    return ratios


def lateral() -> dict[str, dict[str, float]]:
    """Bounds in % of the derivatives: both inputs at once, and one after the other, in the same 20 s."""
    s, band = mf.signals, (0.7, 5.0)
    common: dict[str, Any] = {"dt": DT, "amplitude": 2 * DEG}
    at_once = s.multisine(["da", "dr"], band=band, duration=20.0, **common)
    alone = [s.multisine(name, band=band, duration=10.0, **common) for name in ("da", "dr")]
    steps = [s.multistep(name, omega=2.2, rate=RATE, duration=10.0, **common) for name in ("da", "dr")]
    sweeps = [s.chirp(name, band=band, duration=10.0, **common) for name in ("da", "dr")]
    designs = {
        "multisines at once": at_once,
        "multisines in turn": alone[0].then(alone[1]),
        "chirps in turn": sweeps[0].then(sweeps[1]),
        "3-2-1-1 in turn": steps[0].then(steps[1]),
    }
    rows = {}
    for name, design in designs.items():
        bound = mf.crlb(LATERAL, design, params=LATERAL_GUESS, sigma=LATERAL_NOISE, trend="constant")
        y = LATERAL.model(LATERAL_GUESS).simulate(u=design)
        percent = dict(zip(bound.param_names, 100 * bound.sd / np.abs(bound.values), strict=True))
        peaks = {"beta": float(np.abs(y[0]).max() / DEG), "phi": float(np.abs(y[3]).max() / DEG)}
        rows[name] = {**peaks, **percent, "all": bound.relative}
    return rows


def table(rows: dict[str, dict[str, float]], title: str) -> mf.Table:
    """Rows by name as a Table."""
    columns: dict[str, list[Any]] = {"input": list(rows)}
    for key in next(iter(rows.values())):
        columns[key] = [round(row[key], 2) for row in rows.values()]
    return mf.Table(columns, title=title)


def figures(folder: str | Path, rows: dict[str, dict[str, float]], ratios: dict[str, Array]) -> None:
    """design_inputs.png: the inputs, what they do, and the bounds."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    made = inputs()
    fig = plt.figure(figsize=(9.5, 6.2), layout="constrained")
    grid = fig.add_gridspec(len(made), 2, width_ratios=[1, 1.05])
    for k, (name, de) in enumerate(made.items()):
        here = fig.add_subplot(grid[k, 0])
        here.plot(de.t, MODEL.model(GUESS).simulate(u=de)[0] / DEG, color="0.6", linewidth=1.0)
        here.plot(de.t, de.u[0] / DEG, color=f"C{k}", linewidth=1.2)
        here.set(ylim=(-3.2, 3.2), yticks=[-2, 0, 2], xlim=(0, LENGTH))
        here.set_ylabel(name, rotation=0, ha="right", va="center")
        here.tick_params(labelbottom=k == len(made) - 1)
    here.set_xlabel("time (s);  elevator (colour) and angle of attack (grey), deg")
    right = fig.add_subplot(grid[:, 1])
    width = 0.8 / len(made)
    for k, (name, row) in enumerate(rows.items()):
        at = np.arange(len(GUESS)) + (k - (len(made) - 1) / 2) * width
        right.bar(at, [row[p] for p in GUESS], width, color=f"C{k}", label=name)
        if name in ratios:
            right.plot(at, [row[p] * r for p, r in zip(GUESS, ratios[name], strict=True)], "k_", markersize=6)
    right.plot([], [], "k_", label="maximum likelihood")
    right.set_yscale("log")
    right.set_yticks([0.2, 0.5, 1, 2, 5, 10, 20], ["0.2", "0.5", "1", "2", "5", "10", "20"])
    right.minorticks_off()
    right.set_xticks(range(len(GUESS)), list(GUESS))
    right.set_ylabel("bound on the standard deviation, % of the derivative")
    right.grid(True, axis="y", alpha=0.3)
    right.set_ylim(0.2, 45)
    right.legend(fontsize="small", frameon=False, ncols=2)
    fig.savefig(Path(folder) / "design_inputs.png", dpi=100)


def main(replicates: int = 400, folder: str | Path | None = None) -> tuple[Any, Any, Any]:
    """Both studies; prints their tables and returns them."""
    rows = longitudinal()
    print(table(rows, "Short period: peak of alpha and rms of de, deg; bound in % of each parameter"), "\n")
    ratios = {name: verified(name, replicates) for name in ("doublet", "multisine", "PRBS")}
    for name, ratio in ratios.items():
        shown = "  ".join(f"{p} {r:.2f}" for p, r in zip(GUESS, ratio, strict=True))
        print(f"sd of maximum likelihood over the bound, {name}: {shown}")
    both = lateral()
    print("\n", table(both, "Lateral: peaks of beta and phi, deg; bound in % of each parameter"), sep="")
    if folder is not None:
        figures(folder, rows, ratios)
    return rows, ratios, both


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--figures", help="folder for the figure")
    main(folder=parser.parse_args().figures)
