"""How often the right terms are found among candidates: ten systems, beside pySINDy's weak form.

    python benches/terms.py [--records 200] [--rival-records 30] [--systems Duffing,Lorenz] [--keep FILE]
        [--page docs/terms.md]
    python benches/terms.py --power [--systems Duffing,Lorenz]
    python benches/terms.py --hidden [--records 30]
    python benches/terms.py --colour 0.9 [--records 30]

Every state is measured with white noise; the library has all monomials of states and inputs up to degree 3
(5 of one channel), and sin(q) and v*abs(v) of the pendulum. The rivals solve pySINDy's weak form by
sequential thresholding (STLSQ), relaxed regression (SR3) and bagging (its ensemble). Each is given the best
of its settings for each cell by the truth: no user can choose so well. `pip install pysindy` for them.
"""

import argparse
import json
import re
import time
import warnings
from itertools import combinations_with_replacement, product
from pathlib import Path

import modfun as mf
import numpy as np
from fit_studies import response
from scipy.signal import lfilter

LEVELS = (0.01, 0.05, 0.1, 0.2)
WIDTHS = (0.05, 0.1, 0.2)  # half widths of the test functions over the record
THRESHOLDS = np.geomspace(1e-3, 10, 13)
DOMAINS = 200
RELAXED = (0.1, 1.0, 100.0)  # SR3's nu
BAGS = 20  # models of the ensemble
INCLUSION = (0.5, 0.6, 0.8, 0.95)  # least share of them that has a term


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
        self.x0, self.clean = x0, response(self.slope, x0, duration, intervals)
        self.rms = np.sqrt(np.mean(self.clean**2, axis=1, keepdims=True))

    def features(self, *values):
        """Candidates of numbers or arrays."""
        known = dict(zip(self.channels, values, strict=True)) | {"sin": np.sin, "abs": np.abs}
        return [eval(one, {}, known) + 0 * values[0] for one in self.functions]

    def slope(self, t, x):
        """Right side."""
        return self.theta @ np.array(self.features(*x, force(t)) if self.driven else self.features(*x))

    def record(self, level, seed, colour=0.0):
        """A noisy record; the noise of each output is an AR(1) of this coefficient."""
        size, settled = self.clean.shape, 200 if colour else 0
        white = np.random.default_rng(seed).standard_normal((size[0], size[1] + settled))
        noise = lfilter([np.sqrt(1 - colour**2)], [1, -colour], white)[:, settled:] * level * self.rms
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
    """Coefficients (equation, term) of the selection's fit, and the processor time of the selection."""
    library = f"polynomials of {', '.join(system.channels)} up to {system.degree}"
    start = time.process_time()
    found = mf.select_terms(rec, ", ".join([library, *system.more]))
    spent = time.process_time() - start
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
    """pySINDy's weak form: its regressors and left sides at every width of the test functions."""

    def __init__(self, system):
        import pysindy

        self.system, self.pysindy = system, pysindy
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

    def problems(self, rec):
        """Regressors and left sides of a record for each width."""
        x = np.vstack([rec.y, rec.u]).T
        found = []
        for library in self.libraries:
            library.fit([x])
            right = np.asarray(library.convert_u_dot_integral(x))[:, : len(self.system.names)]
            found.append((np.asarray(library.transform([x])[0]), right))
        return found

    def contest(self, problems):
        """Words, rate of exact terms and error of each method at its best setting, over records."""
        widths, normal = range(len(WIDTHS)), (False, True)
        grid = [(w, n, t) for w in widths for n in normal for t in range(len(THRESHOLDS))]
        rows = [self.best("STLSQ", [[self.stlsq(p[w], n, t) for w, n, t in grid] for p in problems])]
        w, n, t = grid[rows[0][3]]
        rows.append(self.best("SR3", [self.sr3(p[w]) for p in problems]))
        rows.append(self.best("ensemble", [self.bagged(p[w], n, t) for p in problems]))
        return rows

    def best(self, name, found):
        """The setting with most exact records, of these the one of least error."""
        rates, _, errors = figures(np.array(found), self.system.theta)
        at = int(np.lexsort((errors, -rates))[0])
        return name, rates[at], errors[at], at

    def stlsq(self, problem, normal, place):
        """Sequential thresholding."""
        made = self.pysindy.STLSQ(threshold=THRESHOLDS[place], alpha=1e-6, normalize_columns=normal)
        return made.fit(*problem).coef_

    def sr3(self, problem):
        """Relaxed regression at all thresholds, at the best width of STLSQ."""
        return [
            self.pysindy.SR3(
                reg_weight_lam=threshold**2 / (2 * nu),
                relax_coeff_nu=nu,
                normalize_columns=normal,
                unbias=True,
            )
            .fit(*problem)
            .coef_
            for normal in (False, True)
            for nu in RELAXED
            for threshold in THRESHOLDS
        ]

    def bagged(self, problem, normal, place):
        """Medians over bags for the terms that most of them have, near the best setting of STLSQ."""
        found = []
        for near in range(max(place - 1, 0), min(place + 2, len(THRESHOLDS))):
            np.random.seed(0)  # noqa: NPY002, of its bags
            one = self.pysindy.STLSQ(threshold=THRESHOLDS[near], alpha=1e-6, normalize_columns=normal)
            bags = self.pysindy.EnsembleOptimizer(opt=one, bagging=True, n_models=BAGS).fit(*problem)
            each = np.array(bags.coef_list)
            share, middle = (each != 0).mean(axis=0), np.median(each, axis=0)
            found += [np.where(share >= least, middle, 0.0) for least in INCLUSION]
        edge = 3 * len(INCLUSION) - len(found)  # the same number of settings at the ends of the grid
        return found + found[:edge]


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
    library = library_of(system.terms, None, None, rec)
    noise = mf.Noise(y=(level * system.rms[:, 0]).tolist())
    sd = _levels(rec, noise, 1)
    tops, edge = _band([rec], [rec.y], [sd], library)
    truth = system.theta.ravel()
    variances = np.broadcast_to(sd[:, None] ** 2, rec.y.shape)
    smooth = Lines(rec, rec.y, library.columns, library.equation, variances, tops[0], edge)
    smooth.bend(system.clean)
    found = estimate([smooth], truth != 0, truth)
    at = np.flatnonzero(truth)
    cov = np.linalg.inv(found.quadratic.gram[np.ix_(at, at)])
    return float(np.min(np.abs(truth[at]) / np.sqrt(np.diag(cov))))


