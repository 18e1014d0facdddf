"""The public calls with arguments that suit them, to be spoilt."""
# ruff: noqa: E501  (a call a line)

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, wraps
from importlib.util import find_spec
from typing import Any

import modfun as mf
import numpy as np

N = 65  # samples of a record: enough for two poles, few enough for a million fits


@dataclass(frozen=True)
class Call:
    """A public call.

    Attributes
    ----------
    name : str
    function : callable
    given : callable
        Makes arguments, by name, that the call accepts.
    names : tuple of str
        Arguments that may be spoilt or added: all of the signature.
    cost : float
        Typical time of a case, ms; dear calls are drawn less often.
    """

    name: str
    function: Callable[..., Any]
    given: Callable[[], Mapping[str, Any]]
    names: tuple[str, ...]
    cost: float


def _call(
    name: str, function: Callable[..., Any], cost: float = 1.0, given: Callable[[], Mapping[str, Any]] = dict
) -> Call:
    known = inspect.signature(function).parameters.values()
    named = tuple(p.name for p in known if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY))
    if name.split(".")[-1] in TAKES_OPTIONS:
        named += OPTIONS
    return Call(name, function, given, named, cost)


OPTIONS = (
    "method", "band", "harmonics", "trend", "noise", "cov_type", "output_weights",
    "correct", "rule", "extended", "tol", "maxiter",
)  # fmt: skip
TAKES_OPTIONS = ("fit_many", "Estimator", "collinearity", "select_order")
SILENT = {"progress": False}


@cache
def system() -> mf.LTI:
    return mf.tf([5], [1, 3, 8])


@cache
def record() -> mf.Record:
    return mf.simulate(system(), input="sin(t**2/5)", duration=10.0, intervals=N - 1, nsr=0.05, seed=3)


@cache
def two() -> mf.Record:
    """Two outputs, two inputs."""
    plant = mf.ss([[-1.0, 0.5], [-2.0, -0.7]], np.eye(2), np.eye(2), np.zeros((2, 2)))
    return mf.simulate(
        plant, input=["sin(t**2/5)", "cos(t)"], duration=10.0, intervals=N - 1, nsr=0.05, seed=3
    )


@cache
def structure() -> mf.TransferFunction:
    return mf.TransferFunction(poles=2, zeros=0)


@cache
def fitted() -> mf.Fit:
    return mf.fit(record(), structure())


@cache
def fitted_two() -> mf.Fit:
    return mf.fit(two(), mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="separate"))


@cache
def equation() -> mf.Equation:
    return mf.Equation("y'' + d*y' + a*y + c*y**3 = b*u")


@cache
def fitted_equation() -> mf.Fit:
    return mf.fit(record(), equation(), method="ls")


@cache
def state_space() -> mf.StateSpace:
    return mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"])


@cache
def study() -> mf.MonteCarlo:
    return mf.MonteCarlo(**_study())


@cache
def results() -> mf.Results:
    return study().run(threads=1, progress=False, keep="samples")


@cache
def response() -> mf.FrequencyResponse:
    return mf.frf(record(), threads=1, progress=False)


@cache
def tones() -> mf.Sinusoids:
    return mf.sinusoids(record(), 2, threads=1, progress=False)


@cache
def reduction() -> mf.Reduction:
    return mf.reduce(mf.tf([1, 2], [1, 3, 5, 7]), 2)


@cache
def lagged() -> mf.timelag.DelaySystem:
    return mf.timelag.DelaySystem(A={0: -1.0, 0.5: 0.3}, B={0.0: 1.0})


@cache
def design() -> Any:
    return lagged().place([-2.0])


@cache
def estimator() -> mf.Estimator:
    return mf.Estimator(structure(), band=6.0)


@cache
def stream() -> mf.Stream:
    found = mf.Stream(estimator(), dt=record().dt, window=5.0)
    found.push(record().y, record().u)
    return found


@cache
def batch() -> mf.Batch:
    return mf.Batch(y=np.stack([record().y, 1.1 * record().y]), u=record().u, dt=record().dt)


def _study() -> dict[str, Any]:
    return {
        "system": system(), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 40, "nsr": 0.1,
        "estimators": ["ls"], "harmonics": 6, "replicates": 3, "seed": 1,
    }  # fmt: skip


