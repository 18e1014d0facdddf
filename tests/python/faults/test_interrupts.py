"""Ctrl-C stops every long call within seconds, and the process goes on as if nothing had been."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from modfun.study import shards, toml_file
from study_cases import wait_for

SETUP = """
    import concurrent.futures, contextlib, multiprocessing, signal
    import modfun as mf, numpy as np
    import scipy.linalg, scipy.optimize, scipy.signal, sympy  # else a call would be cut while it loads them

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    system, tf2 = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
    rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2, seed=0)
    slow = dict(method="awls", harmonics=12, tol=1e-300, maxiter=10**5)  # never settles
    never = dict(harmonics=12, tol=1e-300, maxiter=10**9)

    def study(**changes):
        given = dict(system=system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2,
                     estimators=["ml"], harmonics=8, replicates=10**8)
        return mf.MonteCarlo(**(given | changes))

    def own(call):
        return study(estimators={"ml": "ml", "own": call})

    big = mf.simulate(system, input="sin(t**2/5)", duration=200.0, intervals=20000, nsr=0.2, seed=0)
    free = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.3, min=0, max=2))
    cubic = mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u")
    params = dict(a1=3.0, a2=8.0, b0=5.0, delay=0.3)
    rng = np.random.default_rng(0)

    def again(call, *given, **options):  # calls that are short enough for Ctrl-C to wait for their end
        while True:
            with contextlib.suppress(mf.FitError):  # a rival's start is drawn; one in many does not settle
                call(*given, **options)

    def pushed():
        stream = mf.Stream(mf.Estimator(tf2, harmonics=6), dt=0.04, window=10.0)
        again(stream.push, rng.standard_normal(10**6), rng.standard_normal(10**6))

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
    "run by threads": "study().run(progress=False, executor=concurrent.futures.ThreadPoolExecutor(2))",
    "run by a Pool": "study().run(progress=False, executor=multiprocessing.get_context('fork').Pool(2).imap)",
    "fit": "again(mf.fit, [big] * 10, tf2, harmonics=1000)",
    "one fit without an end": "mf.fit(rec, tf2, method='awls', **never)",
    "one joint fit without an end": "mf.fit(rec, free, method='awls', **never)",
    "one fit of equations without an end": "mf.fit(rec, cubic, method='awls', **never)",
    "fit with a free delay": "again(mf.fit, big, free, harmonics=500)",
    "fit of equations": "again(mf.fit, big, cubic, harmonics=500)",
    "select_order": "again(mf.select_order, [rec] * 5, poles=range(1, 6))",
    "cross_validate": "mf.cross_validate([rec] * 3000, {'a': tf2, 'b': mf.TransferFunction(poles=3)})",
    "frf": "again(mf.frf, [big] * 20, np.linspace(0.1, 5, 300))",
    "sinusoids": "again(mf.sinusoids, big.y[0], 3, dt=0.1)",
    "reduce": "again(mf.reduce, mf.ss(np.diag(-np.linspace(.1, 50, 60)), np.ones(60), np.ones(60)), 4)",
    "simulate": "again(mf.simulate, system, input='sin(t**2/5)', duration=1e4, intervals=10**6)",
    "stiff equation": "again(mf.Equation('D(y, 2) = 1e3*(1 - y**2)*D(y) - y').model({}).simulate, dt=1.0, "
    "intervals=10**5, initial_state=[2, 0])",
    "late equation": "again(mf.Equation('y\\' = -y(t - 0.3)').model({}).simulate, dt=.01, "
    "intervals=10**6, initial_state=[1])",
    "crlb with a free delay": "again(mf.crlb, free, [big] * 5, nsr=0.2, params=params)",
    "roots": "again(mf.timelag.DelaySystem(A={k * .37: rng.normal(size=(6, 6)) for k in (0, 1)}).poles, 9)",
    "mu": "plant = mf.timelag.DelaySystem(A={0: [[-1, -3], [2, -5]], 1.0: [[1.66, -.697], [.93, -.33]]}, "
    "B={.4: [1, 0]}); again(plant.mu, plant.place([-2.5, -3]), A={0: 0.1 * np.ones((2, 2))})",
    "push": "pushed()",
    "elimination": "again(lambda: mf.Equation(['x1\\' = a*x2 + b*x1', 'x2\\' = c*x1 + d*u', 'y = x1'], "
    "outputs=['y'], inputs=['u'], hidden=['x1', 'x2']).compiled())",
    "output error": "again(mf.rivals.output_error(tf2), big, rng)",
    "pem": "again(mf.rivals.pem(tf2), rec, rng)",
    "run of an optimiser": "own(mf.rivals.output_error(tf2)).run(progress=False)",
}