def bound(system):
    """Median relative error at the Cramér–Rao bound of the true equations, over the noise level."""
    equations, values = [], {}
    for name, own in zip(system.names, system.theta, strict=True):
        side = []
        for at in np.flatnonzero(own):
            values[key := f"c{len(values) + 1}"] = own[at]
            side.append(key if system.terms[at] == "1" else f"{key}*{system.terms[at]}")
        equations.append(f"{name}' = {' + '.join(side)}")
    model = mf.Equation(equations, outputs=system.names, inputs=["u"] if system.driven else [])
    level = 1e-2
    found = mf.crlb(
        model,
        system.record(0.0, 0),
        sigma=(level * system.rms[:, 0]).tolist(),
        params=values,
        start=system.x0,
    )
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(len(values)), found.cov, 4000)
    return np.median(np.linalg.norm(draws, axis=1)) / np.linalg.norm(system.theta) / level


def power(system, level, records=1000):
    """How often the criterion finds the true terms where noise acts to first order on noise-free signals."""
    from modfun.inference.library import library_of
    from modfun.inference.moments import Lines
    from modfun.inference.subsets import Subsets
    from modfun.inference.term_search import penalties
    from modfun.inference.terms import _band

    rec, truth, sd = system.record(level, 0), system.theta.ravel(), level * system.rms[:, 0]
    library = library_of(system.terms, None, None, rec)
    tops, edge = _band([rec], [rec.y], [sd], library)
    clean = system.record(0.0, 0)  # no bias to take out
    variances = np.broadcast_to(sd[:, None] ** 2, clean.y.shape)
    lines = Lines(clean, clean.y, library.columns, library.equation, 0 * variances, tops[0], edge)
    lines.bend(system.clean)
    lines.variances = variances
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


def hidden(records):
    """Terms of the prey alone, and the fit of Lorenz's equations to x alone."""
    prey, lorenz = SYSTEMS["Lotka–Volterra"](), SYSTEMS["Lorenz"]()
    model = mf.Equation(["x' = a*x - b*x*z", "z' = d*x*z - c*z"], outputs=["x"], hidden=["z"])
    for level in LEVELS:
        hits = 0
        for seed in range(records):
            rec = prey.record(level, seed).select(outputs=["x"])
            try:
                found = mf.select_terms(rec, [model, "x**2, x**3, x*x', log(x)"])
            except mf.DataError:  # noise took x below 0, where it has no logarithm
                continue
            hits += set(*found.terms.values()) == {"x'/x", "x'", "x", "1"}
        print(f"prey only, {100 * level:g} %: {percent(hits / records, records)} %", flush=True)
    form = mf.Equation(
        ["x' = s*(y - x)", "y' = r*x - x*z - y", "z' = x*y - b*z"], outputs=["x"], hidden=["y", "z"]
    )
    for level in (1e-3, 1e-2):
        fits = [mf.fit(lorenz.record(level, seed).select(outputs=["x"]), form) for seed in range(records)]
        middle = np.median([fit.params for fit in fits], axis=0)
        words = ", ".join(f"{n} {v:.2f}" for n, v in zip(fits[0].param_names, middle, strict=True))
        print(f"Lorenz from x, {100 * level:g} %: {words}", flush=True)


