"""Fits under process noise beside the bound of the exact likelihood: the table of docs/howto/turbulence.md.

Usage: python benches/process.py [--records 1000] [--write]
"""

import argparse
import sys
import warnings
from pathlib import Path

import modfun as mf
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "python"))

from oracle import process_noise as oracle  # noqa: E402
from oracle.systems import simulate  # noqa: E402

PAGE, MARK = ROOT / "docs" / "howto" / "turbulence.md", "<!-- process -->"
DEN, NUM, TRUTH = [1.0, 3.0, 8.0], [[5.0]], np.array([3.0, 8.0, 5.0])
MODEL = mf.TransferFunction(poles=2, zeros=0)
LEVELS = ((0.2, 0.1), (0.3, 0.03), (0.05, 0.1))
AIRCRAFT = {"Za": -1.2, "Ma": -4.0, "Mq": -1.6, "Zd": -0.1, "Md": -6.0}
SHORT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
GUSTY = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zd", "Za"], ["Md", "Ma"]], states=["alpha", "q"], inputs=["de", "gust"]
)
ELEVATOR = "0.02*(sign(sin(0.9*t)) + sign(sin(1.7*t + 1)))"


class Plant:
    """Records of y'' + 3y' + 8y = 5u + w, by the response to w and the sensor's noise over rms of y."""

    def __init__(self, process, sensor, constants):
        self.duration, self.intervals = {15: (10.0, 256), 150: (100.0, 1280)}[constants]
        self.name = f"y'' + 3y' + 8y = 5u, process {100 * process:.3g} %, sensor {100 * sensor:.3g} %, "
        self.name += f"{constants} time constants"
        self.dt = self.duration / self.intervals
        chirp = [lambda t: np.sin(t**2 / self.duration * 2)]
        self.clean, self.inputs = simulate(DEN, NUM, chirp, self.dt, self.intervals)
        rms = np.sqrt(np.mean(self.clean**2))
        self.density, self.sigma = (process * rms / oracle.spread(DEN)) ** 2, sensor * rms
        self.levels = [self.sigma, np.sqrt(self.density)]
        self.bound = oracle.bound(
            DEN, NUM, chirp, max(self.density, 1e-12), self.sigma, self.dt, self.intervals,
            lambda x: ([1.0, *x[:2]], [[x[2]]]), offset=True,
        )  # fmt: skip
        self.scale = np.sqrt(np.diag(self.bound))[:3] if process else None
        self.truth, self.model, self.plain, self.noise = TRUTH, MODEL, MODEL, "process"

    def record(self, seed):
        rng = np.random.default_rng(seed)
        y = self.clean + self.sigma * rng.standard_normal(self.intervals + 1)
        if self.density:
            y = y + oracle.drawn(DEN, self.density, self.dt, self.intervals, rng)
        return mf.Record(y=y, u=self.inputs[0], dt=self.dt, intersample="smooth")


class Aircraft:
    """Records of a short period, 50 samples a second, in white noise of both equations or in gusts."""

    def __init__(self, duration, tau=None):
        self.duration = duration
        self.plain, self.truth = SHORT, np.array(list(AIRCRAFT.values()))
        if tau is None:
            self.name = f"short period, white noise in both equations, {duration:g} s"
            self.process, self.system, self.sensors = [0.0032, 0.02], SHORT, [0.002, 0.004]
            self.noise, self.model = "process", SHORT
            self.levels = [*self.sensors, *self.process]
        else:
            self.name = f"short period, Dryden's gusts of {tau:g} s, {duration:g} s"
            self.process, self.system = mf.ProcessNoise(gust=mf.dryden(tau, 0.01)), GUSTY
            self.noise, self.model = mf.ProcessNoise(gust=mf.dryden(tau)), GUSTY
            self.sensors = [0.001, 0.002]
            self.levels = [*self.sensors, 0.01]
        still = mf.simulate(
            SHORT.model(AIRCRAFT), input=ELEVATOR, duration=duration, intervals=round(50 * duration),
            intersample="zoh", inputs=["de"],
        )  # fmt: skip
        bound = mf.crlb(
            self.model, still, params=AIRCRAFT, sigma=self.sensors, process_noise=self.process,
            trend="constant",
        )  # fmt: skip
        self.scale = np.array([bound[name] for name in AIRCRAFT])

    def record(self, seed):
        clean = mf.simulate(
            self.system.model(AIRCRAFT), input=ELEVATOR, duration=self.duration,
            intervals=round(50 * self.duration), intersample="zoh", process_noise=self.process, seed=seed,
        )  # fmt: skip
        noise = np.array(self.sensors)[:, None] * np.random.default_rng(seed).standard_normal(clean.y.shape)
        return mf.Record(
            y=clean.y + noise, u=clean.u, dt=clean.dt, intersample="zoh", outputs=["alpha", "q"],
            inputs=["de"],
        )  # fmt: skip