# The call is cut; then the same short calls as before it give the same numbers.
AFTERWARDS = """
    def known():
        found = study().run(progress=False, replicates=600)
        many = mf.fit_many([rec] * 9, tf2, harmonics=8)
        return [*found.bias.ravel(), *mf.fit(rec, tf2, harmonics=8).params, *many.params[-1]]

    before = known()
    print("ready", flush=True)
    try:
        exec(call)
    except KeyboardInterrupt:
        pass
    assert known() == before
    print("usable", flush=True)
"""

# Loads modfun once; forks a process for each line it reads, a folder and a call, and says its number and how
# it ended. That process goes on below the loop, so that its end is that of an interpreter.
FORKS = """
    import os, sys
    for line in sys.stdin:
        place, call = line.rstrip().split(" ", 1)
        child = os.fork()
        if child == 0:
            os.setsid()
            os.chdir(place)
            for name, number in (("out", 1), ("err", 2)):
                os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), number)
            break
        print(child, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
    else:
        sys.exit()
"""


@pytest.fixture(scope="module")
def forks() -> Iterator[subprocess.Popen[bytes]]:
    code = "".join(map(textwrap.dedent, (SETUP, FORKS, AFTERWARDS)))
    words = [sys.executable, "-c", code]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as process:
        yield process
        process.communicate(timeout=30)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked, to be quick")
@pytest.mark.parametrize("call", LONG.values(), ids=LONG)
def test_ctrl_c(call: str, forks: subprocess.Popen[bytes], tmp_path: Path) -> None:
    assert forks.stdin is not None
    assert forks.stdout is not None
    forks.stdin.write(f"{tmp_path} {call}\n".encode())
    child, out = int(forks.stdout.readline()), tmp_path / "out"
    try:
        deadline = time.monotonic() + 60
        while not (out.exists() and out.read_text() == "ready\n"):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert not ended(forks, 0.5), "the call was to take longer"
        os.killpg(child, signal.SIGINT)  # all processes of a terminal get it
        assert ended(forks, 20), f"Ctrl-C did not end the call: {(tmp_path / 'err').read_text()}"
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        code = int(forks.stdout.readline())
    assert out.read_text() == "ready\nusable\n", (tmp_path / "err").read_text()
    # Where the interrupt went through exec() of a text, as of a dataclass, CPython itself ends by the signal.
    assert code in (0, -signal.SIGINT)


def ended(forks: subprocess.Popen[bytes], seconds: float) -> bool:
    """Whether the process forked last ends within some seconds."""
    return bool(select.select([forks.stdout], [], [], seconds)[0])


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_command(tmp_path: Path) -> None:
    """It leaves with the exit code of an interrupted command, and what is made is kept."""
    text = toml_file.EXAMPLE.replace("replicates = 1000 ", "replicates = 100000000 ")
    (tmp_path / "study.toml").write_text(text)
    code = """
import signal, sys
from modfun.commands.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main(["mc", "run", "study.toml", "--out", "a"]))
"""
    with subprocess.Popen(
        [sys.executable, "-c", code], stderr=subprocess.PIPE, cwd=tmp_path, text=True, start_new_session=True
    ) as process:
        try:
            wait_for(tmp_path / "a", 1)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=20)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert shards.status(tmp_path / "a").damaged == ()
