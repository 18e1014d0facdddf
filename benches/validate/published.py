"""Benchmarks whose numbers others published, or that were computed elsewhere, beside ours."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterator
from pathlib import Path

import field_benchmark
import modfun as mf
import numpy as np
import problems
from page import Section, absent, limit

FOLDER = problems.FOLDER
Row = tuple[str, str, str, str, str, bool]


def rao_garnier(scale: float) -> Iterator[Row]:
    """Scatter of `ml` with its defaults over the published bound, 10 dB, from rest."""
    problem, given = problems.rao_garnier(), problems.published()["crlb_snr10"]
    count = max(int(4000 * scale), 200)
    theta, unfinished = field_benchmark.studied(problem, "zero", {}, count, 2, seed=71)[0]
    sd = theta.std(axis=0, ddof=1)
    z, error = limit(2 * sd.size), 1 / np.sqrt(2 * count)
    own = problem.bound(field_benchmark.nsr(problem, 10), "zero")
    by = "`make rivals`"
    for k, name in enumerate(problem.names):
        ratio = sd[k] / given[name]
        yield (
            f"Rao–Garnier, 10 dB, {name}: sd, {count:,} records", f"{given[name]:.4g} (bound)", f"{sd[k]:.4g}",
            f"ratio {ratio:.3f} ± {error:.3f}", by, abs(ratio - 1.0) <= 0.02 + z * error,
        )  # fmt: skip
    bias = np.abs(theta.mean(axis=0) - problem.truth) / sd * np.sqrt(count)
    yield "Rao–Garnier, largest bias", "0", f"{bias.max():.1f} errors", "", by, bool(bias.max() <= z)
    yield "Rao–Garnier, not converged", "0", str(int(unfinished)), "", by, unfinished == 0
    gap = max(abs(own[k] / given[name] - 1) for k, name in enumerate(problem.names))
    yield (
        "Rao–Garnier, `mf.crlb` and the stored bound", "derivatives by differences", f"equal to {100 * gap:.1f} %",
        "ours: to 2e-8 those of fourth-order differences", "`tests/python/experiments/test_bounds.py`", gap < 5e-3,
    )  # fmt: skip


def weak_form(scale: float) -> Iterator[Row]:
    """WENDy's three systems at 10 % noise."""
    from fit_studies import Study, response
    from weak_form import WEAK, least_error

    count = max(int(200 * scale), 20)
    for name, (model, w, x0, period, intervals, reference, rhs) in WEAK.items():
        clean = response(rhs(w), x0, period, intervals)
        sigma = 0.1 * np.sqrt(np.mean(clean**2))
        truth = {f"w{k + 1}": value for k, value in enumerate(w)}
        found = Study(model, truth, clean, period / intervals, sigma, (list(model.outputs), None), count)
        errors = np.linalg.norm(found.params - found.truth, axis=1) / np.linalg.norm(w)
        mean, mcse = errors.mean(), errors.std() / np.sqrt(len(errors))
        least = least_error(rhs, w, x0, period, intervals, sigma)
        yield (
            f"{name}, 10 %: mean error, {count} records", f"{reference[1]:g} (WENDy)", f"{mean:.4f} ± {mcse:.4f}",
            f"bound {least:.4f}", "`python benches/nonlinear.py weak`", mean <= reference[1] + 3 * mcse,
        )  # fmt: skip


def tones(scale: float) -> Iterator[Row]:
    """Two close tones beside the stored bound; Marple's record beside what it was made of."""
    import marple
    import sinusoids

    told = json.loads((FOLDER / "sinusoids" / "definition.json").read_text())
    bounds = told["sqrt_CRB_rad_computed_here"]["sigma2=1"]
    pair = sinusoids.Pair(64, (0.12, 0.13), 1.0, (10.0, 5.0), max(int(1000 * scale), 100))
    found = pair.modfun()
    rmse = np.sqrt(np.mean((found.omega - pair.omega) ** 2, axis=0))
    own = np.sqrt(pair.bounds.mean(axis=0))
    for k in range(2):
        yield (
            f"two close tones, ω{k + 1}: root mean square error, rad", f"{bounds[k]:.5f} (bound, 50 phases)",
            f"{rmse[k]:.5f}", f"own bound {own[k]:.5f}", "`python benches/sinusoids.py close`",
            0.85 <= rmse[k] / own[k] <= 1.25,
        )  # fmt: skip
    shown = mf.sinusoids(marple.read(FOLDER), marple.COUNT, dt=1.0)
    turns, errors = shown.omega / (2 * np.pi), shown.bse[: len(shown)] / (2 * np.pi)
    for known in marple.TONES:
        k = int(np.argmin(np.abs(turns - known)))
        away = abs(turns[k] - known) / errors[k]
        yield (
            f"Marple's record, tone at {known:g} turns", f"{known:g}", f"{turns[k]:.4f} ± {errors[k]:.4f}",
            f"{away:.1f} errors", "`python examples/marple.py`", away <= 3,
        )  # fmt: skip