def places(fit):
    """Where the parameters stand in the order of the truth."""
    names = AIRCRAFT if len(fit.param_names) == len(AIRCRAFT) else fit.param_names
    return [fit.param_names.index(name) for name in names]


def row(case, count):
    """A line of the table: errors, bias, coverage, levels."""
    errors, plain, inside, inside_plain, levels, lost = [], [], [], [], [], 0
    for seed in range(count):
        rec = case.record(seed)
        fit = mf.fit(rec, case.model, noise=case.noise)
        order = places(fit)
        lost += fit.status != "ok"
        errors.append(fit.params[order] - case.truth)
        inside.append(contains(fit.conf_int()[order], case.truth))
        levels.append(fit.process_noise()["level"])
        other = mf.fit_many([rec], case.plain)  # without looking for a cure each time
        plain.append(other.params[0][places(other)] - case.truth)
        inside_plain.append(contains(other.conf_int()[0][places(other)], case.truth))
    errors = np.array(errors)
    scale = case.scale if case.scale is not None else np.abs(case.truth) / 100
    rmse, other = (np.sqrt(np.mean(np.square(own), axis=0)) / scale for own in (errors, plain))
    unit = "" if case.scale is not None else " %"
    told = [f"{a:.2f} ({b:.2f}){unit}" for a, b in zip(rmse, other, strict=True)]
    mean = np.abs(errors.mean(axis=0))
    bias = f"{np.max(mean / errors.std(axis=0)):.2f} ({100 * np.max(mean / np.abs(case.truth)):.2f} %)"
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.mean(np.square(levels), axis=0)) / case.levels
    found = ", ".join(f"{own:.2f}" if np.isfinite(own) else "–" for own in ratio)
    covered = f"{covers(inside)} ({covers(inside_plain)}) %"
    return f"| {case.name} | {', '.join(told)} | {bias} | {covered} | {found} | {lost} |"


def contains(interval, truth):
    """Whether the interval of each parameter contains the true value."""
    return (interval[:, 0] < truth) & (truth < interval[:, 1])


def covers(inside):
    """The least and the greatest coverage of a parameter, %."""
    cover = 100 * np.mean(inside, axis=0)
    return f"{cover.min():.1f} to {cover.max():.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=1000)
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    given = parser.parse_args()
    warnings.simplefilter("ignore", mf.ModfunWarning)
    cases = [
        *(Plant(process, sensor, n) for n in (15, 150) for process, sensor in LEVELS),
        Plant(0.0, 0.1, 15), Aircraft(15.0), Aircraft(60.0), Aircraft(15.0, 1.0), Aircraft(15.0, 3.0),
        Aircraft(60.0, 1.0),
    ]  # fmt: skip
    lines = [
        f"{given.records:,} records per row, {given.records // 3:,} for state spaces.",
        "",
        "| system and noise | error of each parameter (of the default) "
        "| largest bias over sd (of the parameter) | intervals cover (of the default) "
        "| levels over the true ones | not settled |",
        "|---|---|---|---|---|---|",
    ]
    for case in cases:
        # State spaces take a hundred times as long.
        lines.append(row(case, given.records if isinstance(case, Plant) else given.records // 3))
        print(lines[-1], flush=True)
    if given.write:
        text = PAGE.read_text()
        before, _, rest = text.partition(MARK)
        after = rest.partition("\nWithout process noise")[2]
        PAGE.write_text(f"{before}{MARK}\n\n" + "\n".join(lines) + f"\n\nWithout process noise{after}")


if __name__ == "__main__":
    main()
