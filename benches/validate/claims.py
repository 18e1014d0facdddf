"""Claims of the report, ours beside each: what `the_report` shows and judges."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

import modfun as mf
import numpy as np
import pem
import problems
from modfun.commands import reproduction
from test_reduction import random_system

TRUE = np.array([3.0, 8.0, 5.0])
TF2 = mf.TransferFunction(poles=2, zeros=0)
OWN = {"harmonics": 6, "rule": "staircase", "extended": False, "trend": None}  # the report's setting


@dataclass(frozen=True)
class Claim:
    """A number of the report, ours with its Monte Carlo error, and the deviation in these errors.

    `low` and `high` bound what agrees where the report gives a range or words.
    """

    name: str
    said: str
    value: float
    error: float
    low: float
    high: float
    command: str
    digits: int = 2

    @property
    def away(self) -> float:
        """Standard errors outside of the report's range; 0 inside."""
        gap = max(self.low - self.value, self.value - self.high, 0.0)
        return gap / self.error if self.error else (np.inf if gap else 0.0)


def figure_2(runs: int, many: int) -> Iterator[Claim]:
    """Section 4.3, from `modfun reproduce report`."""
    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(io.StringIO()):
        answer = reproduction.report(place, runs=runs, many=many, threads=2, progress=False)
    by = "`modfun reproduce report`"

    def of(name: str, column: str = "bias", state: str = "zero", nsr: float = 0.6) -> float:
        return reproduction.figure(answer.table, column, state, nsr, name, largest=False)

    def large(name: str, column: str, state: str, nsr: float) -> float:
        return reproduction.figure(answer.table, column, state, nsr, name)

    # "~12 %" is a reading of a figure: half a per cent either way.
    yield Claim(
        "Fig. 2, bias of the method (`ls`), NSR 60 %, %",
        "~12",
        of("ls"),
        of("ls", "bias_mcse"),
        11.5,
        12.5,
        by,
    )
    mean = mean_absolute(max(many, 2000))
    yield Claim(
        "the same, noise counted on the mean magnitude of y, %",
        "~12",
        *mean,
        11.5,
        12.5,
        "`make validate ONLY=report`",
    )
    yield Claim("Fig. 2, bias without noise, %", "0", of("ls", nsr=0.0), 0.0, 0.0, 0.05, by, 3)
    rest = "pem, from rest"
    for nsr in (0.0, 0.6):
        error = of(rest, "bias_mcse", nsr=nsr)
        yield Claim(
            f"Fig. 2, bias of PEM, NSR {100 * nsr:.0f} %, %", "6–7", of(rest, nsr=nsr), error, 6, 7, by
        )
    ratio = of("ls", "sd") / of(rest, "sd")
    yield Claim(
        "Fig. 2, sd of the method over that of PEM, NSR 60 %", "nearly the same", ratio, ratio / np.sqrt(2 * runs),
        0.75, 1.33, by,
    )  # fmt: skip
    for lag, name in ((0, "PEM with b u(t)"), (1, "PEM with b u(t − 1)")):
        bias, sd = one_coefficient(runs, lag)
        yield Claim(
            f"Fig. 2, {name}: change of bias from NSR 0 to 60 %, points", "fairly constant",
            bias[1] - bias[0], sd / np.sqrt(runs), -1, 1, "`make validate ONLY=report`",
        )  # fmt: skip
        yield Claim(
            f"Fig. 2, sd of the method over that of {name}", "nearly the same", of("ls", "sd") / sd,
            of("ls", "sd") / sd / np.sqrt(runs), 0.75, 1.33, "`make validate ONLY=report`",
        )  # fmt: skip
    for column in ("bias", "sd"):
        gaps, errors = [], []
        for nsr in reproduction.LEVELS[1:]:
            gaps.append(large("ls", column, "random", nsr) - large("ls", column, "zero", nsr))
            errors.append(np.hypot(*(large("ls", f"{column}_mcse", s, nsr) for s in ("zero", "random"))))
        k = int(np.argmax(gaps))
        yield Claim(
            f"Fig. 2, random states: change of {column} of the method, greatest, points", "below 0 at each NSR",
            gaps[k], float(errors[k]), -np.inf, 0.0, by,
        )  # fmt: skip
    times = [of(rest, c, "random") / of(rest, c) for c in ("bias", "sd")]
    yield Claim(
        "Fig. 2, random states: PEM (from rest), bias and sd grow, times", "several", max(times),
        max(times) / np.sqrt(2 * runs), 2.0, np.inf, by,
    )  # fmt: skip
    spent = dict(
        zip(answer.timing["estimator"].tolist(), answer.timing["microseconds_a_run"].tolist(), strict=True)
    )
    yield Claim("4.3, time of PEM over the method's", "5–10", spent[rest] / spent["ls"], 0.0, 5, 10, by, 0)


