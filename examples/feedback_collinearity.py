"""The feedback study of the report's section 4.10: how much collinearity the estimates stand.

A plant y'' + 3 y' + 8 y = 5 u under the feedback u = -4 y - 2 y' + r, from y(0) = 1. Without a reference r
the input is a combination of y and y', and nothing can be told apart; the smaller r, the more collinear
are the regressors. For each size of r: collinearity of the worst regressor (the share of it that the others
explain) and the error of the estimates over 200 records, with 5 % noise on y, and on y and u.

    python examples/feedback_collinearity.py [figure.png]
"""

import sys

import modfun as mf
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TRUE = np.array([3.0, 8.0, 5.0])
GAIN = np.array([[4.0, 2.0]])
SIZES = (0.8, 0.5, 0.3, 0.2, 0.14, 0.1, 0.07, 0.05, 0.03)
NOISE = 0.05
DURATION, INTERVALS, RECORDS = 10.0, 256, 200
STRUCTURE = mf.TransferFunction(poles=2, zeros=0)
SHARE, ON_Y, ON_BOTH = "collinearity, %", "error, %: noise on y", "error, %: noise on y and u"


def loop(size: float) -> Array:
    """Noise-free y and u of the closed loop, (2, time)."""
    a, b = np.array([[0.0, 1.0], [-8.0, -3.0]]), np.array([[0.0], [5.0]])
    closed = mf.ss(a - b @ GAIN, b, np.vstack([[1.0, 0.0], -GAIN]), np.array([[0.0], [1.0]]))
    t = np.linspace(0.0, DURATION, INTERVALS + 1)
    return closed.simulate(u=size * np.sin(t**2 / 5), dt=DURATION / INTERVALS, initial_state=[1.0, 0.0])


def error(clean: Array, noise: tuple[float, float], seed: int) -> float:
    """Root mean square error of the estimates over records and parameters, in % of the true values."""
    rng = np.random.default_rng(seed)
    sigma = np.array(noise) * np.sqrt(np.mean(clean**2, axis=1))
    data = clean + sigma[:, None] * rng.normal(size=(RECORDS, *clean.shape))
    many = mf.fit_many(mf.Batch(y=data[:, :1], u=data[:, 1:], dt=DURATION / INTERVALS), STRUCTURE)
    return float(100 * np.sqrt(np.mean((many.params[many.success] / TRUE - 1) ** 2)))


def main(figure: str | None = None) -> mf.Table:
    """The study as a table; its figure to a file, where one is named."""
    columns = {"size of r": list(SIZES), SHARE: [], ON_Y: [], ON_BOTH: []}
    for size in SIZES:
        clean = loop(size)
        record = mf.Record(y=clean[0], u=clean[1], dt=DURATION / INTERVALS)
        shown = mf.collinearity(record, STRUCTURE, band=12.0)
        columns[SHARE].append(shown.table["collinearity"].max())
        columns[ON_Y].append(error(clean, (NOISE, 0.0), seed=1))
        columns[ON_BOTH].append(error(clean, (NOISE, NOISE), seed=1))
    table = mf.Table(columns)
    print(table)
    print("\nThe parameters of the last record, noise-free:")
    print(shown)
    if figure is not None:
        draw(table, figure)
    return table


def draw(table: mf.Table, figure: str) -> None:
    """Error over collinearity, beside what the report says."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    made, ax = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    ax.plot(table[SHARE], table[ON_Y], "o-", label="5 % noise on y")
    ax.plot(table[SHARE], table[ON_BOTH], "s--", label="5 % noise on y and u")
    ax.plot(95, 5, "+", color="0.2", markersize=14, markeredgewidth=1.5, label="the report: 95 %, about 5 %")
    ax.set_yscale("log")
    ax.set_yticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    ax.minorticks_off()
    ax.set_xlabel("collinearity of the worst regressor (%)")
    ax.set_ylabel("error of the estimates (%, rms)")
    ax.grid(True, alpha=0.3)
    ax.legend(frameon=False)
    made.savefig(figure, dpi=120)
    plt.close(made)


if __name__ == "__main__":
    main(*sys.argv[1:2])
