"""Ctrl-C stops every long call within seconds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress
from pathlib import Path

import pytest

SETUP = """
    import concurrent.futures, multiprocessing, signal
    import modfun as mf, numpy as np

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    system, tf2 = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2, seed=0)
    slow = dict(method="awls", harmonics=12, tol=1e-300, maxiter=10**5)  # never settles

    def study(**changes):
        given = dict(system=system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2,
                     estimators=["ml"], harmonics=8, replicates=10**8)
        return mf.MonteCarlo(**(given | changes))

    def own(call):
        return study(estimators={"ml": "ml", "own": call})

    def pool():
        return concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context("fork"))
"""
LONG = {
    "fit_many": "mf.fit_many(mf.Batch(y=np.repeat(rec.y[None], 10**5, 0), u=rec.u, dt=rec.dt), tf2, **slow)",
    "fit_many of a list": "mf.fit_many([rec] * 10**5, tf2, **slow)",
    "bootstrap": "mf.bootstrap(mf.fit(rec, tf2, **(slow | {'tol': 1e-6})), replicates=10**8)",
    "wild bootstrap": "mf.bootstrap(mf.fit(rec, tf2, harmonics=12), replicates=10**8, kind='wild')",
    "run": "study().run(progress=False)",
    "run on one thread": "study().run(progress=False, threads=1)",
    "run until": "study().run(progress=False, until={'bias': 1e-9})",
    "run, coefficients drawn": "study().run(progress=False, draw='coefficients')",
    "run by map": "study().run(progress=False, executor=map)",
    "run by a pool": "study().run(progress=False, executor=pool())",
    "run of a function": "own(lambda rec, rng: [1, 2, 3]).run(progress=False)",
    "run of a noise": "study(noise=lambda rng, y, dt: rng.normal(size=y.size)).run(progress=False)",
    "run of an optimiser": "own(mf.rivals.output_error(tf2)).run(progress=False)",
}


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("call", LONG.values(), ids=LONG)
def test_ctrl_c(call: str, tmp_path: Path) -> None:
    code = textwrap.dedent(SETUP) + f"print('ready', flush=True)\n{call}\n"
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=1.5)
            os.killpg(process.pid, signal.SIGINT)  # all processes of a terminal get it
            _, err = process.communicate(timeout=20)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert "KeyboardInterrupt" in err
    assert process.returncode != 0
