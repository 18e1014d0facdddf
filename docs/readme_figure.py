"""Draws the figure of README from README's own first block: python docs/readme_figure.py.

The band is that of the response, not of the samples. For each of its refits the fitted model is simulated
with new noise of the fitted level, and fitted again, with a new initial state. The true response comes from
the same simulation without noise.
"""

import os
import re
import tempfile
from pathlib import Path
from typing import Any

import matplotlib
import modfun as mf
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
REFITS = 400


def code(readme: str) -> str:
    """The first block of Python of README."""
    found = re.search(r"^```python\n(.*?)^```$", readme, re.DOTALL | re.MULTILINE)
    assert found, "README has a block of Python"
    return found[1]


def run(text: str) -> dict[str, Any]:
    """The names that a block makes, run in an empty folder."""
    names: dict[str, Any] = {}
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            exec(text, names)
        finally:
            os.chdir(here)
    return names


def band(fit: mf.Fit, rec: mf.Record) -> tuple[np.ndarray, np.ndarray]:
    """The fitted response and its standard deviation over refits, each of shape (time,)."""
    middle = fit.predict(rec)["y"]
    rng = np.random.default_rng(0)
    tf = mf.TransferFunction(poles=2, zeros=0)
    refits = []
    for _ in range(REFITS):
        other = rec.assign(y=middle + fit.sigma * rng.standard_normal(middle.size))
        refits.append(mf.fit(other, tf).predict(other)["y"])
    return middle, np.std(refits, axis=0)


def main() -> None:
    matplotlib.use("Agg")
    from matplotlib import pyplot

    text = code((ROOT / "README.md").read_text(encoding="utf-8"))
    names = run(text)
    rec, fit = names["rec"], names["fit"]
    truth = run(re.sub(r"nsr=[\d.]+", "nsr=0", text.split("fit =")[0]))["rec"]
    middle, sd = band(fit, rec)
    figure, ax = pyplot.subplots(figsize=(8, 3.2), layout="constrained")
    ax.plot(rec.t, rec["y"], ".", color="0.55", markersize=4, label="measured y")
    ax.fill_between(
        rec.t, middle - 1.96 * sd, middle + 1.96 * sd, color="C0", alpha=0.3, lw=0, label="95 % band"
    )
    ax.plot(rec.t, middle, color="C0", lw=1.5, label="fitted model")
    ax.plot(rec.t, truth["y"], "--", color="C3", lw=1.2, label="true response")
    ax.set(xlabel="time, s", ylabel="y", xlim=(0, rec.t[-1]))
    ax.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.15), frameon=False)
    figure.savefig(ROOT / "docs" / "figures" / "readme.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