def _samples(*shape: int) -> Any:
    return np.sin(0.3 * np.arange(float(np.prod(shape))) ** 1.3).reshape(shape)


def _parts() -> dict[str, Any]:
    return {"y": _samples(N), "u": _samples(N), "dt": 0.1}


def _frame() -> dict[str, Any]:
    return {"t": 0.1 * np.arange(N), "y": _samples(N), "u": _samples(N)}


def _columns_written(table: mf.Table) -> Any:
    return table.to_dict(), repr(table), table._repr_html_()


def _pushed(**given: Any) -> Any:
    live = mf.Stream(estimator(), dt=record().dt, window=5.0)
    live.push(record().y[:, :40], record().u[:, :40])
    live.push(**given)
    return live.fit() if live.ready else None


def _record_shown(**given: Any) -> Any:
    rec = mf.Record(**given)
    rec.check(), rec.spectrum(), repr(rec)
    return rec


def _gains(**given: Any) -> None:
    fitted().frequency_response(**given)  # infinite at a pole, so nothing is to be looked at


def _fitted(y: Any, u: Any, dt: Any, **options: Any) -> Any:
    fit = mf.fit(mf.Record(y=y, u=u, dt=dt), structure(), **options)
    str(fit.summary()), fit.check(), fit.damp(), fit.conf_int(), fit.score()
    return fit


def _fitted_two(y: Any, u: Any, dt: Any, **options: Any) -> Any:
    fit = mf.fit(mf.Record(y=y, u=u, dt=dt), mf.TransferFunction(poles=1, zeros=0), **options)
    str(fit.summary())
    return fit


def _fitted_equation(y: Any, u: Any, dt: Any, **options: Any) -> Any:
    return mf.fit(mf.Record(y=y, u=u, dt=dt), equation(), **options)


def _both(data: Any) -> dict[str, Any]:
    return {"data": data, "model": structure()}


