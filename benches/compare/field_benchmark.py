"""The benchmark of the field: Rao and Garnier's system at 10 and 20 dB, against the Cramér–Rao bound."""

import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import modfun as mf
import numpy as np
import problems
from competitors import COMPETITORS, silence

SNR = (10, 20)
WIDE = 78.0  # rad/s: an eighth of the samples, the widest band that the default rule looks at
SLOW = {"SRIVC, NumPy": 2000, "SRIVC, dsmc": 2000, "SRIVC, dsmc, late": 2000}  # records
CHUNK = 125
PREFIX = "field"


def nsr(problem, snr):
    """Noise sd over rms: the definition divides by the standard deviation of the noise-free output."""
    y = problem.record(0, 0.0, "zero").y[0]
    return float(10 ** (-snr / 20) * np.std(y) / np.sqrt(np.mean(y**2)))


def studied(problem, state, options, count, threads, seed=1):
    """[(θ (record, parameter), how many did not converge)] of modfun for each SNR, in threads."""
    warnings.simplefilter("ignore")
    study = mf.MonteCarlo(
        system=problem.system, **problem.experiment, nsr=[nsr(problem, snr) for snr in SNR],
        initial_state=state, estimators={"ml": mf.Estimator(problem.model, **options)},
        replicates=count, seed=seed,
    )  # fmt: skip
    found = study.run(threads=threads, keep="samples", progress=False)
    unfinished = count - np.ravel(found.status["ok"])
    return list(zip(np.reshape(found.samples, (len(SNR), count, -1)), unfinished, strict=True))


def chunk(name, state, snr, first, count):
    """θ of a rival on some records."""
    problem = problems.rao_garnier()
    estimate = next(who for who in COMPETITORS if who.name == name).make(problem)
    level = nsr(problem, snr)
    records = [problem.record(k, level, state) for k in range(first, first + count)]
    with silence():
        if hasattr(estimate, "many"):
            return estimate.many(records)
        found = np.full((count, problem.truth.size), np.nan)
        for k, rec in enumerate(records):
            try:
                found[k] = estimate(rec)
            except ArithmeticError:
                continue
        return found


def figures(problem, theta, unfinished):
    """What is kept of a cell: mean and sd are those of the records that did not fail.

    A fit of modfun that did not converge gives its last values, which may or may not be off.
    """
    failed = problem.failed(theta)
    good = theta[~failed]
    return {
        "records": len(theta),
        "unfinished": int(unfinished),
        "off": int(failed.sum() - np.isnan(theta).any(axis=1).sum()),
        "mean": good.mean(axis=0).tolist(),
        "sd": good.std(axis=0, ddof=1).tolist(),
    }


def run(count, workers, kept, save, quick=False):
    """{who|snr|state: figures}; None without the definition file."""
    if not problems.DEFINITION.exists():
        return None
    problem = problems.rao_garnier()
    own = {
        "ml": {}, "ml, again": {}, "ml, trend=None": {"trend": None}, "ml, band to 78 rad/s": {"band": WIDE}
    }  # fmt: skip
    names = list(own) if quick else [*own, "SRIVC, NumPy"]
    if not quick and next(who for who in COMPETITORS if who.package == "dsmc").missing() is None:
        names += ["SRIVC, dsmc", "SRIVC, dsmc, late"]
    wanted = [(name, state) for name in names for state in problems.STATES]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for name, state in wanted:
            keys = [f"{PREFIX}|{name}|{snr}|{state}" for snr in SNR]
            if all(key in kept for key in keys):
                continue
            records = min(count, SLOW.get(name, count))
            if name in own:
                seed = 2 if name == "ml, again" else 1
                thetas = studied(problem, state, own[name], records, workers, seed)
            else:
                starts = range(0, records, CHUNK)
                parts = [
                    [pool.submit(chunk, name, state, snr, k, min(CHUNK, records - k)) for k in starts]
                    for snr in SNR
                ]
                thetas = [np.vstack([part.result() for part in some]) for some in parts]
                thetas = [(theta, np.isnan(theta).any(axis=1).sum()) for theta in thetas]
            for key, (theta, unfinished) in zip(keys, thetas, strict=True):
                kept[key] = figures(problem, theta, unfinished)
            save()
    return {
        f"{name}|{snr}|{state}": kept[f"{PREFIX}|{name}|{snr}|{state}"]
        for name, state in wanted for snr in SNR
    }  # fmt: skip
