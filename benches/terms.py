"""How often the right terms are found among candidates: ten systems, beside pySINDy's weak form.

    python benches/terms.py [--records 50] [--systems Duffing,Lorenz] [--no-rival] [--page docs/terms.md]
    python benches/terms.py --power [--systems Duffing,Lorenz]

Every state is measured with white noise; the library has all monomials of states and inputs up to degree 3
(5 of one channel), and sin(q) and v*abs(v) of the pendulum. The rival is given the best of its settings
(width of the test functions, threshold, normalised columns or not) for each cell by the truth: no user can
choose so well. `pip install pysindy` for it.
"""

import argparse
import re
import time
import warnings
from itertools import combinations_with_replacement
from pathlib import Path

import modfun as mf
import numpy as np
from fit_studies import response

LEVELS = (0.01, 0.05, 0.1, 0.2)
WIDTHS = (0.05, 0.1, 0.2)  # half widths of the test functions over the record
THRESHOLDS = np.geomspace(1e-3, 10, 13)
DOMAINS = 200


def force(t):
    """Input of the driven systems."""
    return 2 * np.sin(1.1 * t) + 1.5 * np.sin(2.3 * t + 1) + np.sin(0.45 * t)


class System:
    """A system dx/dt = Σ θ·term with its record: x0, duration, intervals, degree of the library."""

    def __init__(self, names, truth, x0, duration, degree=3, more=(), intervals=1024):
        self.names, self.truth, self.degree, self.more = names, truth, degree, more
        self.driven = any(re.search(r"\bu\b", term) for own in truth for term in own)
        channels = [*names, "u"] if self.driven else list(names)
        self.channels = channels
        self.terms = monomials(channels, degree) + list(more)
        self.functions = [compile(term, term, "eval") for term in self.terms]
        self.theta = np.array([[own.get(term, 0.0) for term in self.terms] for own in truth])
        lost = [term for own in truth for term in own if term not in self.terms]
        assert not lost, lost
        self.t = np.linspace(0, duration, intervals + 1)
        self.clean = response(self.slope, x0, duration, intervals)
        self.rms = np.sqrt(np.mean(self.clean**2, axis=1, keepdims=True))

    def features(self, *values):
        """Candidates of numbers or arrays."""
        known = dict(zip(self.channels, values, strict=True)) | {"sin": np.sin, "abs": np.abs}
        return [eval(one, {}, known) + 0 * values[0] for one in self.functions]

    def slope(self, t, x):
        """Right side."""
        return self.theta @ np.array(self.features(*x, force(t)) if self.driven else self.features(*x))

    def record(self, level, seed):
        """A noisy record."""
        noise = level * self.rms * np.random.default_rng(seed).standard_normal(self.clean.shape)
        u = {"u": force(self.t)} if self.driven else {}
        return mf.Record(self.clean + noise, dt=self.t[1], outputs=self.names, **u)


def monomials(names, degree):
    """All products of names up to a degree, as `polynomials of ... up to ...` has them."""
    found = ["1"]
    for total in range(1, degree + 1):
        for factor in combinations_with_replacement(names, total):
            powers = {name: factor.count(name) for name in factor}
            found.append("*".join(name if n == 1 else f"{name}**{n}" for name, n in powers.items()))
    return found


SYSTEMS = {
    "Duffing": lambda: System(
        ["y", "v"], [{"v": 1.0}, {"v": -0.3, "y": -1.0, "y**3": -0.5, "u": 1.0}], [0.5, 0], 20.0
    ),
    "van der Pol": lambda: System(
        ["y", "v"], [{"v": 1.0}, {"v": 1.0, "y": -1.0, "y**2*v": -1.0}], [0.5, 0], 20.0
    ),
    "Lotka–Volterra": lambda: System(
        ["x", "z"], [{"x": 1.0, "x*z": -0.5}, {"z": -0.8, "x*z": 0.4}], [2.0, 1.0], 20.0
    ),
    "Lorenz": lambda: System(
        ["x", "y", "z"],
        [{"x": -10.0, "y": 10.0}, {"x": 28.0, "x*z": -1.0, "y": -1.0}, {"x*y": 1.0, "z": -8 / 3}],
        [-8.0, 7.0, 27.0],
        10.0,
    ),
    "FitzHugh–Nagumo": lambda: System(
        ["v", "w"],
        [{"v": 3.0, "v**3": -1.0, "w": 3.0}, {"v": -1 / 3, "1": 0.34 / 3, "w": -0.2 / 3}],
        [0.5, 0.1],
        40.0,
    ),
    "cubic oscillator": lambda: System(
        ["x", "z"], [{"x**3": -0.1, "z**3": 2.0}, {"x**3": -2.0, "z**3": -0.1}], [2.0, 0.0], 10.0
    ),
    "logistic growth": lambda: System(["x"], [{"x": 1.0, "x**2": -1.0}], [0.01], 10.0, degree=5),
    "pendulum with quadratic drag": lambda: System(
        ["q", "v"],
        [{"v": 1.0}, {"sin(q)": -4.0, "v*abs(v)": -0.3, "u": 1.0}],
        [1.0, 0.0],
        20.0,
        more=["sin(q)", "v*abs(v)"],
    ),
    "bilinear": lambda: System(["y"], [{"y": -1.0, "u": 1.0, "y*u": 0.3}], [0.0], 20.0),
    "Hammerstein": lambda: System(["y"], [{"y": -1.0, "u": 1.0, "u**2": 0.5, "u**3": 0.2}], [0.0], 20.0),
}


