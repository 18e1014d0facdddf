"""Studies of 95 % intervals, and of the scatter of `ml` over its bound: what `covering` shows and judges."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import modfun as mf
import numpy as np
from scipy.signal import butter, lfilter

TF2 = mf.TransferFunction(poles=2, zeros=0)
EQ24 = {"system": mf.tf([5], [1, 3, 8]), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
LONG = {"duration": 60.0, "intervals": 1024, "nsr": 0.1}
KINDS = {"spectral": "spectral", "HC3": "HC3", "nonrobust": "classical"}


@dataclass(frozen=True)
class Row:
    """Coverage of each parameter by one kind of interval."""

    name: str
    kind: str  # "spectral", "HC3" or "classical"
    covered: np.ndarray
    records: int
    failures: int = 0

    @property
    def errors(self) -> np.ndarray:
        """Monte Carlo standard errors, with half a case added on both sides."""
        c = (self.covered * self.records + 0.5) / (self.records + 1)
        return np.sqrt(c * (1 - c) / self.records)


# Transfer functions in compiled studies ----------------------------------------------------------


def study(name: str, records: int, methods: tuple[str, ...], **words: object) -> list[Row]:
    """A row a method and kind of interval, from one `mf.MonteCarlo`."""
    options = {k: words.pop(k) for k in ("harmonics", "band", "trend") if k in words}
    model = words.pop("model", TF2)
    estimators = {
        f"{m}|{kind}": mf.Estimator(model, method=m, cov_type=kind, **options)
        for m in methods
        for kind in KINDS
    }
    found = mf.MonteCarlo(**{**EQ24, **words}, estimators=estimators, replicates=records, seed=31).run(
        threads=1, progress=False
    )
    rows = []
    for k, key in enumerate(estimators):
        method, kind = key.split("|")
        word = f"{name}, `{method}`" if len(methods) > 1 else name
        covered = found.coverage[..., k, :].reshape(-1)
        rows.append(
            Row(f"{word}, {KINDS[kind]}", KINDS[kind], covered, records, int(found.failures[..., k].sum()))
        )
    return rows


def white(scale: float) -> list[Row]:
    """The report's example over methods and noise."""
    out = []
    for nsr in (0.05, 0.2):
        name = f"eq. (24), NSR {nsr:g}"
        records = int(20_000 * scale)
        out += study(name, records, ("ls", "wls", "awls", "ml"), nsr=nsr, harmonics=11, trend=None)
    return out


def structures(scale: float) -> list[Row]:
    """Few and many lines; sines; short records; default band; other systems; random initial states."""
    n = int(10_000 * scale)
    light = mf.tf([4], [1, 0.3, 4])
    third = mf.tf([6, 12], [1, 2.2, 10.2, 9])
    tf31 = mf.TransferFunction(poles=3, zeros=1)
    few = [
        study(f"eq. (24), NSR 0.1, M = {m}", n, ("ml",), nsr=0.1, harmonics=m, trend=None) for m in (6, 22)
    ]
    sines = {"one sine": "sin(2*t)", "two sines": "sin(2*t) + sin(5*t)"}
    driven = [study(f"eq. (24), {name}, 60 s", n, ("ml",), input=u, **LONG) for name, u in sines.items()]
    return [
        *(row for rows in (*few, *driven) for row in rows),
        *study("eq. (24), NSR 0.1, N = 64", n, ("ml",), nsr=0.1, intervals=64),
        *study("eq. (24), NSR 0.2, default band and trend", n, ("ml",), nsr=0.2),
        *study("eq. (24), NSR 0.1, random initial states", n, ("ml",), nsr=0.1, initial_state="random"),
        *study("light mode (ζ 0.075), NSR 0.1, default band", n, ("ml",), nsr=0.1, system=light),
        *study(
            "third order with a zero, NSR 0.05", n, ("ml",), nsr=0.05, system=third, model=tf31, harmonics=16
        ),
    ]