def reductions(scale: float) -> Iterator[Row]:
    """The classic of fourth order and SLICOT's Hankel values."""
    import reduction

    told = json.loads((FOLDER / "mor_classic" / "g4.json").read_text())
    red = mf.reduce(mf.tf(told["num"], told["den"]), 2)
    by = "`python benches/reduction.py reductions hankel`"
    ise, balanced = red.h2_error**2, red.errors["h2"][1] ** 2
    stored = told["bt2"]["ise_impulse"]
    good = abs(balanced / stored - 1) < 1e-8
    yield "classic, 4 to 2 poles: impulse ISE, balanced", f"{stored:.6g}", f"{balanced:.6g}", "", by, good
    yield (
        "classic, 4 to 2 poles: impulse ISE, least known",
        "0.00228187",
        f"{ise:.6g}",
        "",
        by,
        ise < 2.28188e-3,
    )
    gap = np.max(np.abs(red.hankel / np.array(told["hsv"]) - 1))
    yield "classic: Hankel values", "stored", f"equal to {gap:.0e}", "", by, gap < 1e-10
    for name in ("building", "heat", "iss"):
        system, wanted = reduction.slicot(name, FOLDER)
        got = mf.reduce(system, 2, method="balanced").hankel
        count = min(len(got), len(wanted))
        gap = np.max(np.abs(got[:count] - wanted[:count])) / wanted[0]
        good = gap < 1e-9
        yield (
            f"SLICOT {name}: {count} Hankel values",
            "stored",
            f"equal to {gap:.0e} of the largest",
            "",
            by,
            good,
        )


def delays(scale: float) -> Iterator[Row]:
    """Rightmost roots of the example of Yi, Nelson and Ulsoy; the supersonic transport's delay."""
    told = json.loads((FOLDER / "time_delay" / "examples.json").read_text())["YiNelsonUlsoy"]
    plant = mf.timelag.DelaySystem(A={0: told["A0"], told["h"]: told["A1"]})
    roots = plant.poles(20).values
    gap = max(np.abs(roots - complex(*pair)).min() for pair in told["rightmost"])
    by = "`python benches/timelag.py roots`"
    yield (
        "time lag: eight rightmost roots",
        "−1.0119, −1.3990 ± 5.0935i, …",
        f"equal to {gap:.0e}",
        "",
        by,
        gap < 1e-12,
    )
    import supersonic_transport as sst

    with contextlib.redirect_stdout(io.StringIO()):
        fit = mf.fit(sst.read("ytrue_q_dps", FOLDER), sst.LATE)
    for name, true, value in zip(sst.NAMES, sst.TRUTH, fit.params, strict=True):
        off = abs(value / true - 1)
        by = "`python examples/records/supersonic_transport.py`"
        yield (
            f"supersonic transport, noise-free: {name}",
            f"{true:g}",
            f"{value:.5f}",
            f"{100 * off:.2f} %",
            by,
            off < 0.01,
        )


def flights(scale: float) -> Iterator[Row]:
    """Twin Otter beside the model stored with it; EMPS beside its reference."""

    def run(number: str) -> mf.Record:
        path = FOLDER / f"twinotter_lon_{number}" / f"twinotter_lon_{number}.csv"
        return mf.read(path, time="t_s", outputs={"q": "q_dps"}, inputs={"de": "el_deg"})

    fit = mf.fit(run("018"), mf.TransferFunction(poles=2, zeros=1))
    by = "`python examples/records/twin_otter.py`"
    for number, stored, word in (("018", 0.992, "fitted"), ("019", 0.999, "predicted")):
        r2 = float(fit.score(run(number))["r2"][0])
        yield (
            f"Twin Otter, {number}, {word}: R² of q",
            f"{stored:.3f} (SIDPAC)",
            f"{r2:.4f}",
            "",
            by,
            r2 >= stored - 5e-4,
        )
    import emps

    q, velocity, force = emps.read(FOLDER)
    half = q.size // 2
    drive = mf.Equation("M*q'' + Fv*q' + Fc*s + OF = force", outputs=["q"], inputs=["force", "s"])
    rec = emps.record(q[:half], velocity[:half], force[:half])
    found = mf.fit(rec, drive, noise="equation", method="wls", band=(0, 2 * np.pi * emps.TOP))
    reference = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "OF": -3.1648}
    # Intervals, since the errors of a constant have few degrees of freedom.
    for name, value, error, (low, high) in zip(
        found.param_names, found.params, found.bse, found.conf_int(0.9973), strict=True
    ):
        away = abs(value - reference[name]) / error
        yield (
            f"EMPS, {name}, 99.7 % interval", f"{reference[name]:.4g} (IDIM-LS)",
            f"{value:.4g} ± {error:.2g}, {low:.4g} … {high:.4g}", f"{away:.1f} errors",
            "`python examples/emps.py`", low <= reference[name] <= high,
        )  # fmt: skip