def ours(system, rec):
    """Coefficients (equation, term) of the selection's fit, and the time of the selection."""
    library = f"polynomials of {', '.join(system.channels)} up to {system.degree}"
    start = time.perf_counter()
    found = mf.select_terms(rec, ", ".join([library, *system.more]))
    spent = time.perf_counter() - start
    theta = np.zeros_like(system.theta)
    chosen = [(e, system.terms.index(term)) for e, own in enumerate(found.terms.values()) for term in own]
    try:
        values = found.fit.params
    except mf.ModfunError:
        values = np.full(len(chosen), np.inf)  # a wrong choice that cannot be fitted
    for place, value in zip(chosen, values, strict=True):
        theta[place] = value
    return theta, spent


class Weak:
    """pySINDy's weak form with sequential thresholding: coefficients of every setting."""

    def __init__(self, system):
        import pysindy

        self.system, self.optimizer = system, pysindy.STLSQ
        arguments = ", ".join(system.channels)
        known = {"sin": np.sin, "abs": np.abs}
        functions = [
            eval(f"lambda {arguments}: {term} + 0*{system.channels[0]}", dict(known)) for term in system.terms
        ]
        duration = system.t[-1]
        self.libraries = []
        for width in WIDTHS:
            np.random.seed(0)  # noqa: NPY002, of its domains
            self.libraries.append(
                pysindy.WeakPDELibrary(
                    function_library=pysindy.CustomLibrary(library_functions=functions),
                    spatiotemporal_grid=system.t,
                    K=DOMAINS,
                    H_xt=[width * duration],
                )
            )

    def __call__(self, rec):
        x = np.vstack([rec.y, rec.u]).T
        states = len(self.system.names)
        found = []
        for library in self.libraries:
            library.fit([x])
            features = np.asarray(library.transform([x])[0])
            right = np.asarray(library.convert_u_dot_integral(x))[:, :states]
            for normal in (False, True):
                for threshold in THRESHOLDS:
                    fit = self.optimizer(threshold=threshold, alpha=1e-6, normalize_columns=normal)
                    found.append(fit.fit(features, right).coef_)
        return np.array(found)


def figures(theta, truth):
    """Rates of exact terms and of superfluous ones, and the median relative error, over the first axis."""
    right = (theta != 0) == (truth != 0)
    exact = np.all(right, axis=(-2, -1))
    more = np.any((theta != 0) & (truth == 0), axis=(-2, -1))
    error = np.linalg.norm(theta - truth, axis=(-2, -1)) / np.linalg.norm(truth)
    return exact.mean(axis=0), more.mean(axis=0), np.median(error, axis=0)


def weakest(system, level):
    """Smallest ratio of a true coefficient to its standard error, of the true model."""
    from modfun.inference.library import library_of
    from modfun.inference.moments import Lines, estimate
    from modfun.inference.terms import _band, _levels

    rec = system.record(level, 0)
    library = library_of(system.terms, None, None, rec.outputs, rec.inputs, rec.intersample)
    noise = mf.Noise(y=(level * system.rms[:, 0]).tolist())
    sd = _levels(rec, noise, 1)
    tops, edge = _band([rec], [sd], library)
    truth = system.theta.ravel()
    smooth = Lines(rec, library.columns, library.equation, sd**2, tops[0], edge)
    smooth.bend(system.clean)
    found = estimate([smooth], truth != 0, truth)
    at = np.flatnonzero(truth)
    cov = np.linalg.inv(found.quadratic.gram[np.ix_(at, at)])
    return float(np.min(np.abs(truth[at]) / np.sqrt(np.diag(cov))))