def mean_absolute(runs: int) -> tuple[float, float]:
    """Bias of `ls` in % at 60 % noise of the mean of |y|, and its Monte Carlo error."""
    y = setting(0.0).y[0]
    level = 0.6 * float(np.mean(np.abs(y)) / np.sqrt(np.mean(y**2)))
    found = studied([level], ("ls",), runs)
    bias = found.bias.reshape(-1) / TRUE
    size = np.sqrt(np.mean(bias**2))
    slope = bias / (3 * size)
    return 100 * float(size), 100 * float(np.sqrt(np.sum((slope * found.bias_mcse.reshape(-1) / TRUE) ** 2)))


def one_coefficient(runs: int, lag: int) -> tuple[list[float], float]:
    """Bias at NSR 0 and 60 %, and sd at 60 %, of PEM with y_k + f1 y_k-1 + f2 y_k-2 = b u_k-lag; in %."""
    bias = []
    for nsr, count in ((0.0, 1), (0.6, runs)):
        records = [setting(nsr, k) for k in range(count)]
        theta = np.array([pem.converted(pem.fitted(r, (lag,)), r.dt, "logarithm") for r in records])
        bias.append(pem.rms(theta.mean(axis=0) - 1))
    return bias, pem.rms(theta.std(axis=0))


def setting(nsr: float, replicate: int = 0) -> mf.Record:
    """A record of the report's example."""
    return mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=61,
        replicate=replicate,
    )  # fmt: skip


def studied(nsr: list[float], estimators: object, runs: int, **options: object) -> mf.Results:
    """A study in the report's setting."""
    return mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr,
        estimators=estimators if isinstance(estimators, dict) else list(estimators), replicates=runs, seed=62,
        **(OWN | options if not isinstance(estimators, dict) else {}),
    ).run(threads=2, progress=False, coverage=False)  # fmt: skip


def _relative(found: mf.Results) -> np.ndarray:
    """Root mean square error of each estimator, rms over the parameters, over the true values."""
    return np.sqrt(np.mean((found.rmse.reshape(-1, 3) / TRUE) ** 2, axis=1))