@cache
def calls() -> tuple[Call, ...]:
    """Every public call that computes, with arguments that suit it."""
    rec, fit = record, fitted
    w = np.linspace(0.5, 5.0, 7)
    table = [
        _call("Record", mf.Record, 0.05, _parts),
        _call("Record of times", mf.Record, 0.05, lambda: {"y": _samples(2, N), "t": 0.1 * np.arange(N)}),
        _call("Record of all", mf.Record, 0.1, lambda: {
            "y": _samples(2, N), "u": _samples(2, N), "fs": 10.0, "outputs": ["p", "q"], "inputs": ["a", "b"],
            "units": {"q": "rad/s"}, "intersample": ["zoh", "smooth"], "keep": {"ev": np.zeros(N)},
            "mask": np.arange(N) != 7, "sigma": np.ones((2, N)),
        }),
        Call("Record.check", _record_shown, _parts, _call("", mf.Record).names, 3.0),
        _call("Batch", mf.Batch, 0.1, lambda: {"y": _samples(3, 1, N), "u": _samples(1, N), "dt": 0.1}),
        _call("Record.window", rec().window, 0.1, lambda: {"t0": 1.0, "t1": 5.0}),
        _call("Record.split", rec().split, 0.3, lambda: {"every": 5.0}),
        _call("Record.select", rec().select, 0.1, lambda: {"outputs": ["y"], "inputs": ["u"]}),
        _call("Record.weigh", rec().weigh, 0.1, lambda: {"mask": np.arange(N) != 3, "sigma": np.ones(N)}),
        Call("Record.assign", rec().assign, lambda: {"y": _samples(N), "units": {"y": "m"}}, ("y", "units", "z"), 0.1),
        _call("Record.noise_level", rec().noise_level, 0.2, lambda: {"order": 2}),
        Call("Record[]", rec().__getitem__, lambda: {"channel": "y"}, ("channel",), 0.01),
        _call("columns", mf.columns, 0.2, lambda: {"source": _frame()}),
        _call("read", mf.read, 0.2, lambda: {
            "source": _frame(), "outputs": ["y"], "inputs": {"de": "u"}, "time": "t"}),
        _call("coefficients", mf.coefficients, 0.2, lambda: {"rec": rec(), "harmonics": 8}),
        _call("regressors", mf.regressors, 0.5, lambda: {"rec": rec(), "model": structure(), "harmonics": 6}),
        _call("tf", mf.tf, 0.05, lambda: {"num": [5.0], "den": [1.0, 3.0, 8.0], "delay": 0.1}),
        _call("tf of two", mf.tf, 0.05, lambda: {"num": [[[1.0], [2.0, 1.0]]], "den": [1.0, 3.0, 8.0]}),
        _call("ss", mf.ss, 0.05, lambda: {
            "A": np.array([[-1.0, 0.5], [-2.0, -0.7]]), "B": np.eye(2), "C": np.eye(2), "D": np.zeros((2, 2))}),
        _call("LTI.frequency_response", system().frequency_response, 0.1, lambda: {"omega": w}),
        _call("LTI.step", system().step, 0.2, lambda: {"duration": 10.0, "intervals": 50}),
        _call("LTI.simulate", system().simulate, 0.2, lambda: {"u": _samples(N), "dt": 0.1}),
        _call("LTI.to_control", system().to_control, 0.3),
        _call("Free", mf.Free, 0.01, lambda: {"start": 1.0, "min": 0.0, "max": 5.0}),
        _call("Noise", mf.Noise, 0.03, lambda: {"y": np.array([1.0, 2.0]), "u": 0.1}),
        _call("TransferFunction", mf.TransferFunction, 0.05, lambda: {
            "poles": 2, "zeros": [1, None], "delay": [0.1, 0], "params": {"a1": 1.0}}),
        _call("TransferFunction of two", mf.TransferFunction, 0.05, lambda: {
            "poles": [2, 1], "zeros": [[1], [0]], "denominator": "separate"}),
        _call("TransferFunction.model", structure().model, 0.05, lambda: {"theta": np.array([1.0, 2.0, 3.0])}),
        _call("TransferFunction.param_names", structure().param_names, 0.02, lambda: {"inputs": ["u"]}),
        _call("Estimator", mf.Estimator, 0.05, lambda: {"model": structure(), "band": 6.0}),
        _call("simulate", mf.simulate, 0.5, lambda: {
            "sys": system(), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 64, "nsr": 0.1}),
        _call("simulate equation", mf.simulate, 2.0, lambda: {
            "sys": equation().model({"d": 1.0, "a": 2.0, "c": 0.1, "b": 1.0}),
            "input": "sin(t)", "duration": 3.0, "intervals": 32}),
        _call("Equation", mf.Equation, 3.0, lambda: {
            "text": "q'' + d*q' + k*sin(q) = b*de", "outputs": ["q"], "inputs": ["de"], "params": {"d": 0.5}}),
        _call("Equation of varying", mf.Equation, 3.0, lambda: {
            "text": "y'' + c(t)*y' + k*y = b*u", "varying": {"c": ["1", "t", "t**2"]}}),
        _call("StateSpace", mf.StateSpace, 5.0, lambda: {
            "A": [["Za", 1], ["Ma", "Mq"]], "B": [["Zd"], ["Md"]], "C": np.eye(2), "states": ["alpha", "q"]}),
        _call("fit", mf.fit, 3.0, lambda: _both(rec())),
        Call("fit of samples", _fitted, _parts, ("y", "u", "dt", *OPTIONS), 8.0),
        Call("fit of two", _fitted_two, lambda: {"y": two().y, "u": two().u, "dt": two().dt},
             ("y", "u", "dt", *OPTIONS), 8.0),
        Call("fit of an equation", _fitted_equation, _parts, ("y", "u", "dt", *OPTIONS), 8.0),
        _call("fit of a response", mf.fit, 3.0, lambda: _both(response())),
        _call("fit_many", mf.fit_many, 3.0, lambda: {**_both(batch()), "threads": 1, **SILENT}),
        _call("frf", mf.frf, 3.0, lambda: {"data": rec(), "omega": w, "threads": 1, **SILENT}),
        _call("FrequencyResponse", mf.FrequencyResponse, 0.1, lambda: {
            "omega": w, "response": np.exp(1j * w), "bse": np.full(7, 0.1)}),
        _call("FrequencyResponse of dB", mf.FrequencyResponse, 0.1, lambda: {
            "omega": w, "magnitude_db": -w, "phase_deg": -10 * w, "coherence": np.full(7, 0.9)}),
        _call("FrequencyResponse.select", response().select, 0.1, lambda: {"band": (1.0, 4.0)}),
        _call("FrequencyResponse.radius", response().radius, 0.1, lambda: {"level": 0.9}),
        _call("sinusoids", mf.sinusoids, 3.0, lambda: {"data": rec(), "count": 1, "threads": 1, **SILENT}),
        _call("sinusoids of samples", mf.sinusoids, 3.0, lambda: {
            "data": _samples(N), "count": 1, "dt": 0.1, "threads": 1, **SILENT}),
        _call("Sinusoids.conf_int", tones().conf_int, 0.1, lambda: {"level": 0.9}),
        _call("reduce", mf.reduce, 8.0, lambda: {"system": mf.tf([1, 2], [1, 3, 5, 7]), "structure": 2}),
        _call("select_order", mf.select_order, 20.0, lambda: {"data": rec(), "poles": [1, 2]}),
        _call("collinearity", mf.collinearity, 5.0, lambda: _both(rec())),
        _call("rank_test", mf.rank_test, 3.0, lambda: {"data": rec(), "poles": 3}),
        _call("common_poles", mf.common_poles, 1.0, lambda: {"fit": fitted_two()}),
        _call("compare", mf.compare, 3.0, lambda: {"models": {"one": fit()}, "rec": rec()}),
        _call("cross_validate", mf.cross_validate, 20.0, lambda: {
            "records": [rec(), rec()], "estimators": {"one": structure()}}),
        _call("crlb", mf.crlb, 4.0, lambda: {"sys": system(), "experiment": rec(), "nsr": 0.1}),
        _call("crlb of a structure", mf.crlb, 4.0, lambda: {
            "sys": structure(), "experiment": rec(), "sigma": 0.1, "params": {"a1": 3.0, "a2": 8.0, "b0": 5.0}}),
        _call("bootstrap", mf.bootstrap, 5.0, lambda: {
            "fit": fit(), "replicates": 10, "threads": 1, **SILENT}),
        _call("Stream", mf.Stream, 1.0, lambda: {"estimator": estimator(), "dt": 0.1, "window": 5.0}),
        Call("Stream.push", _pushed, lambda: {"y": _samples(1, 20), "u": _samples(1, 20)}, ("y", "u"), 3.0),
        _call("Stream.follow", stream().follow, 5.0, lambda: {"rec": rec(), "every": 16, **SILENT}),
        _call("MonteCarlo", mf.MonteCarlo, 1.0, _study),
        _call("MonteCarlo.run", study().run, 4.0, lambda: {"threads": 1, **SILENT}),
        Call("Results.replicate", results().replicate, lambda: {"number": 1}, ("number", "system", "nsr"), 3.0),
        _call("Fit.conf_int", fit().conf_int, 0.1, lambda: {"level": 0.9}),
        _call("Fit.cov_params", fit().cov_params, 0.1, lambda: {"cov_type": "HC3"}),
        _call("Fit.table", fit().table, 0.3, lambda: {"level": 0.9, "units": {"y": "m"}}),
        Call("Fit.derived", fit().derived, lambda: {"wn": "sqrt(a2)", "z": "a1/2"}, ("wn", "z"), 0.5),
        _call("Fit.predict", fit().predict, 2.0, lambda: {"rec": rec(), "initial_state": "zero"}),
        _call("Fit.errors", fit().errors, 2.0, lambda: {"rec": rec()}),
        _call("Fit.score", fit().score, 2.0, lambda: {"rec": rec()}),
        _call("Fit.initial_state", fit().initial_state, 2.0, lambda: {"rec": rec(), "method": "observer"}),
        Call("Fit.frequency_response", _gains, lambda: {"omega": w}, ("omega",), 0.3),
        _call("Fit.path_model", fit().path_model, 0.1, lambda: {"output": "y"}),
        _call("Fit.predict of an equation", fitted_equation().predict, 5.0, lambda: {"rec": rec()}),
        Call("Fit[]", fit().__getitem__, lambda: {"name": "a1"}, ("name",), 0.01),
        _call("timelag.DelaySystem", mf.timelag.DelaySystem, 0.1, lambda: {
            "A": {0: np.array([[0.0, 1.0], [-2.0, -1.0]]), 1.0: np.eye(2) * 0.1},
            "B": {0.4: np.array([0.0, 1.0])}, "C": np.eye(2), "states": ["a", "b"]}),
        _call("DelaySystem.poles", lagged().poles, 5.0, lambda: {"count": 5}),
        _call("DelaySystem.frequency_response", lagged().frequency_response, 0.2, lambda: {"omega": w}),
        _call("DelaySystem.transformation", lagged().transformation, 5.0, lambda: {"count": 8}),
        _call("DelaySystem.place", lagged().place, 5.0, lambda: {"poles": [-2.0]}),
        _call("DelaySystem.lqr", lagged().lqr, 5.0, lambda: {"Q": np.eye(1), "R": np.eye(1)}),
        _call("DelaySystem.simulate", lagged().simulate, 5.0, lambda: {"K": design(), "duration": 3.0, "dt": 0.1}),
        _call("DelaySystem.mu", lagged().mu, 20.0, lambda: {"K": design()}),
        _call("timelag.Uncertainty", mf.timelag.Uncertainty, 0.1, lambda: {"A": {0: 0.1}}),
        _call("timelag.equation", mf.timelag.equation, 5.0, lambda: {"A": {0: "a", 1.0: "b"}, "B": {0.5: "c"}}),
        _call("signals.Signals", mf.signals.Signals, 0.05, lambda: {"u": _samples(2, N), "dt": 0.1}),
        _call("signals.chirp", mf.signals.chirp, 0.3, lambda: {"band": (0.5, 5.0), "duration": 10.0, "dt": 0.1}),
        _call("signals.doublet", mf.signals.doublet, 0.1, lambda: {"dt": 0.1, "width": 1.0}),
        _call("signals.multistep", mf.signals.multistep, 0.1, lambda: {"dt": 0.1, "unit": 1.0}),
        _call("signals.multisine", mf.signals.multisine, 20.0, lambda: {
            "inputs": ["a", "b"], "band": (0.6, 6.0), "duration": 10.0, "dt": 0.1}),
        _call("signals.prbs", mf.signals.prbs, 0.2, lambda: {"dt": 0.1, "clock": 0.5, "duration": 10.0}),
        _call("rivals.arx", mf.rivals.arx, 0.02, lambda: {"model": structure()}),
        _call("rivals.output_error", mf.rivals.output_error, 0.02, lambda: {"model": structure()}),
        _call("rivals.pem", mf.rivals.pem, 0.02, lambda: {"model": structure()}),
        _call("Table", mf.Table, 0.05, lambda: {"columns": {"a": [1, 2], "b": ["x", "y"]}, "title": "t"}),
    ]  # fmt: skip
    return (*table, *_plots())


