"""Tables and figures of docs/reduction.md: reduced models beside balanced truncation, with processor times.

Usage: python benches/reduction.py [table ...] [--data DIRECTORY] [--figures DIRECTORY]
"""

import argparse
import json
import os
import time
from pathlib import Path

import modfun as mf
import numpy as np
from scipy import sparse

DATA = Path(os.environ.get("MODFUN_DATA", Path(__file__).parents[2] / "shared" / "data"))


def penzl():
    """Penzl's example with 200 instead of 1,000 real modes: three light pairs above a heap of real poles."""
    a = np.zeros((206, 206))
    for k, w in enumerate((100, 200, 400)):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-1, w], [-w, -1]]
    a[6:, 6:] = -np.diag(np.arange(1.0, 201))
    b = np.concatenate([10 * np.ones(6), np.ones(200)])
    return a, b, b


def slicot(name, data):
    held = np.load(data / "slicot" / f"{name}.npz")
    n = max(held["B"].shape)
    a = sparse.coo_matrix((held["A_val"], (held["A_row"], held["A_col"])), shape=(n, n))
    return (a, held["B"].reshape(n, -1), held["C"].reshape(-1, n)), np.sort(held["hsv"].ravel())[::-1]


def classic(data):
    held = json.loads((data / "mor_classic" / "g4.json").read_text(encoding="utf-8"))
    return mf.tf(held["num"], held["den"]), np.array(held["hsv"])


