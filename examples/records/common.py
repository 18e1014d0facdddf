"""What the scripts of this folder share: where the records are, their command line, figures."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve()
Place = str | Path | None  # a folder, where one was named
Array = NDArray[np.float64]


class Absent(SystemExit):
    """A record is not there; ends a script with the reason."""


def data(name: str, folder: Place = None) -> Path:
    """Path of a record, such as "tu144_lon_4d/tu144_f20_4d.csv", in the folder of records.

    `folder` defaults to what MODFUN_DATA names, else to ../shared/data beside the repository.
    """
    where = Path(folder or os.environ.get("MODFUN_DATA") or HERE.parents[3] / "shared" / "data")
    if not (where / name).is_file():
        raise Absent(f"record {name} is not in {where}: name the folder of records, or set MODFUN_DATA")
    return where / name


def run(main: Callable[..., Any], doc: str | None) -> None:
    """Call main(folder, figures) with what stands on the command line."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", help="folder of records, default $MODFUN_DATA")
    parser.add_argument("--figures", metavar="DIRECTORY", help="draw the figures of the page there")
    given = parser.parse_args()
    main(given.folder, given.figures)


def panels(rows: int = 1, columns: int = 1, size: tuple[float, float] = (7.0, 4.0), **options: Any) -> Any:
    """A figure of 7 by 4 inches with its axes, drawn without a screen."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt.subplots(rows, columns, figsize=size, layout="constrained", **options)


def save(figure: Any, name: str, figures: Place) -> Path:
    """Write `figure` as records_NAME.png into the folder `figures` and close it."""
    import matplotlib.pyplot as plt

    path = Path(figures or ".") / f"records_{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def estimates(fits: dict[str, Any], names: Any = None) -> Any:
    """A table of fits of one structure: a row each, estimates ± standard errors of these parameters."""
    import modfun as mf

    all_names = next(iter(fits.values())).param_names
    columns = {
        name: [f"{fit[name]:.3f} ± {fit.bse[all_names.index(name)]:.3f}" for fit in fits.values()]
        for name in names or all_names
    }
    return mf.Table({"fit": list(fits)} | columns)


def earlier(rec: Any, channel: str, samples: int = 1) -> Any:
    """The record with a channel taken some samples earlier, and so much shorter."""
    moved = rec.assign(**{channel: np.roll(rec[channel], -samples)})
    return moved.window(rec.t[0], rec.t[-1 - samples])


def lag(rec: Any, channel: str, rate: Any) -> tuple[float, float]:
    """Seconds by which a channel follows the integral of a rate, and the S/E then, dB.

    Offset and slope of their difference do not count: sensors have offsets.
    """
    whole = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2)]) * rec.dt
    inner = slice(10, -10)
    y, t = rec[channel][inner], rec.t[inner]
    found = []
    for late in np.arange(-0.1, 0.1001, 0.001):
        error = y - np.interp(t - late, rec.t, whole)
        error -= np.polyval(np.polyfit(t, error, 1), t)
        found.append((20 * np.log10(np.std(y) / np.std(error)), late))
    level, late = max(found)
    return float(late), float(level)