def percent(rate, records):
    """A rate with its standard error, in per cent (that of one half success more at 0 and 100 %)."""
    inside = (rate * records + 0.5) / (records + 1)
    return f"{100 * rate:.0f} ± {100 * np.sqrt(inside * (1 - inside) / records):.0f}"


def main():
    """Prints the table; with --page it goes between the marks of a page."""
    given = argparse.ArgumentParser()
    given.add_argument("--records", type=int, default=200)
    given.add_argument("--rival-records", type=int, default=30, help="0: without rivals")
    given.add_argument("--systems", default=",".join(SYSTEMS))
    given.add_argument("--power", action="store_true", help="rates by theory alone, at 10 and 20 %% noise")
    given.add_argument(
        "--hidden", action="store_true", help="of Lotka–Volterra and Lorenz only x is measured"
    )
    given.add_argument("--colour", type=float, help="rates in AR(1) noise of this coefficient")
    given.add_argument("--keep", help="a file for finished cells: a later run goes on from there")
    given.add_argument("--page")
    options = given.parse_args()
    if options.power:
        for name in options.systems.split(","):
            rates = [percent(power(SYSTEMS[name](), level), 1000) for level in LEVELS[2:]]
            print(f"{name}: {', '.join(rates)} %", flush=True)
        return
    if options.hidden:
        hidden(options.records)
        return
    names = options.systems.split(",")
    if options.colour is not None:
        for name, level in product(names, LEVELS[:3]):
            found = our_cells(SYSTEMS[name](), level, options.records, options.colour)
            print(f"{name}, {100 * level:g} %: exact {found[1]}, superfluous {found[2]} %", flush=True)
        return
    kept = json.loads(Path(options.keep).read_text()) if options.keep and Path(options.keep).exists() else {}
    for what, records, make in (
        ("ours", options.records, our_cells),
        ("rivals", options.rival_records, rival_cells),
    ):
        for name, level in product(names if records else [], LEVELS):
            key = f"{name}, {level:g}, {what}, {records}"
            if key not in kept:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    kept[key] = make(SYSTEMS[name](), level, records)
                if options.keep:
                    Path(options.keep).write_text(json.dumps(kept, indent=1))
            print(key, *kept[key], sep=" | ", flush=True)
    head = (
        "| system | noise, % | least t | exact, % | superfluous, % | error, % | bound, % | s "
        "| STLSQ: exact, % | error, % | SR3: exact, % | error, % | ensemble: exact, % | error, % |"
    )
    rows = [head, "|" + "---|" * (head.count("|") - 1)]
    bounds = {name: bound(SYSTEMS[name]()) for name in names}
    for name, level in product(names, LEVELS):
        ours = kept.get(f"{name}, {level:g}, ours, {options.records}", [""] * 5)
        ours = [*ours[:-1], f"{100 * level * bounds[name]:.2g}", ours[-1]]
        others = kept.get(f"{name}, {level:g}, rivals, {options.rival_records}", [""] * 6)
        rows.append("| " + " | ".join([name, f"{100 * level:g}", *ours, *others]) + " |")
    if options.page:
        page = Path(options.page)
        words = (
            f"{options.records} records per cell, {options.rival_records} for the rivals (`python "
            f"benches/terms.py --records {options.records} --rival-records {options.rival_records} "
            f"--page {options.page}`)."
        )
        block = "\n".join(["<!-- rates -->", "", *rows, "", words, "", "<!-- end of rates -->"])
        text = re.sub(
            r"<!-- rates -->.*?<!-- end of rates -->", lambda _: block, page.read_text(), flags=re.S
        )
        page.write_text(text)
    else:
        print("\n".join(rows))


def our_cells(system, level, records, colour=0.0):
    """Least t in white noise, rates, error and time of the selection."""
    both = [ours(system, system.record(level, seed, colour)) for seed in range(records)]
    exact, more, error = figures(np.array([theta for theta, _ in both]), system.theta)
    return [
        f"{weakest(system, level):.1f}",
        percent(exact, records),
        percent(more, records),
        f"{100 * error:.2g}",
        f"{np.median([spent for _, spent in both]):.2f}",
    ]


def rival_cells(system, level, records):
    """Rate of exact terms and error of each rival."""
    rival = Weak(system)
    found = rival.contest([rival.problems(system.record(level, seed)) for seed in range(records)])
    return [one for _, rate, error, _ in found for one in (percent(rate, records), f"{100 * error:.2g}")]


if __name__ == "__main__":
    main()