def section_4(runs: int) -> Iterator[Claim]:
    """Sections 4.3 to 4.5: numbers of the setting, rules, bands, convergence, reduction."""
    by = "`make validate ONLY=report`"
    yield Claim("4.3, highest frequency (M + n)ω₀, Hz", "0.8", (6 + 2) / 10, 0.0, 0.8, 0.8, by)
    yield Claim("4.3, share of the harmonics used, %", "≈ 6", 100 * 8 / 128, 0.0, 5.5, 6.5, by)
    rules = ("staircase", "trapezoid", "parabolic")
    several = {r: mf.Estimator(TF2, method="ls", **(OWN | {"rule": r})) for r in rules}
    each = _relative(studied([0.2], several, runs))
    yield Claim(
        "4.3, error by the worst of the three rules over the best, `ls`, NSR 20 %", "very little difference",
        max(each) / min(each), 1.5 / np.sqrt(runs), 1.0, 1.1, by,
    )  # fmt: skip
    ms = (6, 12, 20, 40)
    wide = {
        method: studied(
            [0.2], {f"{m}": mf.Estimator(TF2, method=method, **(OWN | {"harmonics": m})) for m in ms}, runs
        )
        for method in ("ls", "awls")
    }
    worse = {k: float(_relative(r)[-1] / _relative(r)[0]) for k, r in wide.items()}
    for method, said, low, high in (("awls", "insensitive", 0.0, 1.1), ("ls", "sensitive", 1.5, np.inf)):
        yield Claim(
            f"4.3 (note 8), error of `{method}` at M = 40 over M = 6, NSR 20 %", said, worse[method],
            worse[method] / np.sqrt(runs), low, high, by,
        )  # fmt: skip
    awls = studied([0.05, 0.2, 0.6], ("awls",), runs)
    failed = awls.failures.sum() + awls.status["maxiter"].sum()
    yield Claim(
        f"4.4, `awls` that failed to converge, of {3 * runs:,}", "never", float(failed), 0.0, 0, 0, by, 0
    )
    yield Claim(
        "4.4, iterations of `awls` to 1e-9, mean at NSR 20 %",
        "fast",
        float(awls.nit[1, 0]),
        0.0,
        0,
        12,
        by,
        1,
    )
    ratios = []
    for seed in range(10):
        for order in (2, 3):
            this, balanced = mf.reduce(random_system(seed=seed), order).errors["h2"]
            ratios.append(this / balanced)
    classic = mf.reduce(mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24]), 2).errors["h2"]
    worst = max(*ratios, classic[0] / classic[1])
    words = "at least as good"
    yield Claim("4.5, H2 error over balanced reduction's, worst of 21", words, worst, 0.0, 0, 1 + 1e-9, by, 4)
    share = 100 * float(np.mean(np.array(ratios) < 0.999))
    yield Claim(
        "4.5, better than it by over 0.1 %, % of 20 random systems", "usually", share, 0.0, 50, 100, by, 0
    )


