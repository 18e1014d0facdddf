"""Sinusoids in noise beside the Cramér–Rao bound and two classics: the tables of docs/sinusoids.md.

Usage: python benches/sinusoids.py [study ...] [--replicates 1000] [--figures DIRECTORY]
"""

import argparse
import os
import sys
import time
from pathlib import Path

import modfun as mf
import numpy as np

sys.path.append(str(Path(__file__).parent / "compare" / "rivals"))
sys.path.append(str(Path(__file__).parents[1] / "tests" / "python"))

from hoyw_esprit import esprit, hoyw
from oracle import tones as oracle

FAR = 5.0  # bounds beyond which an error is counted as an outlier
SLOW = 100  # records for the classics where they take long
LINES = (2, 3, 4, 6, 9, 12, 18)


class Pair:
    """Records of two tones with random phases in white noise; frequencies in turns a sample."""

    def __init__(self, n, frequencies, variance, amplitudes=(1.0, 1.0), replicates=1000, seed=1):
        rng = np.random.default_rng(seed)
        self.n, self.omega = n, 2 * np.pi * np.asarray(frequencies)
        self.amplitudes, self.variance = amplitudes, variance
        self.phases = rng.uniform(-np.pi, np.pi, (replicates, 2))
        clean = np.array([oracle.waves(self.omega, amplitudes, p, n) for p in self.phases])
        self.y = clean + np.sqrt(variance) * rng.standard_normal(clean.shape)
        self.bounds = np.array([self.bound(p) for p in self.phases])

    def bound(self, phases):
        """Variances of an unbiased estimate of both frequencies, amplitudes and phases unknown."""
        return np.diag(oracle.bound(self.omega, self.amplitudes, phases, self.variance, self.n))[:2]

    def ratio(self, found):
        """Root mean square error over that of the bound."""
        errors = np.where(np.isfinite(found), found, np.pi / 2) - self.omega
        return float(np.sqrt(np.mean(errors**2) / np.mean(self.bounds[: len(found)])))

    def outliers(self, found):
        """Part of the records with a tone further off than FAR bounds."""
        errors = np.abs(np.where(np.isfinite(found), found, np.pi) - self.omega)
        return float(np.mean(np.any(errors > FAR * np.sqrt(self.bounds[: len(found)]), axis=1)))

    def modfun(self, **options):
        return mf.sinusoids(mf.Batch(y=self.y, dt=1.0), 2, progress=False, **options)


def db(snr, amplitude=1.0):
    """Noise variance at a signal-to-noise ratio of each tone."""
    return amplitude**2 / 2 / 10 ** (snr / 10)