def autoregressive(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
    """AR(1) noise, pole 0.95, of unit standard deviation."""
    e = rng.standard_normal(y.size + 200) * np.sqrt(1 - 0.95**2)
    return lfilter([1.0], [1.0, -0.95], e)[200:]


def filtered(num: object, den: object) -> Callable[[np.random.Generator, np.ndarray, float], np.ndarray]:
    """White noise through a digital filter."""

    def noise(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
        return lfilter(num, den, rng.standard_normal(y.size + 4000))[4000:]

    return noise


def hum(width: float) -> Callable[[np.random.Generator, np.ndarray, float], np.ndarray]:
    """A resonance of noise about line 5, so many lines wide, of a third of the variance of the white rest."""

    def noise(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
        lines = y.size - 1
        r, turn = np.exp(-np.pi * width / lines), 2 * np.pi * 5 / lines
        e = rng.standard_normal((2, y.size + 8000))
        own = lfilter([1.0], [1.0, -2 * r * np.cos(turn), r * r], e[0])[8000:]
        scale = np.sqrt((1 - r * r) * ((1 + r * r) ** 2 - 4 * r * r * np.cos(turn) ** 2) / (1 + r * r))
        return np.sqrt(1 / 3) * scale * own + e[1, 8000:]

    return noise


def flicker(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
    """Noise of spectrum 1/f."""
    size = 8 * y.size
    f = np.fft.rfftfreq(size)
    f[0] = f[1]
    own = np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) / np.sqrt(f), size)[: y.size]
    return own / own.std()


COLOURS = {
    "AR(0.95)": autoregressive,
    "AR(0.5)": filtered([1.0], [1.0, -0.5]),
    "differenced": filtered([1.0, -1.0], [1.0]),
    "low-passed": filtered(*butter(2, 0.1)),
    "1/f": flicker,
    "resonant, 5 lines": hum(5.0),
    "resonant, 1 line": hum(1.0),
}


def coloured(scale: float) -> list[Row]:
    """Noise of many colours, on few and on many lines."""
    n = int(4000 * scale)
    return [
        row
        for name, noise in COLOURS.items()
        for lines in (11, 40)
        for row in study(
            f"{name} noise, M = {lines}", n, ("ml",), nsr=0.1, noise=noise, harmonics=lines, trend=None
        )
    ]


# Fits one by one ---------------------------------------------------------------------------------


def fitted(
    name: str, make: Callable[[int], mf.Record], model: object, truth: dict, records: int, **options
) -> list[Row]:
    """Rows of both intervals from single fits of records made by number."""
    inside: dict[str, list] = {kind: [] for kind in KINDS}
    failures = 0
    for k in range(records):
        fit = mf.fit(make(k), model, **options)
        if not fit.success:
            failures += 1
            continue
        true = np.array([truth[p] for p in fit.param_names])
        for kind in KINDS:
            own = replace(fit, options=fit.options.replace(cov_type=kind))
            inside[kind].append(np.abs(fit.params - true) <= np.diff(own.conf_int()).ravel() / 2)
    return [
        Row(f"{name}, {KINDS[kind]}", KINDS[kind], np.mean(got, axis=0), len(got), failures)
        for kind, got in inside.items()
    ]


CLEAN = mf.simulate(**EQ24)
RMS = float(np.sqrt(np.mean(CLEAN.y**2)))
TRUE24 = {"a1": 3.0, "a2": 8.0, "b0": 5.0}


def own_noise(scale: float) -> list[Row]:
    """AR noise fitted; four times the noise on the last 40 %, known or not."""
    n = int(1200 * scale)

    def ar(k: int) -> mf.Record:
        e = autoregressive(np.random.default_rng([41, k]), CLEAN.y[0], CLEAN.dt)
        return mf.Record(y=CLEAN.y + 0.1 * RMS * e, u=CLEAN.u, dt=CLEAN.dt)

    level = np.where(np.arange(257) < 154, 1.0, 4.0)

    def uneven(k: int, **words: object) -> mf.Record:
        e = np.random.default_rng([42, k]).standard_normal(257)
        return mf.Record(y=CLEAN.y + 0.05 * RMS * level * e, u=CLEAN.u, dt=CLEAN.dt, **words)

    few = {"harmonics": 11, "trend": None}
    return [
        *fitted(
            'AR(0.95) noise, noise="coloured"', ar, TF2, TRUE24, n, noise="coloured", band=20.0, trend=None
        ),
        *fitted("noise 4 times as strong on 40 % of the record", uneven, TF2, TRUE24, n, **few),
        *fitted("the same with sigma=", lambda k: uneven(k, sigma=level), TF2, TRUE24, n, **few),
    ]


def outputs(scale: float) -> list[Row]:
    """Two outputs with one denominator, correlated noise of unlike size; an unknown delay."""
    t = 0.05 * np.arange(401)
    u = np.array([np.sin(t**2 / 6), np.cos((20 - t) ** 2 / 5)])
    clean = mf.tf([[[1.0, 2.0], [3.0]], [[0.5], [-1.0, 0.7]]], [1.0, 1.2, 4.0]).simulate(u=u, dt=0.05)
    root = np.array([[0.1, 0.0], [0.05, 0.02]])
    structure = mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="common")

    def two(k: int) -> mf.Record:
        e = np.random.default_rng([43, k]).standard_normal(clean.shape)
        return mf.Record(y=clean + root @ e, u=u, dt=0.05)

    names = structure.param_names(("u1", "u2"), ("y1", "y2"))
    truth = dict(zip(names, [1.2, 4.0, 1.0, 2.0, 3.0, 0.5, -1.0, 0.7], strict=True))
    late = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.3, min=0, max=0.6))
    system = mf.tf([5], [1, 3, 8], delay=0.37)
    words = {**EQ24, "input": "sin(t**2/5)"}
    words.pop("system")

    def delayed(k: int) -> mf.Record:
        return mf.simulate(system, **words, nsr=0.1, seed=44, replicate=k)

    n = int(800 * scale)
    found = late.param_names()
    delay = dict(zip(found, [3.0, 8.0, 5.0, 0.37], strict=True))
    return [
        *fitted("two outputs, correlated noise, Σ estimated", two, structure, truth, n, band=6.0),
        *fitted("delay estimated, NSR 0.1", delayed, late, delay, n // 2, harmonics=12, trend=None),
    ]


def equations(scale: float) -> list[Row]:
    """Duffing with bias correction; state equations that share noise; both as a user fits them."""
    import nonlinear

    y, u, dt = nonlinear.duffing_record()
    rms = np.sqrt(np.mean(y**2))

    def duffing(k: int) -> mf.Record:
        return mf.Record(
            y=y + 0.1 * rms * np.random.default_rng([45, k]).standard_normal(y.shape), u=u, dt=dt
        )

    t, _, _, clean = nonlinear.aircraft_record()
    sigma = 0.1 * np.sqrt(np.mean(clean**2, axis=1))[:, None]
    de = nonlinear.elevator(t)

    def aircraft(k: int) -> mf.Record:
        e = sigma * np.random.default_rng([46, k]).standard_normal(clean.shape)
        return mf.Record(y=clean + e, u=de, dt=t[1], outputs=["alpha", "q"], inputs=["de"])

    n = int(1200 * scale)
    duff = fitted(
        "equation (Duffing), NSR 0.1", duffing, nonlinear.DUFFING, nonlinear.DUFFING_TRUE, n, harmonics=13
    )
    state = fitted("state equations, NSR 0.1", aircraft, nonlinear.aircraft(), nonlinear.SHORT, n, trend=None)
    return [*duff, *state]


def benchmarks(scale: float) -> list[Row]:
    """Rao and Garnier's system; Lotka–Volterra, both counted or the prey alone, its predator eliminated."""
    import nonlinear
    import problems
    from fit_studies import response
    from weak_form import WEAK

    out, n = [], int(1000 * scale)
    if problems.DEFINITION.exists():  # the records are no part of the project
        own = problems.rao_garnier()
        words = {"system": own.system, "model": own.model, "nsr": 10**-0.5, **own.experiment}
        out += study("Rao–Garnier, 10 dB", n, ("ml",), **words)
    model, w, start, period, intervals, _, rhs = WEAK["Lotka–Volterra"]
    truth = {f"w{k + 1}": value for k, value in enumerate(w)}
    both, (prey, dt) = response(rhs(w), start, period, intervals), nonlinear.prey_record()
    for nsr in (0.05, 0.2):

        def counted(k: int, size: float = nsr * np.sqrt(np.mean(both**2))) -> mf.Record:
            e = size * np.random.default_rng([54, k]).standard_normal(both.shape)
            return mf.Record(y=both + e, dt=period / intervals, outputs=["x", "z"])

        def alone(k: int, size: float = nsr) -> mf.Record:
            e = size * np.random.default_rng([55, k]).standard_normal(prey.shape)
            return mf.Record(y=prey * np.exp(e), dt=dt, outputs=["x"])

        out += fitted(f"Lotka–Volterra, {100 * nsr:.0f} %", counted, model, truth, n)
        out += fitted(
            f"prey only, log-normal {100 * nsr:.0f} %", alone, nonlinear.PREY, nonlinear.PREY_TRUE, n,
            noise="log-normal",
        )  # fmt: skip
    return out


def derived(scale: float) -> list[Row]:
    """ω and ζ of the poles and static gain by the delta method; the initial state by least squares."""
    true = np.array([np.sqrt(8), 3 / (2 * np.sqrt(8)), 5 / 8])
    start = np.array([0.3, -0.5])
    inside, states = [], []
    for k in range(int(1500 * scale)):
        rec = mf.simulate(
            EQ24["system"], input=EQ24["input"], duration=10.0, intervals=256, nsr=0.1, seed=47, replicate=k,
            initial_state=start,
        )  # fmt: skip
        fit = mf.fit(rec, TF2, harmonics=11, trend=None)
        table = fit.derived(wn="sqrt(a2)", zeta="a1/(2*sqrt(a2))", gain="b0/a2")
        inside.append((table["low"] <= true) & (true <= table["high"]))
        found = fit.initial_state(rec)
        states.append(np.abs(found.state - start) <= 1.96 * found.bse)
    return [
        Row(f"{name}, {kind}", kind, np.mean(got, axis=0), len(got))
        for name, kind, got in (
            ("ω, ζ, gain by the delta method", "spectral", inside),
            ("initial state by least squares", "classical", states),
        )
    ]


def bootstrap(scale: float) -> list[Row]:
    """Both kinds, 200 refits a fit: the usual record, and a short one with standard errors of 20 to 30 %."""
    usual, short = [], []
    for k in range(int(400 * scale)):
        e = np.random.default_rng([48, k]).standard_normal(257)
        rec = mf.Record(y=CLEAN.y + 0.2 * RMS * e, u=CLEAN.u, dt=CLEAN.dt)
        usual.append(mf.fit(rec, TF2, harmonics=11, trend=None))
        few = {"duration": 6.0, "intervals": 120, "nsr": 0.3, "initial_state": "random"}
        rec = mf.simulate(EQ24["system"], input=EQ24["input"], **few, seed=48, replicate=k)
        short.append(mf.fit(rec, TF2))
    return [
        _resampled(f"bootstrap{name}, {kind}", kind, fits)
        for name, fits in (("", usual), (" of 6 s, NSR 0.3", short))
        for kind in ("parametric", "wild")
    ]


def _resampled(name: str, kind: str, fits: list[mf.Fit]) -> Row:
    """Coverage of one kind of bootstrap; fits without an answer, or unstable ones, count as failures."""
    inside, failures = [], 0
    for k, fit in enumerate(fits):
        try:
            low, high = mf.bootstrap(fit, replicates=200, seed=k, kind=kind, progress=False).conf_int().T
        except mf.FitError:
            failures += 1
            continue
        inside.append((low <= [3, 8, 5]) & (np.array([3, 8, 5]) <= high))
    words = "classical" if kind == "parametric" else "HC3"
    return Row(f"{name}, {words}", words, np.mean(inside, axis=0), len(inside), failures)


def responses(scale: float) -> list[Row]:
    """Circles about the gains of a light mode and of eq. (24), held white input."""
    light = mf.tf([9.0], [1.0, 0.3, 9.0]), 4096, 0.05, [1.0, 2.0, 2.6, 3.0, 3.3, 4.0, 6.0]
    eq24 = EQ24["system"], 1024, 0.1, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    out = []
    for name, (system, intervals, dt, omega), method, width in (
        ("lpm", light, "lpm", None),
        ("lrm", light, "lrm", None),
        ("eq. (24), lpm", eq24, "lpm", None),
        ("eq. (24), lrm", eq24, "lrm", None),
        ("eq. (24), lpm, halfwidth=12", eq24, "lpm", 12),
        ("eq. (24), lrm, halfwidth=12", eq24, "lrm", 12),
    ):
        exact = system.frequency_response(np.array(omega)).response[0, 0]
        inside = []
        for k in range(int(1000 * scale)):
            u = np.random.default_rng([49, k]).standard_normal(intervals + 1)
            rec = mf.simulate(
                system,
                input=u,
                duration=intervals * dt,
                intervals=intervals,
                nsr=0.1,
                seed=49,
                replicate=k,
                intersample="zoh",
            )
            found = mf.frf(rec, omega, method=method, halfwidth=width, progress=False)
            inside.append(np.abs(found.response[0, 0] - exact) <= found.radius(0.95)[0, 0])
        out.append(
            Row(f"frequency response, {name}, classical", "classical", np.mean(inside, axis=0), len(inside))
        )
    return out


def tones(scale: float) -> list[Row]:
    """Two tones in white and in AR(1) noise: ω, amplitude, phase of both."""
    n, k = int(4000 * scale), np.arange(256)
    rng = np.random.default_rng(50)
    out = []
    for name, frequencies, options in (
        ("sinusoids, white noise", (0.10, 0.12), {}),
        ("sinusoids, AR(1) noise, all samples", (0.05, 0.40), {}),
        ("sinusoids, AR(1) noise, lines=9", (0.05, 0.40), {"lines": 9}),
    ):
        omega = 2 * np.pi * np.array(frequencies)
        phase = rng.uniform(-np.pi, np.pi, (n, 2))
        clean = np.cos(omega[:, None] * k + phase[:, :, None]).sum(axis=1)
        e = rng.standard_normal((n, 356))
        e = e if "white" in name else lfilter([0.6], [1, -0.8], e)
        found = mf.sinusoids(
            mf.Batch(y=clean + 0.22 * e[:, 100:], dt=1.0), 2, progress=False, threads=1, **options
        )
        truth = np.concatenate([np.tile(omega, (n, 1)), np.ones((n, 2)), phase], axis=1)
        gap = found.params - truth
        gap[:, 4:] = (gap[:, 4:] + np.pi) % (2 * np.pi) - np.pi
        inside = (np.abs(gap) <= 1.96 * found.bse)[found.success]
        out.append(Row(f"{name}, classical", "classical", inside.mean(axis=0), len(inside), n - len(inside)))
    return out


CASES = (
    white,
    structures,
    coloured,
    own_noise,
    outputs,
    equations,
    benchmarks,
    derived,
    bootstrap,
    responses,
    tones,
)


# Efficiency --------------------------------------------------------------------------------------


def efficiency(scale: float) -> list[tuple[str, np.ndarray, np.ndarray, int]]:
    """(what, sd over bound, its Monte Carlo error, records) of `ml`, state unknown, no trend."""
    out = []
    tf31 = mf.TransferFunction(poles=3, zeros=1)
    cases = {
        "eq. (24), N = 256, NSR 0.05": {"nsr": 0.05},
        "eq. (24), N = 256, NSR 0.2": {"nsr": 0.2},
        "eq. (24), N = 1024, NSR 0.2": {"nsr": 0.2, "intervals": 1024},
        "light mode (ζ 0.075), NSR 0.1": {"nsr": 0.1, "system": mf.tf([4], [1, 0.3, 4])},
        "third order with a zero, NSR 0.05": {"nsr": 0.05, "system": mf.tf([6, 12], [1, 2.2, 10.2, 9])},
        "eq. (24), sin(2t) + sin(5t), 60 s, N = 1024, NSR 0.1": {"input": "sin(2*t) + sin(5*t)", **LONG},
        "eq. (24), sin(2t), 60 s, N = 1024, NSR 0.1": {"input": "sin(2*t)", **LONG},
        "eq. (24), sin(1.7t), 100 s, N = 1024, NSR 0.1": {"input": "sin(1.7*t)", **LONG, "duration": 100.0},
    }
    for name, words in cases.items():
        setting = {**EQ24, **words}
        model = tf31 if "third" in name else TF2
        records = int(20_000 * scale)
        res = mf.MonteCarlo(
            **setting, estimators={"ml": mf.Estimator(model, trend=None)}, replicates=records, seed=51
        ).run(threads=1, progress=False, coverage=False)
        system, nsr = setting.pop("system"), setting.pop("nsr")
        least = mf.crlb(system, mf.simulate(system, **setting), nsr=nsr).sd
        out.append((name, res.sd.reshape(-1) / least, res.sd_mcse.reshape(-1) / least, records))
    return out


def case(name: str, scale: float) -> list:
    warnings.simplefilter("ignore", mf.ModfunWarning)
    return globals()[name](scale)