def section_410(runs: int) -> Iterator[Claim]:
    """Collinearity, a noisy signal that is dropped, sinusoids beside Yule–Walker."""
    import feedback_collinearity as feedback
    import nonlinear
    import sinusoids
    from fit_studies import Study

    clean = feedback.loop(0.2)
    dt = feedback.DURATION / feedback.INTERVALS
    shown = mf.collinearity(mf.Record(y=clean[0], u=clean[1], dt=dt), TF2, band=12.0)
    share = float(shown.table["collinearity"].max())
    yield Claim(
        "4.10, collinearity of the feedback study, %",
        "about 95",
        share,
        0.0,
        94,
        96,
        "`python examples/feedback_collinearity.py`",
        1,
    )
    rng = np.random.default_rng(63)
    sigma = 0.05 * np.sqrt(np.mean(clean**2, axis=1))
    for word, level in (("y", [1.0, 0.0]), ("y and u", [1.0, 1.0])):
        data = clean + (sigma * level)[:, None] * rng.standard_normal((2000, *clean.shape))
        many = mf.fit_many(mf.Batch(y=data[:, :1], u=data[:, 1:], dt=dt), TF2, progress=False)
        square = np.mean((many.params[many.success] / TRUE - 1) ** 2, axis=1)
        value = float(np.sqrt(square.mean()))
        error = float(square.std() / np.sqrt(square.size) / (2 * value))
        yield Claim(
            f"4.10, error at that collinearity, 5 % noise on {word}, %", "about 5", 100 * value, 100 * error, 0.0, 5.5,
            "`python examples/feedback_collinearity.py`", 2,
        )  # fmt: skip
    t, _, _, states = nonlinear.aircraft_record()
    rms, count = np.sqrt(np.mean(states**2, axis=1)), min(runs // 50, 300)
    held = nonlinear.aircraft(params={"Zd": nonlinear.SHORT["Zd"], "Za": mf.Free(-1.0, min=-5.0, max=5.0)})

    def error_of(model: object, kept: list[int], level: np.ndarray, names: list[str]) -> float:
        found = Study(
            model, nonlinear.SHORT, states[kept], t[1], level, (names, ["de"]), count, nonlinear.elevator(t), trend=None,
            method="ls",
        )  # fmt: skip
        bias, _, sd = found.relative()
        return float(np.hypot(bias, sd))

    both = error_of(held, [0, 1], np.array([1.0, 0.05]) * rms, ["alpha", "q"])
    alone = error_of(held.without("alpha"), [1], 0.05 * rms[1:], ["q"])
    yield Claim(
        "4.10, `ls`: error without a signal as noisy as it is large over the error with it", "enhanced", alone / both,
        alone / both / np.sqrt(count), 0, 1, "`python benches/nonlinear.py dropping`",
    )  # fmt: skip
    held_word = "4.10, combinations of Za, Zδ, Mα, Mq, Mδ that q alone tells, of 5"
    rank = str(nonlinear.aircraft().without("alpha").identifiable())
    yield Claim(
        held_word, "not all", float(rank.split()[0]), 0.0, 1, 4, "`python benches/nonlinear.py dropping`", 0
    )
    pair = sinusoids.Pair(64, (0.20, 0.22), sinusoids.db(10), replicates=300)
    found = pair.modfun()
    ours = pair.ratio(found.omega)
    theirs = pair.ratio(np.array([sinusoids.hoyw(y, 2) for y in pair.y]))
    yield Claim(
        "4.10, sinusoids: error over that of high-order Yule–Walker, 64 samples, 10 dB", "better", ours / theirs,
        ours / theirs / np.sqrt(600), 0, 1, "`python benches/sinusoids.py accuracy`",
    )  # fmt: skip


def flights() -> Iterator[Claim]:
    """Section 4.7: S/E in dB, theoretical models with noise, and flight records that are not the report's."""
    import f18_theoretical as theory

    matrices = json.loads(
        (problems.FOLDER / "f18_polynomial_model" / "f18_poly_and_linear_5deg.json").read_text()
    )
    lon, _ = theory.longitudinal(problems.FOLDER, matrices["lon"])
    lat = theory.lateral(problems.FOLDER, matrices["lat"])
    for kind, clean, poles in (("longitudinal", lon, 2), ("lateral", lat, 4)):
        low, high = theory.REPORT[kind]
        estimator = mf.Estimator(
            mf.TransferFunction(poles=poles, denominator="common"), band=theory.BANDS[kind]
        )
        for level in (0.05, 0.2):
            found = []
            for seed in range(20):
                fit = estimator(theory.noisy(clean, level, seed))
                found.append(theory.score(clean, fit.predict, theory.noisy(clean, level, seed)))
            for name, values in zip(clean.outputs, np.transpose(found), strict=True):
                yield Claim(
                    f"F-18, theoretical, {kind}, {name}, {100 * level:.0f} % noise, dB", f"{low:g}–{high:g}", float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values))), low, np.inf,
                    "`python examples/records/f18_theoretical.py`", 1,
                )  # fmt: skip
    rec = mf.read(
        problems.FOLDER / "f18harv_lon_153b" / "f18harv_153b.csv",
        outputs=["alpha_deg", "q_dps"],
        inputs=["stab_deg"],
    )
    for poles in (2, 3):
        score = mf.fit(rec, mf.TransferFunction(poles=poles, denominator="common")).score()
        for name, value in zip(("α", "q"), score["signal_to_error"], strict=True):
            yield Claim(
                f"F-18 flight, longitudinal, {name}, order {poles}, dB", "8–12", float(value), 0.0, 8, np.inf,
                "`python examples/records/f18_longitudinal.py`", 1,
            )  # fmt: skip