def heat(n):
    """A rod of n cells, heated at one third, measured at two thirds; sparse."""
    ones = np.ones(n) * (n + 1.0) ** 2
    a = sparse.diags([ones[1:], -2 * ones, ones[1:]], [-1, 0, 1], format="csc")
    b, c = np.zeros((n, 1)), np.zeros((1, n))
    b[n // 3, 0], c[0, 2 * n // 3] = n + 1.0, 1.0
    return a, b, c


def head(*names):
    print("| " + " | ".join(names) + " |")
    print("|" + "---|" * len(names), flush=True)


def timed(given, *args, **options):
    start = time.process_time()
    red = mf.reduce(given, *args, **options)
    return red, time.process_time() - start


def reductions(data, _):
    """Errors relative to the system's norms: balanced truncation, weight="h2", weight="flat"."""
    head(
        "system",
        "order",
        "H2: balanced",
        "h2",
        "flat",
        "H∞: balanced",
        "h2 ",
        "flat ",
        "bound",
        "h2, s",
        "flat, s",
    )
    rows = [("classic", classic(data)[0], (1, 2, 3)), ("Penzl-type, 206", penzl(), (4, 10))]
    rows += [("building, 48", slicot("building", data)[0], (2, 4, 6, 10, 20))]
    rows += [("heat, 200", slicot("heat", data)[0], (2, 4, 6))]
    rows += [("iss, 270, 3×3", slicot("iss", data)[0], (2, 4, 6, 10, 20))]
    for name, given, orders in rows:
        for order in orders:
            h2, first = timed(given, order)
            flat, second = timed(given, order, weight="flat")
            size = h2.errors["hinf"][1] / h2.errors["hinf_relative"][1]
            sizes = [
                *(h2.errors["h2_relative"][[1, 0]]),
                flat.errors["h2_relative"][0],
                *(h2.errors["hinf_relative"][[1, 0]]),
                flat.errors["hinf_relative"][0],
                h2.bound / size,
            ]
            cells = " | ".join(f"{value:.4g}" for value in sizes)
            print(f"| {name} | {order} | {cells} | {first:.2f} | {second:.2f} |", flush=True)


def hankel(data, _):
    """Hankel singular values beside the stored ones: largest difference over the largest value."""
    head("system", "states", "largest three", "largest difference")
    stored = [("classic", *classic(data))] + [(n, *slicot(n, data)) for n in ("building", "heat", "iss")]
    for name, given, values in stored:
        found = mf.reduce(given, 2, method="balanced").hankel
        count = min(found.size, values.size)
        worst = np.max(np.abs(found[:count] - values[:count])) / values[0]
        three = ", ".join(f"{value:.5g}" for value in found[:3])
        print(f"| {name} | {values.size} | {three} | {worst:.1e} |", flush=True)


def weights(data, _):
    """The classic to two poles by each weight: errors relative to the system's norms."""
    head("weight", "H2", "H∞", "largest relative error", "impulse ISE")
    system = classic(data)[0]
    tf2 = mf.TransferFunction(poles=2, zeros=1)
    rows = [(f'"{word}"', mf.reduce(system, tf2, weight=word)) for word in ("h2", "flat", "relative")]
    rows += [
        ('"h2", dcgain=True', mf.reduce(system, tf2, dcgain=True)),
        ('"h2", two poles, no zero', mf.reduce(system, mf.TransferFunction(poles=2, zeros=0))),
        ("balanced truncation", mf.reduce(system, tf2, method="balanced")),
    ]
    for name, red in rows:
        e = red.errors
        cells = " | ".join(f"{e[key][0]:.4g}" for key in ("h2_relative", "hinf_relative", "largest_relative"))
        print(f"| {name} | {cells} | {red.h2_error**2:.6g} |", flush=True)


def large(_, __):
    """Time for large systems to order 10: the rod (sparse), random dense ones."""
    head("system", "states", "relative H2: balanced", "this", "s")
    rng = np.random.default_rng(0)
    rows = [("rod, sparse", heat(n)) for n in (2_500, 10_000, 100_000)]
    for n in (500, 1000, 2000):
        a = rng.normal(size=(n, n)) / np.sqrt(n) - 1.2 * np.eye(n)
        rows.append(("random, dense, 2×2", (a, rng.normal(size=(n, 2)), rng.normal(size=(2, n)))))
    for name, given in rows:
        red, seconds = timed(given, 10)
        values = red.errors["h2_relative"]
        print(
            f"| {name} | {given[0].shape[0]} | {values[1]:.4g} | {values[0]:.4g} | {seconds:.1f} |",
            flush=True,
        )


def figures(data, folder):
    """building to 10 poles, by "h2" and by "flat"; the Hankel singular values."""
    if folder is None:
        return
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    given, _ = slicot("building", data)
    fig, axes = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    for axis, weight in zip(axes, ("h2", "flat"), strict=True):
        red = mf.reduce(given, 10, weight=weight)
        red.plot(ax=axis)
        axis.set(title=f'building, 48 states to 10, weight="{weight}"', xlim=(1, 200), ylim=(1e-6, 1e-2))
    axes[0].set_xlabel("")
    fig.savefig(Path(folder) / "reduction_building.png", dpi=110)
    plt.close(fig)
    fig, axis = plt.subplots(figsize=(7, 3), layout="constrained")
    for name, shape in (("building", "o"), ("heat", "s"), ("iss", "^")):
        values = mf.reduce(slicot(name, data)[0], 2, method="balanced").hankel[:40]
        axis.semilogy(np.arange(1, values.size + 1), values / values[0], shape, ms=3, label=name)
    axis.set(xlabel="order", ylabel="Hankel singular value / largest", ylim=(1e-12, 2))
    axis.legend()
    fig.savefig(Path(folder) / "reduction_hankel.png", dpi=110)
    plt.close(fig)


TABLES = {one.__name__: one for one in (reductions, hankel, weights, large, figures)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", default=list(TABLES), metavar="table", help=", ".join(TABLES))
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--figures", help="directory for figures")
    given = parser.parse_args()
    load = os.getloadavg()[0]
    for name in given.tables:
        print(f"\n## {name}, load of the machine {load:.1f}\n\n{TABLES[name].__doc__}\n", flush=True)
        TABLES[name](given.data, given.figures)


if __name__ == "__main__":
    main()
