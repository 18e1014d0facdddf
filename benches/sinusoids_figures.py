"""Figures of docs/sinusoids.md.

Usage: python benches/sinusoids.py --figures FOLDER
"""

import os
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
sys.path.append(str(Path(__file__).parents[1] / "examples"))

import marple
import numpy as np
from matplotlib import pyplot as plt
from sinusoids import Pair, db, estimates

LEVELS = np.arange(-6, 31, 3)
SHOWN = {"ml": ("C3", "o"), "awls": ("C0", "s"), "HOYW": ("0.6", "v"), "ESPRIT": ("C2", "^")}


def accuracy(path, replicates):
    """Root mean square errors over the bound against noise, two problems."""
    problems = {
        "64 samples, 0.20 and 0.22": (64, (0.20, 0.22)),
        "256 samples, 0.10 and 0.12": (256, (0.10, 0.12)),
    }
    fig, axes = plt.subplots(1, 2, figsize=(8.4, 3.4), sharey=True, layout="constrained")
    for ax, (title, (n, frequencies)) in zip(axes, problems.items(), strict=True):
        ratios = {name: [] for name in SHOWN}
        for snr in LEVELS:
            pair = Pair(n, frequencies, db(snr), replicates=replicates)
            for name, found in estimates(pair).items():
                ratios[name].append(pair.ratio(found))
        for name, (color, marker) in SHOWN.items():
            ax.semilogy(LEVELS, ratios[name], color=color, marker=marker, ms=4, lw=1.2, label=name)
        ax.axhline(1, color="k", lw=0.8, ls=":")
        ax.set(title=title, xlabel="signal to noise, each tone (dB)", ylim=(0.8, 60))
        ax.set_yticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
        ax.grid(True, alpha=0.3)
    axes[0].set_ylabel("rms error over Cramér–Rao bound")
    axes[0].legend(frameon=False)
    fig.savefig(path, dpi=110)
    plt.close(fig)


def record(path):
    """Marple's record: its spectrum, what the tones leave, and the tones."""
    found = marple.main(Path(os.environ["MODFUN_DATA"]))
    fig, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
    found.plot(ax=ax, hz=True)
    for f in marple.TONES:
        ax.axvline(f, color="k", lw=0.7, ls=":")
    ax.set(title="Marple's 64 samples; dotted: the four tones it was made of", ylim=(-60, 5))
    ax.set_xlabel("frequency (turns a sample)")
    fig.savefig(path, dpi=110)
    plt.close(fig)


def main(folder, replicates):
    accuracy(folder / "sinusoids.png", replicates)
    record(folder / "marple.png")
