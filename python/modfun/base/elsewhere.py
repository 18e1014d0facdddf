"""Attributes asked for by their name in other packages: the error says what they are called here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

__all__ = ["FIT", "FITS", "PACKAGE", "RECORD", "STUDY", "SYSTEM", "TERMS", "Elsewhere"]

# Name in statsmodels, SciPy, python-control, MATLAB or lmfit, and what to write here.
_PARAMETERS = {
    **dict.fromkeys(("estimate", "coef", "coef_", "x", "theta", "values", "popt"), "params"),
    **dict.fromkeys(("se", "std", "stderr", "stderrs", "std_errors", "standard_errors"), "bse"),
    **dict.fromkeys(("ci", "confint", "confidence_interval", "confidence_intervals"), "conf_int()"),
    **dict.fromkeys(("parameters", "names"), "params (values) or param_names"),
}
FIT: Mapping[str, str] = {
    **_PARAMETERS,
    **dict.fromkeys(("cov", "covariance", "vcov", "pcov", "covar"), "cov_params()"),
    **dict.fromkeys(("corr", "correl"), "correlation()"),
    **dict.fromkeys(("pvalues", "p_values", "tvalues"), "table(pvalues=True)"),
    **dict.fromkeys(("poles", "pole", "eigenvalues"), "model.poles(), or damp()"),
    **dict.fromkeys(("zeros", "zero"), "model.zeros()"),
    **dict.fromkeys(("gain", "dcgain"), "model.dcgain()"),
    **dict.fromkeys(("num", "numerator"), "model.num"),
    **dict.fromkeys(("den", "denominator"), "model.den"),
    **dict.fromkeys(("A", "B", "C", "D", "to_ss"), "model.to_ss()"),
    **dict.fromkeys(("tf", "sys", "system", "transfer_function"), "model"),
    **dict.fromkeys(("resid", "residual"), "residuals (lines), or errors() (samples)"),
    **dict.fromkeys(("fittedvalues", "fitted", "y_hat", "yhat", "best_fit"), "predict()"),
    **dict.fromkeys(("rsquared", "r2", "fit_percent", "nrmse"), "score()"),
    **dict.fromkeys(("bode_plot",), "plot_bode(), or bode()"),
    **dict.fromkeys(("step", "step_response"), "model.step()"),
    **dict.fromkeys(("x0", "initial_conditions"), "initial_state()"),
    **dict.fromkeys(("warnings", "doubts"), "check()"),
    "bootstrap": "mf.bootstrap(fit)",
    "collinearity": "mf.collinearity(rec, fit)",
    **dict.fromkeys(("c2d", "sample"), "mf.c2d(fit.model, dt)"),
    **dict.fromkeys(("margin", "nyquist"), "mf.plot.nyquist(fit)"),
    "compare": "mf.compare([fit, ...])",
    "crlb": "mf.crlb(fit.model, rec, ...)",
    "cross_validate": "mf.cross_validate(records, models)",
}
FITS: Mapping[str, str] = {
    **_PARAMETERS,
    **dict.fromkeys(("to_csv", "save", "dump", "to_json"), "to_pandas().to_csv(path), a row per record"),
    **dict.fromkeys(("summary", "mean"), "table()"),
    **dict.fromkeys(("samples", "replicates", "draws", "estimates"), "params, (replicate, parameter)"),
    **dict.fromkeys(("df", "to_dataframe"), "to_pandas()"),
}
STUDY: Mapping[str, str] = {
    **dict.fromkeys(
        ("to_csv", "to_markdown", "to_latex"), "table().to_csv(path), .to_markdown() or .to_latex()"
    ),
    **dict.fromkeys(("summary", "mean", "conf_int"), "table()"),
    **dict.fromkeys(("parameters", "names"), "param_names"),
    **dict.fromkeys(("estimates", "params"), "samples, kept by MonteCarlo.run(keep='samples')"),
    **dict.fromkeys(("df", "to_dataframe"), "to_pandas()"),
    **dict.fromkeys(("std", "se", "stderr"), "sd"),
    **dict.fromkeys(("save", "dump", "to_json"), "MonteCarlo.run(directory=), which mf.load reads again"),
}
TERMS: Mapping[str, str] = {  # of pySINDy
    **{name: f"fit.{name}" for name in ("predict", "score", "simulate", "params", "bse", "check", "table")},
    **dict.fromkeys(("coefficients", "coef", "coef_"), "fit.params"),
    **dict.fromkeys(("print", "equations"), "equation.texts"),
    **dict.fromkeys(("get_feature_names", "feature_names"), "terms"),
}
RECORD: Mapping[str, str] = {
    **dict.fromkeys(("time", "times"), "t"),
    **dict.fromkeys(("Ts", "ts", "sample_time", "period"), "dt"),
    **dict.fromkeys(("fs", "rate", "sample_rate"), "dt, whose inverse it is"),
    **dict.fromkeys(("input", "input_names", "InputName"), "inputs (names) or u (samples)"),
    **dict.fromkeys(("output", "output_names", "OutputName"), "outputs (names) or y (samples)"),
    **dict.fromkeys(("df", "to_dataframe"), "to_pandas()"),
    **dict.fromkeys(("detrend", "demean"), "mf.fit(..., trend=)"),
}
SYSTEM: Mapping[str, str] = {
    **dict.fromkeys(("pole",), "poles()"),
    **dict.fromkeys(("zero",), "zeros()"),
    **dict.fromkeys(("numerator",), "num"),
    **dict.fromkeys(("denominator",), "den"),
    **dict.fromkeys(("damp", "damping"), "mf.plot.poles(system), or poles()"),
    **dict.fromkeys(("bode", "bode_plot"), "mf.plot.bode(system)"),
    **dict.fromkeys(("nyquist", "nyquist_plot"), "mf.plot.nyquist(system)"),
    **dict.fromkeys(("freqresp", "frequency_response_data", "evalfr"), "frequency_response(omega)"),
    **dict.fromkeys(("step_response",), "step()"),
    **dict.fromkeys(("impulse_response",), "impulse()"),
    **dict.fromkeys(("lsim", "forced_response", "output"), "simulate()"),
    **dict.fromkeys(("sample", "c2d"), "mf.c2d(system, dt)"),
}

# Functions of MATLAB.
PACKAGE: Mapping[str, str] = {
    "iddata": "mf.Record, or mf.read",
    **dict.fromkeys(("tfest", "procest", "idtf", "idproc"), "mf.fit with mf.TransferFunction"),
    **dict.fromkeys(("ssest", "idss"), "mf.fit with mf.TransferFunction, or mf.StateSpace"),
    **dict.fromkeys(("greyest", "idgrey"), "mf.fit with mf.StateSpace"),
    **dict.fromkeys(("nlgreyest", "idnlgrey"), "mf.fit with mf.Equation"),
    **dict.fromkeys(("etfe", "spa", "spafdr", "tfestimate"), "mf.frf"),
    **dict.fromkeys(("idfrd", "frd"), "mf.FrequencyResponse"),
    **dict.fromkeys(("oe", "pem", "arx", "armax", "n4sid"), "mf.fit, or mf.rivals"),
    **dict.fromkeys(("lsim", "sim"), "mf.simulate"),
    "present": "print(fit.summary())",
    "resid": "fit.check(), or fit.plot_residuals()",
    **dict.fromkeys(("bode", "bodeplot"), "mf.plot.bode, or fit.bode()"),
    **dict.fromkeys(("step", "stepplot", "impulse", "nyquist", "pzmap"), "mf.plot"),
    "detrend": 'mf.fit(..., trend="constant")',
}


class Elsewhere:
    """A class whose attributes have other names in other packages."""

    __slots__ = ()

    _elsewhere: ClassVar[Mapping[str, str]] = {}  # name there: what to write here

    if not TYPE_CHECKING:  # type checkers know the attributes that there are

        def __getattr__(self, name: str) -> object:
            if hasattr(type(self), name):  # a property that met an AttributeError of its own: show that one
                return object.__getattribute__(self, name)
            here = self._elsewhere.get(name)
            text = f"{type(self).__name__!r} object has no attribute {name!r}"
            raise AttributeError(f"{text}: use {here}" if here else text, name=name, obj=self)