def _plots() -> list[Call]:
    """`mf.plot`, where matplotlib is installed; figures are closed."""
    if find_spec("matplotlib") is None:
        return []
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    def bode(system: Any, band: Any = None, hz: Any = False, labels: Any = None, ax: Any = None) -> Any:
        return mf.plot.bode(system, band=band, hz=hz, labels=labels, ax=ax)

    def poles(fit: Any, labels: Any = None, ax: Any = None) -> Any:
        return mf.plot.poles(fit, labels=labels, ax=ax)

    def drawn(name: str, draw: Callable[..., Any], key: str, thing: Callable[[], Any]) -> Call:
        @wraps(draw)
        def call(**given: Any) -> None:
            try:
                draw(**given)
            finally:
                pyplot.close("all")

        return _call(f"plot.{name}", call, 40.0, lambda: {key: thing()})

    fits = ("correlation", "harmonics", "residual_tests", "residuals", "response")
    return [
        drawn("bode", bode, "system", fitted),
        drawn("poles", poles, "fit", fitted),
        *(drawn(name, getattr(mf.plot, name), "fit", fitted) for name in fits),
        drawn("record", mf.plot.record, "rec", record),
        drawn("reduction", mf.plot.reduction, "red", reduction),
        drawn("signals", mf.plot.signals, "given", lambda: mf.signals.doublet("de", dt=0.1, width=1.0)),
        drawn("sinusoids", mf.plot.sinusoids, "found", tones),
        drawn("spectrum", mf.plot.spectrum, "spec", lambda: record().spectrum()),
        drawn("study", mf.plot.study, "res", results),
    ]