def power(system, level, records=1000):
    """How often the criterion finds the true terms where noise acts to first order on noise-free signals."""
    from modfun.inference.library import library_of
    from modfun.inference.moments import Lines
    from modfun.inference.subsets import Subsets
    from modfun.inference.term_search import penalties
    from modfun.inference.terms import _band

    rec, truth, sd = system.record(level, 0), system.theta.ravel(), level * system.rms[:, 0]
    library = library_of(system.terms, None, None, rec.outputs, rec.inputs, rec.intersample)
    tops, edge = _band([rec], [sd], library)
    clean = system.record(0.0, 0)  # no bias to take out
    lines = Lines(clean, library.columns, library.equation, 0 * sd, tops[0], edge)
    lines.bend(system.clean)
    lines.variances = sd**2
    gram = lines.at(truth, np.arange(truth.size))[0].gram
    units = np.sqrt(np.diag(gram))
    size, axes = np.linalg.eigh(gram / units[:, None] / units)
    root = units[:, None] * axes * np.sqrt(np.maximum(size, 0.0))
    keep, rng, hits = np.zeros(truth.size, bool), np.random.default_rng(0), 0
    for _ in range(records):
        right = gram @ truth + root @ rng.standard_normal(truth.size)
        cost = truth @ gram @ truth + 1e4  # of no term; the rest cancels
        subsets = Subsets(gram, right, cost, penalties(keep, library.degrees), keep)
        hits += np.array_equal(subsets.search([truth != 0])[0][0], truth != 0)
    return hits / records


def percent(rate, records):
    """A rate with its standard error, in per cent (that of one half success more at 0 and 100 %)."""
    inside = (rate * records + 0.5) / (records + 1)
    return f"{100 * rate:.0f} ± {100 * np.sqrt(inside * (1 - inside) / records):.0f}"


def main():
    """Prints the table; with --page it goes between the marks of a page."""
    given = argparse.ArgumentParser()
    given.add_argument("--records", type=int, default=50)
    given.add_argument("--systems", default=",".join(SYSTEMS))
    given.add_argument("--no-rival", action="store_true")
    given.add_argument("--power", action="store_true", help="rates by theory alone, at 10 and 20 %% noise")
    given.add_argument("--page")
    options = given.parse_args()
    if options.power:
        for name in options.systems.split(","):
            rates = [percent(power(SYSTEMS[name](), level), 1000) for level in LEVELS[2:]]
            print(f"{name}: {', '.join(rates)} %", flush=True)
        return
    head = (
        "system | noise, % | least t | exact, % | superfluous, % | error, % | s "
        "| weak form: exact, % | error, % |"
    )
    rows = [f"| {head}", "|" + "---|" * (head.count("|"))]
    print("\n".join(rows), flush=True)
    for name in options.systems.split(","):
        system = SYSTEMS[name]()
        rival = None if options.no_rival else Weak(system)
        for level in LEVELS:
            found, times, others = [], [], []
            for seed in range(options.records):
                rec = system.record(level, seed)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    theta, spent = ours(system, rec)
                    found.append(theta)
                    times.append(spent)
                    if rival is not None:
                        others.append(rival(rec))
            exact, more, error = figures(np.array(found), system.theta)
            cells = [
                name,
                f"{100 * level:g}",
                f"{weakest(system, level):.1f}",
                percent(exact, options.records),
                percent(more, options.records),
                f"{100 * error:.2g}",
                f"{np.median(times):.2f}",
            ]
            if rival is None:
                cells += ["", ""]
            else:
                rates, _, errors = figures(np.array(others), system.theta)
                best = np.lexsort((errors, -rates))[0]
                cells += [percent(rates[best], options.records), f"{100 * errors[best]:.2g}"]
            rows.append("| " + " | ".join(cells) + " |")
            print(rows[-1], flush=True)
    if options.page:
        page = Path(options.page)
        words = (
            f"{options.records} records per cell (`python benches/terms.py --records {options.records} "
            f"--page {options.page}`)."
        )
        block = "\n".join(["<!-- rates -->", "", *rows, "", words, "", "<!-- end of rates -->"])
        text = re.sub(
            r"<!-- rates -->.*?<!-- end of rates -->", lambda _: block, page.read_text(), flags=re.S
        )
        page.write_text(text)


if __name__ == "__main__":
    main()
