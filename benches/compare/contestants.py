"""Who competes: modfun in its ways, and the rivals; what is absent is named with the reason."""

import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import long_record
import modfun as mf
import numpy as np
import setting as s
from measure import Contestant

FORMS = ("lines", "banded")
TF2 = mf.TransferFunction(poles=s.ORDER, zeros=0)
SEEDS = {
    None: 1,
    "avx2": 2,
    "plain": 3,
}  # a process keeps the layout of equal studies, instruction set and all
FIVE = {"tol": 1e-300, "maxiter": s.STEPS}
OPTIONS = {"harmonics": s.HARMONICS, "trend": None, "rule": "trapezoid"}
RECORD = mf.simulate(s.SYSTEM, input=s.INPUT, duration=s.DURATION, intervals=s.INTERVALS, nsr=s.NSR, seed=0)


def study(method="awls", draw="samples", threads=1, isa=None, **options) -> Callable[[int], None]:
    """A Monte Carlo study of so many replicates."""
    plans = {}

    def run(count):
        if count not in plans:
            plans[count] = mf.MonteCarlo(
                system=s.SYSTEM, input=s.INPUT, duration=s.DURATION, intervals=s.INTERVALS, nsr=s.NSR,
                estimators=[method], replicates=count, seed=SEEDS[isa], **OPTIONS, **options,
            )  # fmt: skip
        before = os.environ.get("MODFUN_ISA")
        if isa is not None:
            os.environ["MODFUN_ISA"] = isa
        try:
            plans[count].run(threads=threads, coverage=False, draw=draw, progress=False)
        finally:
            if isa is not None:
                del os.environ["MODFUN_ISA"]
                if before is not None:
                    os.environ["MODFUN_ISA"] = before

    return run


def modfun_runs() -> dict[str, Contestant]:
    """Monte Carlo by modfun; overhead of a call is under 2 % from 40,960 replicates on."""
    runs = {
        "samples": Contestant("modfun", study(**FIVE)),
        "avx2": Contestant("modfun, held to AVX2", study(isa="avx2", **FIVE)),
        "plain": Contestant("modfun, held to no instruction set", study(isa="plain", **FIVE)),
        "coefficients": Contestant("modfun", study(draw="coefficients", **FIVE)),
        "awls": Contestant("modfun, awls to 1e-9", study()),
        "ml": Contestant("modfun, ml to 1e-9", study("ml")),
        "one thread": Contestant("modfun, one thread", study(**FIVE), pinned=False),
        "two threads": Contestant("modfun, two threads", study(threads=2, **FIVE), pinned=False),
    }
    for c in runs.values():
        c.least = 320 if not c.pinned else 80
    return runs


def fits() -> dict[str, Contestant]:
    """Single fits of a record made before, and batches."""

    def single(**options):
        def run(count):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for _ in range(count):
                    mf.fit(RECORD, TF2, **options)

        return run

    def many(size):
        noise = np.random.default_rng(1).standard_normal((size, 1, s.SAMPLES))
        step = s.DURATION / s.INTERVALS
        batch = mf.Batch(y=s.Y + s.SIGMA * noise, u=s.U[None], dt=step, intersample="smooth")

        def run(count):
            for _ in range(count // size):
                mf.fit_many(batch, TF2, method="awls", threads=1, progress=False, **OPTIONS)

        return run

    few = {"harmonics": s.HARMONICS, "trend": None}
    return {
        "fit awls": Contestant("mf.fit, M = 6, awls", single(method="awls", **few), unit=8),
        "fit ml": Contestant("mf.fit, M = 6, ml", single(method="ml", **few), unit=8),
        "fit default": Contestant("mf.fit, all defaults", single(), unit=8),
        **{
            f"many {size}": Contestant(f"mf.fit_many, {size:,} records, a fit", many(size), unit=size)
            for size in (10, 100, 10_000)
        },
    }


def long_records() -> dict[str, Contestant]:
    """2²² samples."""
    names = {"modfun": "mf.coefficients, 2²² samples, M = 30", "numpy": "numpy.fft.rfft, 2²² samples"}

    def repeated(call):
        def run(count):
            for _ in range(count):
                call()

        return run

    calls = long_record.transforms(long_record.record())
    return {f"long {key}": Contestant(names[key], repeated(call), unit=1) for key, call in calls.items()}


def noise_alone() -> Contestant:
    """NumPy's fastest generator."""
    generator = np.random.Generator(np.random.SFC64(1))
    out = np.empty((4096, s.SAMPLES))

    def run(count):
        for first in range(0, count, 4096):
            generator.standard_normal(out=out[: min(4096, count - first)])

    return Contestant("NumPy's SFC64, the 257 normals alone", run)


def long_record_memory() -> dict[str, float]:
    """MB beyond the samples."""
    script = Path(long_record.__file__)
    return {
        who: float(
            subprocess.run([sys.executable, script, who], check=True, capture_output=True, text=True).stdout
        )
        for who in ("modfun", "numpy")
    }


def dsmc(absent: dict[str, str]):
    """The crate's process, or None with the reason in `absent`."""
    from rivals.srivc_dsmc import Dsmc

    if shutil.which("cargo") is None:
        absent["dsmc"] = "cargo is not installed"
        return None
    noise = np.random.default_rng(1).standard_normal((256, s.SAMPLES))
    found = Dsmc(s.U, s.Y + s.SIGMA * noise, s.DURATION / s.INTERVALS, poles=2, zeros=0, cutoff=3.0)
    _, theta = found.run()
    if not np.allclose(theta.mean(axis=0), [3, 8, 5], rtol=0.02):
        raise AssertionError(f"dsmc: mean {theta.mean(axis=0)} instead of 3, 8, 5")
    return found


def rivals(compiled: bool = True, jax: bool = True) -> tuple[dict[str, object], dict[str, str]]:
    """Rivals by "name, form", and those that cannot run with the reason."""
    from rivals.expert_numpy import ExpertNumPy
    from rivals.natural_numpy import NaturalNumPy

    found: dict[str, object] = {"natural NumPy, lines": NaturalNumPy()}
    absent = {}
    for form in FORMS:
        found[f"expert NumPy, {form}"] = ExpertNumPy(form)
    if not compiled:
        absent |= {"numba": "left out by --quick", "JAX": "left out by --quick"}
        return found, absent
    if find_spec("numba"):
        from rivals.lanes_numba import NumbaLanes

        found |= {f"numba in 16 lanes, {form}": NumbaLanes(form) for form in FORMS}
    else:
        absent["numba"] = "not installed: pip install -r benches/compare/requirements.txt"
    if not jax:
        absent["JAX"] = "left out by --no-jax"
    elif find_spec("jax"):
        from rivals.jax_vmap import JaxVmap

        found |= {f"JAX jit + vmap, {form}": JaxVmap(form) for form in FORMS}
    else:
        absent["JAX"] = "not installed: pip install -r benches/compare/requirements.txt"
    return found, absent
