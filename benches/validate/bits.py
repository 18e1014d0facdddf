"""The same bits whoever computes: SHA-256 of studies over threads, processes, instruction sets, shards."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import modfun as mf
import numpy as np
from modfun.study import work
from page import Section

FIGURES = (
    "bias", "bias_mcse", "sd", "sd_mcse", "rmse", "rmse_mcse", "median", "median_mcse", "coverage",
    "coverage_mcse", "failures", "nit", "samples",
)  # fmt: skip
REPLICATES = 16_000
JOINT = 12  # times fewer of these

work.PART = 1.0  # the smallest parts, of 512 replicates, so that there are several


def linear(replicates: int) -> mf.MonteCarlo:
    """The compiled path: two systems, two noise levels, three methods, random initial states."""
    return mf.MonteCarlo(
        system={"eq24": mf.tf([5], [1, 3, 8]), "one": mf.tf([1], [1, 1])}, input="sin(t**2/5)", duration=10.0,
        intervals=128, nsr=[0.1, 0.4], initial_state="random", estimators=["ls", "awls", "ml"], harmonics=6,
        replicates=replicates, seed=11,
    )  # fmt: skip


def joint(replicates: int) -> mf.MonteCarlo:
    """Two inputs, coloured noise fitted: fits made one by one."""
    system = mf.tf([[[1, 2], [3]]], [1, 1.2, 4])
    structure = mf.TransferFunction(poles=2, zeros=[[1, 0]])
    return mf.MonteCarlo(
        system=system, input=["sin(t**2/6)", "cos((20 - t)**2/5)"], duration=20.0, intervals=400, nsr=[0.1],
        estimators={"coloured": mf.Estimator(structure, noise="coloured", band=6.0)},
        replicates=replicates // JOINT, seed=12,
    )  # fmt: skip


STUDIES = {"linear": linear, "joint": joint}


def digest(results: mf.Results) -> str:
    """SHA-256 over every figure and estimate."""
    found = hashlib.sha256()
    for name in FIGURES:
        found.update(np.ascontiguousarray(getattr(results, name)).tobytes())
    return found.hexdigest()


def made(name: str, replicates: int, **options: object) -> str:
    """Digest of a study run in some way."""
    return digest(STUDIES[name](replicates).run(keep="samples", progress=False, **options))


def batch(threads: int, replicates: int = 2000) -> str:
    """Digest of `fit_many` of records with noise from NumPy."""
    clean = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    noise = 0.1 * np.random.default_rng(5).standard_normal((replicates, 1, 257))
    records = mf.Batch(y=clean.y + noise, u=clean.u, dt=clean.dt)
    fits = mf.fit_many(records, mf.TransferFunction(poles=2, zeros=0), threads=threads, progress=False)
    return hashlib.sha256(fits.params.tobytes() + fits.bse.tobytes()).hexdigest()


def elsewhere(*words: str, **environment: str) -> str:
    """What this file prints when run with words; "" where the processor has not what was asked for."""
    done = subprocess.run(
        [sys.executable, __file__, *words], env=os.environ | environment, capture_output=True, text=True
    )
    if done.returncode and "this processor has no" not in done.stderr:
        raise RuntimeError(done.stderr)
    return done.stdout.strip() if not done.returncode else ""


def sharded(name: str, replicates: int, folder: Path, count: int = 3) -> str:
    """One directory, its parts made by `count` runs in turn, last first."""
    for k in reversed(range(count)):
        STUDIES[name](replicates).run(directory=folder, shard=(k, count), keep="samples", progress=False)
    return digest(mf.load(folder))


def resumed(name: str, replicates: int, folder: Path) -> str:
    """Run by another process that is killed after its first part, then gone on with here."""
    started = subprocess.Popen(
        [sys.executable, __file__, name, str(replicates), "1", str(folder)], stdout=subprocess.DEVNULL
    )
    while started.poll() is None and not list(folder.glob("parts/*.part")):
        time.sleep(0.002)
    started.kill()
    started.wait()
    return made(name, replicates, directory=folder)


def grown(name: str, replicates: int, folder: Path) -> str:
    """A third of the replicates first, the rest in a second run."""
    study = STUDIES[name](replicates)
    study.run(directory=folder, replicates=study.replicates // 3, keep="samples", progress=False)
    return made(name, replicates, directory=folder)


def section(scale: float = 1.0) -> Section:
    """The section."""
    replicates = max(int(REPLICATES * scale), 1000)
    out = Section("The same bits")
    out.say(
        "SHA-256 over all figures and all estimates of a study (first eight digits of two). *Linear*: two "
        f"systems, two noise levels, `ls`, `awls`, `ml`, {replicates:,} replicates a cell, all in compiled "
        f"code. *Joint*: two inputs, coloured noise fitted, {replicates // JOINT:,} fits made one by one; "
        "parts of 512. *Batch*: `fit_many` of 2,000 records. The first row is what the others are held to."
    )
    first = {name: made(name, replicates, threads=1) for name in STUDIES}
    found = [("one thread", first["linear"], first["joint"], batch(1))]
    for threads in (2, 7):
        found.append(
            (f"{threads} threads", *(made(n, replicates, threads=threads) for n in STUDIES), batch(threads))
        )
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found.append(("two processes", *(made(n, replicates, executor=pool) for n in STUDIES), ""))
    for isa in ("avx512", "avx2", "plain"):
        got = [elsewhere(n, str(replicates), "2", MODFUN_ISA=isa) for n in STUDIES]
        found.append((f"`MODFUN_ISA={isa}`", *got, elsewhere("batch", MODFUN_ISA=isa)))
    for name, way in (
        ("a directory in three shards, last first", sharded),
        ("killed after its first part (SIGKILL), then resumed", resumed),
        ("a third of the replicates, then the rest", grown),
    ):
        with tempfile.TemporaryDirectory() as place:
            found.append((name, *(way(n, replicates, Path(place) / n) for n in STUDIES), ""))
    rows = []
    for name, *got in found:
        if not any(got):
            rows.append((name, "", "", "", "this processor does not have it"))
            continue
        same = all(one in ("", wanted) for one, wanted in zip(got, found[0][1:], strict=True))
        rows.append((name, *(one[:8] for one in got), out.judge(name, same)))
    out.table(["run by", "linear", "joint", "batch", ""], rows, left=5)

    from golden.test_normals import GOLDEN

    out.say(
        "**Random numbers** against the values pinned in `tests/python/golden/test_normals.py` "
        "(seed, purpose, channel, replicate, group):"
    )
    rows = []
    for address, wanted in GOLDEN.items():
        got = [x.hex() for x in mf._core.normals(*address, len(wanted)).tolist()]
        rows.append((str(address), wanted[0], out.judge("normals", got == wanted)))
    out.table(["address", "first normal", ""], rows, left=3)
    return out


if __name__ == "__main__":
    what, *rest = sys.argv[1:]
    if what == "batch":
        print(batch(2))
    elif len(rest) == 3:
        print(made(what, int(rest[0]), threads=int(rest[1]), directory=rest[2]))
    else:
        print(made(what, int(rest[0]), threads=int(rest[1])))
