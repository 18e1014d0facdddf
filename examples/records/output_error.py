"""Flight records and an arm: `mf.fit` with default options beside output error of the same structure.

Both are scored by the simulated output with initial state and offset of least squares, S/E about the mean in
dB, so that neither has an advantage there. Output error starts from the fit, as it would in practice, or from
the one-shot estimate where that is no good start.

Usage: python examples/records/output_error.py [FOLDER, default $MODFUN_DATA]
"""

import time
from typing import Any

import cd_arm
import common
import f16_simulation
import f18_lateral
import f18_longitudinal
import modfun as mf
import numpy as np
import tu144
import twin_otter
import twin_otter_lateral

DRIFTING = ("Twin Otter 018", "Twin Otter 019", "Twin Otter, lateral", "Tu-144", "F-16")


def cases(folder: common.Place = None) -> dict[str, tuple[mf.Record, Any]]:
    """Records with the structures of their pages."""
    f18 = common.data("f18harv_lon_153b/f18harv_153b.csv", folder)
    longitudinal = mf.read(f18, outputs=f18_longitudinal.OUTPUTS, inputs=["stab_deg"])
    f18 = common.data("f18harv_lat_342l/f18harv_342l.csv", folder)
    lateral = mf.read(f18, outputs=f18_lateral.OUTPUTS, inputs=f18_lateral.INPUTS)
    otter = twin_otter_lateral.read(folder)
    two = mf.TransferFunction(poles=2, denominator="common")
    three = mf.TransferFunction(poles=3, denominator="common")
    return {
        "Twin Otter 018": (twin_otter.read("018", folder), twin_otter.SHORT_PERIOD),
        "Twin Otter 019": (twin_otter.read("019", folder), twin_otter.SHORT_PERIOD),
        "Twin Otter, lateral": (otter, twin_otter_lateral.structure(otter)),
        "F-18, longitudinal, 2 poles": (longitudinal, two),
        "F-18, longitudinal, 3 poles": (longitudinal, three),
        "F-18, lateral, 5 to 13.8 s": (lateral.window(5.0, 13.8), three),
        "F-18, lateral, 12.5 to 22 s": (lateral.window(12.5, 22.0), three),
        "Tu-144": (tu144.read(folder), tu144.LATE),
        "F-16": (f16_simulation.read(folder), f16_simulation.structure()),
        "CD player arm": (cd_arm.read(folder), cd_arm.structure(3)),
    }


def levels(rec: mf.Record, simulated: common.Array) -> common.Array:
    """S/E of each output about the mean, dB."""
    error = rec.y - simulated
    found: common.Array = 20 * np.log10(rec.y.std(axis=1) / error.std(axis=1))
    return found


def beside(rec: mf.Record, structure: Any, trend: str = "auto") -> dict[str, Any]:
    """Default fit and output error: levels, parameters with standard errors, seconds."""
    began = time.perf_counter()
    fit = mf.fit(rec, structure, trend=trend)
    took = time.perf_counter() - began
    own: dict[str, Any] = {"fit": fit, "fit, dB": fit.score()["signal_to_error"], "fit, s": took}
    estimates = dict(zip(fit.param_names, fit.params.tolist(), strict=True))
    found, failed = [], []
    for start in (estimates, None):
        rival = mf.rivals.output_error(structure, trend=fit.trend, start=start, maxiter=300)
        began = time.perf_counter()
        try:
            one = rival.solve(rec)
        except mf.FitError as error:
            failed.append(str(error))
            continue
        det = sum(float(np.linalg.slogdet(cov)[1]) for cov in one.noise_cov)
        found.append((det, one, time.perf_counter() - began))
    own["failed"] = failed
    if found:
        _, own["rival"], own["rival, s"] = min(found, key=lambda one: one[0])
        own["rival, dB"] = levels(rec, own["rival"].simulated[0])
    return own


def table(title: str, records: dict[str, tuple[mf.Record, Any]], found: dict[str, dict[str, Any]]) -> None:
    """Print levels, and then the times that fits took."""
    rows = []
    for name, (rec, _) in records.items():
        one = found[name]
        for k, output in enumerate(rec.outputs):
            rival = f"{one['rival, dB'][k]:.1f}" if "rival" in one else "not settled"
            rows.append([name if k == 0 else "", output, round(one["fit, dB"][k], 1), rival])
    columns = ["record", "output", "fit, dB", "output error, dB"]
    print(f"\n{title}\n{mf.Table(dict(zip(columns, zip(*rows, strict=True), strict=True)))}")
    for name in records:
        one = found[name]
        print(f"{name}: fit {one['fit, s']:.2f} s, output error {one.get('rival, s', np.nan):.2f} s")


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """The tables of the page."""
    records = cases(folder)
    out = {name: beside(*case) for name, case in records.items()}
    table("Default options", records, out)
    some = {name: case for name, case in records.items() if name in DRIFTING}
    drift = {name: beside(*case, trend="linear") for name, case in some.items()}
    table("A drift unknown, too", some, drift)
    for name, one in out.items():
        print(f"\n{name}: {one['fit'].message}; {'; '.join(one['failed'])}")
        if "rival" not in one:
            continue
        params, errors = one["rival"].params, one["rival"].bse
        fit = one["fit"]
        columns = {
            "parameter": list(params),
            "fit": [f"{v:.4g} ± {e:.2g}" for v, e in zip(fit.params, fit.bse, strict=True)],
            "output error": [f"{v:.4g} ± {errors[n]:.2g}" for n, v in params.items()],
        }
        print(mf.Table(columns))
    return {"default": out, "linear": drift}


if __name__ == "__main__":
    common.run(main, __doc__)