def responses(scale: float) -> Iterator[Row]:
    """The simulated structure of two inputs and two outputs."""
    import frequency_response

    made = frequency_response.simulated(FOLDER, 2048, 0.01, seeds=3)
    error = dict(zip(made["method"].tolist(), made["relative error"].tolist(), strict=True))
    others = min(error["Welch, 8 segments"], error["lpm, R = 2, 15 lines"])
    yield (
        "2 × 2 structure, N = 2048, 1 %: relative error", f"{error['Welch, 8 segments']:.2f} (Welch), "
        f"{error['lpm, R = 2, 15 lines']:.2f} (local polynomials)", f"{error['lrm, default']:.3f}", "",
        "`python benches/frequency_response.py`", error["lrm, default"] < others,
    )  # fmt: skip


# What, where it needs.
PARTS = (
    (rao_garnier, "rao_garnier"), (weak_form, ""), (tones, "kay_marple64"), (reductions, "slicot"),
    (delays, "time_delay"), (flights, "emps_est"), (responses, "frf_2x2_simulated"),
)  # fmt: skip

QUOTED = (
    ("Rao–Garnier, 10,000 records, 10 and 20 dB, from rest and in motion", "SRIVC in NumPy 1.003, dsmc 0.988 (fails 59 % in motion)", "sd over bound 1.003–1.005, no failure", "[rivals.md](rivals.md), `make rivals` (an hour)"),
    ("eq. (24), NSR 0.6: median error, %", "on the same records, times ours: SciPy output error 0.96, SRIVC 0.96–0.99, jax-sysid 2.8, pySINDy 5.2", "7.0 (`ml`, no trend)", "[rivals.md](rivals.md), `make rivals`"),
    ("weak form, 5, 10, 20 %, 2,000 records", "WENDy 0.0067–0.161", "0.0067–0.061; within 6 % of the bound but for three rows", "[nonlinear.md](nonlinear.md), `python benches/nonlinear.py weak`"),
    ("Duffing, NSR 0.3: bias, %", "reweighted weak form 10.4", "0.3", "[nonlinear.md](nonlinear.md), `python benches/nonlinear_speed.py`"),
    ("F-16 simulation, published matrices", "finite differences", "13 of 14 entries within 3 errors; the 14th is off in the record itself", "[page](records/f16_simulation.md), `python examples/records/f16_simulation.py`"),
    ("Silverbox, simulated on", "none published for these parameters", "error 0.7 % of the signal", "[nonlinear.md](nonlinear.md), `python examples/silverbox.py`"),
    ("cascaded tanks", "output error 0.039, 0.030", "0.039 ± 0.008, 0.030 ± 0.007", "[nonlinear.md](nonlinear.md), `python examples/tanks.py`"),
    ("64 to 1024 samples, two tones", "Yule–Walker 1.2–26, ESPRIT 1.06–105 times the bound", "`ml` 1.00–1.11 in all cells but the three of 64 samples, 0.64 lines apart, at 10 dB and less: 1.2, 5.8, 9.5", "[sinusoids.md](sinusoids.md), `python benches/sinusoids.py accuracy`"),
    ("classic, Penzl-type and SLICOT systems to 1–20 poles", "balanced truncation", "H2 error never above it, down to 0.42 of it", "[reduction.md](reduction.md), `python benches/reduction.py reductions`"),
    ("DaISy and flight records", "no truth", "predictions and what each record can tell", "[records](records/README.md), `python examples/records/NAME.py`"),
)  # fmt: skip


def section(scale: float = 1.0) -> Section:
    """The section."""
    out = Section("Benchmarks")
    out.say(
        "Numbers that others published, or that were computed elsewhere and stored beside the data, and ours. A row "
        "is ok where ours is as good, or equal as far as its errors tell: a scatter over its bound within 2 % and the "
        "Monte Carlo errors of six parameters, a mean error at most that of the others, an estimate within 3 standard "
        "errors. Definitions and records are no part of the project; their sources stand in its data folder."
    )
    rows, missing = [], []
    for part, needed in PARTS:
        place = FOLDER / needed if needed else Path(".")
        if not place.exists():
            missing.append(absent(place))
            continue
        rows += [(*cells, out.judge(cells[0], bool(good))) for *cells, good in part(scale)]
    out.table(
        ("what", "published", "modfun", "", "more by", "why"), [(*r[:4], r[4], r[5]) for r in rows], left=6
    )
    out.say(*missing)
    out.under("Quoted from other pages, not made again")
    out.say("Each takes minutes to an hour, and has its own command, machine and date in the page named.")
    out.table(("what", "others", "modfun", "where, command"), QUOTED, left=4)
    return out
