"""Duffing by `ml`: accuracy and time beside rivals, growth of time: tables of docs/nonlinear.md.

Usage: OMP_NUM_THREADS=1 python benches/nonlinear_speed.py [records, default 400]
"""

import os
import sys
import time
import warnings
from pathlib import Path

import modfun as mf
import numpy as np
from duffing_numpy import Duffing
from duffing_rivals import WeakForm, output_error
from nonlinear import DUFFING, DUFFING_TRUE, duffing_input, duffing_record

ORACLES = Path(__file__).parents[1] / "tests" / "python"
TRUE = np.array([DUFFING_TRUE[name] for name in "dab"])
NSR, HARMONICS = 0.3, 13


def timed(function, least=0.5):
    """(result, least processor time of some calls in s)."""
    best, spent = np.inf, 0.0
    while spent < least:
        began = time.process_time()
        result = function()
        own = time.process_time() - began
        best, spent = min(best, own), spent + own
    return result, best


def many(batch, model=DUFFING, **options):
    """fit_many on one thread: (fits, ms a fit)."""
    found, seconds = timed(lambda: mf.fit_many(batch, model, threads=1, progress=False, **options))
    return found, 1e3 * seconds / len(found)


def row(name, params, milliseconds):
    """A line of the table of rivals."""
    relative = params / TRUE - 1
    bias = 100 * np.sqrt(np.mean(relative.mean(axis=0) ** 2))
    sd = 100 * np.sqrt(np.mean(relative.std(axis=0, ddof=1) ** 2))
    print(
        f"| {name} | {len(params)} | {bias:.2f} ± {sd / np.sqrt(len(params)):.2f} | {sd:.2f} | "
        f"{milliseconds:.3g} |",
        flush=True,
    )


def rivals(records):
    """Everyone on the same records, N = 1024, NSR .3."""
    sys.path.append(str(ORACLES))
    from oracle import nonlinear as systems
    from oracle import terms
    from oracle.coefficients import weights

    y, u, dt = duffing_record()
    sigma = NSR * np.sqrt(np.mean(y**2))
    noisy = y + sigma * np.random.default_rng(1).standard_normal((records, *y.shape))
    batch = mf.Batch(y=noisy, u=u, dt=dt)
    print("| estimator | records | rms bias, % | rms sd, % | ms a fit |\n|---|---:|---|---|---:|")
    place = [mf.fit(batch[0], DUFFING).param_names.index(name) for name in "dab"]
    for word, harmonics in (("M = 13", HARMONICS), ("default band", None)):
        found, ms = many(batch, harmonics=harmonics)
        row(f"modfun ml, {word}, in a batch", found.params[:, place], ms)
    single = mf.Record(y=noisy[0], u=u, dt=dt)
    _, seconds = timed(lambda: mf.fit(single, DUFFING, harmonics=HARMONICS))
    print(f"| modfun ml, M = 13, `mf.fit` | 1 | | | {1e3 * seconds:.3g} |")
    top = HARMONICS + 2
    vectorised = Duffing(u[0], dt, top, sigma, weights("gregory", 1024))
    found, seconds = timed(lambda: vectorised.fit(noisy[:, 0]))
    row("the same in NumPy, all records at once", found, 1e3 * seconds / records)
    _, seconds = timed(lambda: vectorised.fit(noisy[:1, 0]))
    print(f"| the same in NumPy, a record at a time | 1 | | | {1e3 * seconds:.3g} |", flush=True)

    def oracle(own):
        problem = terms.Problem(systems.duffing().terms, own, dt, sigma, top)
        return terms.ml(problem, terms.wls(problem, [0.0, 1.0, 0.0]))

    some = min(records, 20)
    began = time.process_time()
    found = np.array([oracle(own) for own in noisy[:some]])
    row("the tests' oracle (dense matrices, one pass)", found, 1e3 * (time.process_time() - began) / some)
    weak = WeakForm(u[0], dt)
    began = time.process_time()
    found = np.array([weak.fit(own[0]) for own in noisy])
    row("weak form, reweighted", found, 1e3 * (time.process_time() - began) / records)
    some = min(records, 40)
    began = time.process_time()
    found = np.array([output_error(own[0], duffing_input, dt, TRUE) for own in noisy[:some]])
    row("output error from the true values", found, 1e3 * (time.process_time() - began) / some)


def growth():
    """ms a fit in a batch of 100 over N, M and the number of terms."""
    print("\n| N | M | model | ms a fit | iterations |\n|---:|---:|---|---:|---:|")
    cubic = "y'' + d*y' + a*y + b*y**3 = u"
    more = {
        "+ y²": "y'' + d*y' + a*y + b*y**3 + c*y**2 = u",
        "+ y², y⁵": "y'' + d*y' + a*y + b*y**3 + c*y**2 + e*y**5 = u",
        "+ y², y⁵, sin y": "y'' + d*y' + a*y + b*y**3 + c*y**2 + f*y**5 + g*sin(y) = u",
    }
    cells = [(n, 13, "Duffing", cubic) for n in (256, 1024, 4096, 16384)]
    cells += [(1024, m, "Duffing", cubic) for m in (26, 52, 104)]
    cells += [(1024, 13, name, text) for name, text in more.items()]
    for n, m, name, text in cells:
        y, u, dt = duffing_record(n)
        noise = 0.1 * np.sqrt(np.mean(y**2)) * np.random.default_rng(2).standard_normal((100, *y.shape))
        found, ms = many(mf.Batch(y=y + noise, u=u, dt=dt), mf.Equation(text), harmonics=m)
        print(f"| {n} | {m} | {name} | {ms:.3g} | {found.nit.mean():.1f} |", flush=True)


def main(records=400):
    warnings.simplefilter("ignore", mf.ModfunWarning)
    print(f"processor time of one thread; load average {os.getloadavg()[0]:.1f}\n")
    rivals(records)
    growth()
    print(f"\nload average {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
