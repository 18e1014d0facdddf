"""Streams: every table of docs/stream.md, and its figure with --figures.

    python benches/stream.py [speed drift jump] [--figures docs/figures]

`speed` is of this machine; run it when nothing else does.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import modfun as mf
import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "examples"))

import follow_change
from fit_studies import table

DT = 0.02
TF2 = mf.TransferFunction(poles=2, zeros=0)


def record(count: int) -> mf.Record:
    """Six tones through the report's system, noise 10 %."""
    t = DT * np.arange(count)
    omega = np.array([0.6, 1.3, 2.1, 3.3, 4.7, 6.1])
    u = np.sin(omega[:, None] * t + np.arange(6)[:, None]).sum(axis=0) / 2
    system = mf.tf([5], [1, 3, 8])
    return mf.simulate(system, input=u, duration=DT * (count - 1), intervals=count - 1, nsr=0.1, seed=1)


def spent(call, samples: int) -> float:
    """Least time of three calls over the samples, µs."""
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / samples


def speed() -> None:
    """µs a sample by number of lines, window 10 s of 500 samples, two channels."""
    print(f"load {os.getloadavg()[0]:.1f}")
    table("M", "push, a block | push, one by one | follow: estimate every sample | one estimate | fit() |")
    rec = record(5001)
    few = rec.window(0.0, 40.0)
    pairs = list(zip(few.y[0].tolist(), few.u[0].tolist(), strict=True))
    for harmonics in (8, 15, 30, 60):
        live = mf.Stream(mf.Estimator(TF2, harmonics=harmonics), dt=DT, window=10.0)

        def one_by_one(live: mf.Stream = live) -> None:
            for y, u in pairs:
                live.push(y=y, u=u)

        def asked(live: mf.Stream = live) -> None:
            for y, u in pairs[:200]:
                live.push(y=y, u=u)
                _ = live.params

        block = spent(lambda live=live: live.push(rec.y, rec.u), 5001)
        single = spent(one_by_one, len(pairs))
        followed = spent(lambda live=live: live.follow(rec, progress=False), 5001)
        estimate = spent(asked, 200) - single
        fit = spent(lambda live=live: [live.fit() for _ in range(50)], 50)
        print(f"| {harmonics} | {block:.2f} | {single:.1f} | {followed:.1f} | {estimate:.0f} | {fit:.0f} |")


def drift() -> None:
    """Largest relative difference from a batch fit of the window after many samples."""
    table("samples", "of the estimate | of its standard errors |")
    rng = np.random.default_rng(0)
    live = mf.Stream(mf.Estimator(TF2, harmonics=28), dt=DT, window=10.0)
    block, rec = rng.standard_normal((2, 89_999)), record(10_001)
    for wanted in (100_000, 1_000_000, 10_000_000):
        while live.count < wanted:
            live.push(*block)
            live.push(rec.y, rec.u)
        batch = mf.fit(live.record(), TF2, harmonics=28)
        off = np.abs(live.params / batch.params - 1).max()
        errors = np.abs(live.bse / batch.bse - 1).max()
        print(f"| {live.count:,} | {off:.0e} | {errors:.0e} |")


def jump(figures: Path | None) -> None:
    """The example's change of a mode: when estimates have followed it."""
    tracks = follow_change.main()
    table("memory", "natural frequency before | 2 s after | one window after | at the end | standard error |")
    for name, track in tracks.items():
        values = track.params[:, 1] ** 0.5
        error = track.bse[:, 1] / (2 * values)
        at = [int(np.argmin(np.abs(track.t - t))) for t in (29.9, 32.0, 38.02, 60.0)]
        cells = " | ".join(f"{values[k]:.3f}" for k in at)
        print(f"| {name} | {cells} | {error[at[-1]]:.3f} |")
    if figures:
        draw(tracks, figures)


def draw(tracks: dict[str, mf.Track], figures: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, ax = plt.subplots(figsize=(7, 3.4), layout="constrained")
    for color, (name, track) in enumerate(tracks.items()):
        values = np.where(track.success, track.params[:, 1], np.nan) ** 0.5
        half = track.bse[:, 1] / values  # two standard errors of the root
        ax.fill_between(track.t, values - half, values + half, color=f"C{color}", alpha=0.2, linewidth=0)
        ax.plot(track.t, values, f"C{color}", label=name, linewidth=1.2)
    ends, truth = (0, 30, 30, 60), np.array([follow_change.BEFORE, follow_change.AFTER])
    ax.plot(ends, np.repeat(truth, 2), "k:", linewidth=1, label="truth")
    ax.axvspan(30, 38, color="0.92", zorder=0)
    ax.set(xlabel="time (s)", ylabel="natural frequency (rad/s)", xlim=(8, 60), ylim=(1.4, 3.1))
    ax.grid(True, alpha=0.3)
    ax.legend(loc="lower left", frameon=False)
    fig.savefig(figures / "stream_jump.png", dpi=110)
    plt.close(fig)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("parts", nargs="*", default=["speed", "drift", "jump"])
    parser.add_argument("--figures", type=Path)
    given = parser.parse_args()
    if "speed" in given.parts:
        speed()
    if "drift" in given.parts:
        drift()
    if "jump" in given.parts:
        jump(given.figures)


if __name__ == "__main__":
    main()