def head(*columns):
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns), flush=True)


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def estimates(pair, some=None):
    """Frequencies by modfun's two methods and the classics; ESPRIT's window is the better of two."""
    half, less = (
        np.array([esprit(y, 2, size) for y in pair.y[:some]]) for size in (pair.n // 2, 2 * pair.n // 5)
    )
    return {
        "ml": pair.modfun().omega,
        "awls": pair.modfun(method="awls").omega,
        "HOYW": np.array([hoyw(y, 2, pair.n // 4, pair.n // 2) for y in pair.y[:some]]),
        "ESPRIT": min(half, less, key=pair.ratio),
    }


CELLS = [
    (64, (0.20, 0.22)),
    (64, (0.20, 0.21)),
    (64, (0.10, 0.20)),
    (256, (0.10, 0.12)),
    (256, (0.10, 0.103)),
    (1024, (0.10, 0.12)),
    (1024, (0.10, 0.1008)),
]


def accuracy(replicates):
    """RMSE over the bound by record length, spacing and noise; classics of 1024 samples on 100 records."""
    head(
        "n",
        "frequencies",
        "spacing, lines",
        "dB",
        "ml",
        "awls",
        "HOYW",
        "ESPRIT",
        "outliers of ml, HOYW, ESPRIT",
    )
    for n, frequencies in CELLS:
        for snr in (20, 10, 5, 0):
            pair = Pair(n, frequencies, db(snr), replicates=replicates)
            found = estimates(pair, SLOW if n > 256 else None)
            ratios = {name: pair.ratio(f) for name, f in found.items()}
            far = [f"{100 * pair.outliers(found[name]):.1f}" for name in ("ml", "HOYW", "ESPRIT")]
            spacing = f"{n * (frequencies[1] - frequencies[0]):.2g}"
            cells = [f"{r:.2f}" if r < 100 else f"{r:.0f}" for r in ratios.values()]
            row(n, ", ".join(map(str, frequencies)), spacing, snr, *cells, " / ".join(far) + " %")


def close(replicates):
    """The shared problem: 10 sin(.24 pi t + p1) + 5 sin(.26 pi t + p2), 64 samples, HOYW with L = M = 20."""
    head("noise variance", "√bound, 10⁻³", "ml", "awls", "HOYW, L = M = 20", "ESPRIT", "RMSE of ml, 10⁻³")
    for variance in (1.0, 4.0, 10.0):
        pair = Pair(64, (0.12, 0.13), variance, (10.0, 5.0), replicates)
        bound = 1e3 * np.sqrt(pair.bounds.mean(axis=0))
        found = estimates(pair) | {"HOYW": np.array([hoyw(y, 2, 20, 20) for y in pair.y])}
        rms = 1e3 * np.sqrt(np.mean((found["ml"] - pair.omega) ** 2, axis=0))
        cells = [f"{pair.ratio(f):.2f}" for f in found.values()]
        row(f"{variance:g}", f"{bound[0]:.2f}, {bound[1]:.2f}", *cells, f"{rms[0]:.2f}, {rms[1]:.2f}")


def lines(replicates):
    """How many lines on each side of a tone."""
    problems = {
        "64: .20, .22, 10 dB": Pair(64, (0.20, 0.22), db(10), replicates=replicates),
        "256: .10, .12, 10 dB": Pair(256, (0.10, 0.12), db(10), replicates=replicates),
        "1024: .10, .12, 0 dB": Pair(1024, (0.10, 0.12), db(0), replicates=replicates),
    }
    head("n, frequencies, noise", "method", *(f"±{h}" for h in LINES), "samples")
    for name, pair in problems.items():
        for method in ("awls", "ml"):
            cells = [f"{pair.ratio(pair.modfun(method=method, lines=h).omega):.2f}" for h in LINES]
            row(
                name,
                f"`{method}`",
                *cells,
                f"{pair.ratio(pair.modfun().omega):.2f}" if method == "ml" else "",
            )


def coverage(replicates):
    """Coverage of 95 % intervals of all parameters."""
    head("tones", "noise", "omega", "damping", "amplitude", "phase", "not ok")
    rng = np.random.default_rng(3)
    k = np.arange(256)
    cases = [
        ("256: .10, .12, 10 dB", (0.10, 0.12), (0, 0), 10, "white", {}),
        ("256: .10, .12, 0 dB", (0.10, 0.12), (0, 0), 0, "white", {}),
        ("256: .10, .103, 10 dB", (0.10, 0.103), (0, 0), 10, "white", {}),
        ("256: .10, .12, decaying by 1 and 3 e-folds, 10 dB", (0.10, 0.12), (1, 3), 10, "white", {}),
        ("256: .05, .40, 10 dB", (0.05, 0.40), (0, 0), 10, "AR(1), pole .8", {}),
        ("256: .05, .40, 10 dB, `lines=9`", (0.05, 0.40), (0, 0), 10, "AR(1), pole .8", {"lines": 9}),
    ]
    for name, frequencies, folds, snr, noise, options in cases:
        omega, damping = 2 * np.pi * np.array(frequencies), np.array(folds) / 256
        phases = rng.uniform(-np.pi, np.pi, (replicates, 2))
        clean = np.array([oracle.waves(omega, [1, 1], p, 256, damping) for p in phases])
        e = np.sqrt(db(snr)) * rng.standard_normal((replicates, 256 + 100))
        if noise != "white":
            for j in range(1, e.shape[1]):
                e[:, j] = 0.8 * e[:, j - 1] + 0.6 * e[:, j]
        damped = any(folds)
        batch = mf.Batch(y=clean + e[:, -k.size :], dt=1.0)
        found = mf.sinusoids(batch, 2, damped=damped, progress=False, **options)
        truth = [np.tile(omega, (replicates, 1)), np.ones((replicates, 2)), phases]
        if damped:
            truth.insert(1, np.tile(damping, (replicates, 1)))
        errors = found.params - np.hstack(truth)
        errors[:, -2:] = np.angle(np.exp(1j * errors[:, -2:]))
        inside = np.mean(np.abs(errors) < 1.96 * found.bse, axis=0).reshape(-1, 2)
        cells = ["–".join(f"{100 * c:.1f}" for c in pair) for pair in inside]
        if not damped:
            cells.insert(1, "")
        row(name, noise, *cells, int(np.sum(~found.success)))


def counts(replicates):
    """The rate at which the right number of tones is chosen, and of too many."""
    head("n", "tones", "20 dB", "10 dB", "0 dB")
    rng = np.random.default_rng(5)
    sets = {
        "none": lambda n: (),
        "one": lambda n: (0.2,),
        "two, 1.3 lines apart": lambda n: (0.2, 0.2 + 1.3 / n),
        "two, .8 lines apart": lambda n: (0.2, 0.2 + 0.8 / n),
        "four": lambda n: (0.07, 0.15, 0.28, 0.41),
    }
    for n in (64, 256):
        for name, frequencies in sets.items():
            cells = []
            for snr in (20, 10, 0):
                omega = 2 * np.pi * np.array(frequencies(n))
                phases = rng.uniform(-np.pi, np.pi, (replicates, omega.size))
                y = np.sqrt(db(snr)) * rng.standard_normal((replicates, n))
                if omega.size:
                    y += np.array([oracle.waves(omega, np.ones(omega.size), p, n) for p in phases])
                chosen = mf.sinusoids(mf.Batch(y=y, dt=1.0), most=6, progress=False).count
                right, more = np.mean(chosen == omega.size), np.mean(chosen > omega.size)
                cells.append(f"{100 * right:.1f} ({100 * more:.1f})")
            row(n, name, *cells)


def search(replicates):
    """Whether a grid of all pairs, each of the best five refined, finds a lower cost."""
    head("n", "frequencies", "dB", "records", "lower on the grid", "of these with tones that run together")
    some = min(replicates, 200)
    for n, frequencies, snr in ((64, (0.20, 0.22), 0), (64, (0.20, 0.21), 5), (64, (0.20, 0.21), 0)):
        pair = Pair(n, frequencies, db(snr), replicates=some)
        found = pair.modfun()
        missed = together = 0
        for y, cost in zip(pair.y, found.cost, strict=True):
            omega, best = oracle.best_pair(y, 4 * n)
            missed += cost > best * (1 + 1e-6)
            together += cost > best * (1 + 1e-6) and omega[1] - omega[0] < 0.1 * 2 * np.pi / n
        row(n, ", ".join(map(str, frequencies)), snr, some, missed, together)


def timed(call, data, records):
    """Milliseconds of processor time a record."""
    start = time.process_time()
    call(data)
    return f"{1e3 * (time.process_time() - start) / records:.2f}"


def speed(replicates):
    """Processor time a record, one thread."""
    head("n", "ml, ms", "awls, ms", "count chosen (most 6), ms", "HOYW, ms", "ESPRIT, ms")
    for n in (64, 256, 1024):
        pair = Pair(n, (0.10, 0.10 + 2 / n), db(10), replicates=min(replicates, 50))
        few = pair.y[:10]
        batch = mf.Batch(y=pair.y, dt=1.0)

        one = {"threads": 1, "progress": False}
        cells = [
            timed(lambda b, o=options: mf.sinusoids(b, 2, **o), batch, len(pair.y))
            for options in (one, one | {"method": "awls"})
        ]
        cells.append(timed(lambda b, o=one: mf.sinusoids(b, most=6, **o), batch, len(pair.y)))
        cells.append(timed(lambda ys: [hoyw(y, 2, y.size // 4, y.size // 2) for y in ys], few, len(few)))
        cells.append(timed(lambda ys: [esprit(y, 2) for y in ys], few, len(few)))
        row(n, *cells)
    print(f"\nload {os.getloadavg()[0]:.1f}")


STUDIES = {f.__name__: f for f in (accuracy, close, lines, coverage, counts, search, speed)}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("studies", nargs="*", choices=[*STUDIES, []])
    parser.add_argument("--replicates", type=int, default=1000)
    parser.add_argument("--figures", type=Path)
    options = parser.parse_args(arguments)
    for name in options.studies or ([] if options.figures else STUDIES):
        print(f"\n## {name}: {STUDIES[name].__doc__}\n")
        STUDIES[name](options.replicates)
    if options.figures:
        import sinusoids_figures

        sinusoids_figures.main(options.figures, options.replicates)


if __name__ == "__main__":
    main()
