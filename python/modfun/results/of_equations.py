"""A fit of equations: what is other than with transfer functions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, Never

import numpy as np
from numpy.typing import ArrayLike

from .._core import noise_level
from ..base.arguments import reals
from ..base.arrays import F64, geometric_mean
from ..base.names import listed
from ..base.samples import FEWEST
from ..base.student import root
from ..equations.layout import EquationLayout
from ..equations.nonlinear import model_of
from ..equations.symbolic.known import basis
from ..errors import DataError, SpecError
from ..models.noise import Noise
from ..records.corners import driving
from ..records.record import Record
from .fit import Fit
from .gradients import differences
from .initial_state import begins_in_zero, from_zero, simulate_equations
from .prediction import InitialState
from .response_call import output_error_call
from .sample_levels import beside_samples, square_beside

__all__ = ["HUGE", "EquationFit", "parts_with_values"]

LONG = 0.5  # of the longest part of a record that has values: shorter ones tell little
CLEAR = 5.0  # standard deviations of noise: what is as far from 0 has a logarithm that is worth something
HUGE = 1e50  # samples or parameters whose powers may overflow


@dataclass(frozen=True, eq=False, repr=False)
class EquationFit(Fit):
    """A fitted `Equation` or `StateSpace`: a `Fit` whose model need not be linear.

    Attributes
    ----------
    levels : (record, noisy channel) array
        Standard deviation of the noise that weighed the lines: given, seen in the unused high band, or, where
        the residuals of several outputs or records contradict that, estimated with the parameters.
    seen : (record, noisy channel) array
        The same as given or as seen in the high band.
    df_hc3 : (p,) array
        Degrees of freedom of each HC3 standard error (Satterthwaite): few where few lines carry a parameter.
    bend : float
        How far noise bends signals with parameters inside, such as sin(k*y): second differences over a
        standard deviation of the noise, over first ones. Beyond 0.5 the criterion says nothing of these.
    other_signs : (p,) array or None
        Parameters of which some are negative and which explain the records about as well; else None.
    other_minimum : (p,) array or None
        Parameters at another minimum of the response that is about as likely; else None.
    unnamed : tuple of Record
        The records where they have channels that the equations do not name; else none.
    unfolded : tuple of Record
        The records without what sampling folds into the lines under held inputs, where that was taken out.
    less : tuple of (equation, time) array
        What was taken from nonlinear equations: what sums over samples leave of their own response.
    unsettled : bool
        Whether what sums over the samples err by could not be taken out of the equations.
    by_response : bool
        Whether this is the least squares of the response, as sums over the records err or have no answer.
    follow_p : float
        Of such a fit, the probability that residuals of neighbouring samples agree so much in white noise.
    """

    layout: EquationLayout  # type: ignore[assignment]  # what a Fit asks of it is there
    levels: F64 = field(default_factory=lambda: np.empty((0, 0)))
    seen: F64 = field(default_factory=lambda: np.empty((0, 0)))
    bend: float = 0.0
    other_signs: F64 | None = None
    other_minimum: F64 | None = None
    unnamed: tuple[Record, ...] = ()
    unfolded: tuple[Record, ...] = ()
    less: tuple[F64, ...] = ()
    unsettled: bool = False
    by_response: bool = False
    follow_p: float = nan

    @property
    def trend(self) -> str | None:
        """Constant and drift of each equation: None, "constant" or "linear"."""
        return self.structure.trend if self.options.trend == "auto" else self.options.trend

    @property
    def model(self) -> Any:
        """The equations with their estimates; of a linear `StateSpace` an `LTI`."""
        self.need_numbers("model")
        return self.structure.model(self.estimates())

    def varying(self, name: str, t: ArrayLike) -> tuple[F64, F64]:
        """A coefficient that varies with time, and its standard error.

        Parameters
        ----------
        name : str
            As in `varying=` of the equation.
        t : (time,) array_like
            Instants in s.

        Returns
        -------
        value, bse : (time,) arrays
        """
        instants = np.atleast_1d(reals("varying", "t", t))
        names, values, held = basis(self.layout.compiled, name, instants)
        place = [self.param_names.index(own) for own in names]
        cov = self.cov_params()[np.ix_(place, place)]
        return self.params[place] @ values + held, root(np.einsum("it,ij,jt->t", values, cov, values))

    @property
    def message(self) -> str:
        """The status in words, with the cure."""
        if self.success and self.by_response:
            return "Least squares of the response: sums over the record err, or have no minimum."
        if self.status == "rank" and (told := self._without_bounds()):
            return told
        if self.status == "rank":
            return (
                "The samples cannot tell the parameters apart: hold one, or take a record that moves more or "
                "longer. fit.structure.identifiable() says what no record could tell apart."
                f"{self._without_starts()}"
            )
        if self.status == "maxiter" and self.nit < self.options.maxiter:
            return (
                f"Stopped after {self.nit} iterations where no step lowers the cost any more, and not at a "
                "minimum: give starts and bounds with mf.Free, or a narrower band."
            )
        if self.status == "maxiter":
            return (
                f"Not settled after {self.nit} iterations: raise maxiter, hold a parameter or take a "
                "narrower band."
            )
        if self.status == "nonfinite":
            if overflow := self._overflow():
                return overflow
            if not (told := self._without_value()) and not self._may_lack_values():
                return (
                    "The numbers left the range of floating point: the search ran away. First see that each "
                    f"column is the signal of its name ({', '.join((*self.outputs, *self.inputs))}; two may "
                    "be exchanged), and its unit; else give starts and bounds with mf.Free."
                )
            return told or (
                "The numbers left the range of floating point: look for samples at which a signal has no "
                "value (log or sqrt of what noise makes negative, 1/0), or that are absurdly large."
            )
        return super().message

    def _without_starts(self) -> str:
        """That a search which needs starts had none for some parameters."""
        words = self.layout.formulas.words
        each = zip(self.param_names, words["starts"], strict=True)
        free = [name for name, start in each if start is None]
        if words["linear"] or not free:
            return ""
        given = ", ".join(f"{name!r}: mf.Free(...)" for name in free)
        return f" If that names none, give starts, params={{{given}}}: without these the search may run away."

    def _without_bounds(self) -> str:
        """That parameters inside signals, as Ks in S/(Ks + S), had no bounds in a search that ran away."""
        words = self.layout.formulas.words
        inside = {k for _, k, _ in words["signal_slopes"]}
        free = [k for k in sorted(inside) if not np.isfinite(words["bounds"][k]).all()]
        if not free:
            return ""
        given = ", ".join(f"'{self.param_names[k]}': mf.Free(start, min=..., max=...)" for k in free)
        ended = ", ".join(f"{self.param_names[k]} = {self.params[k]:.3g}" for k in free)
        return (
            f"The search ended at {ended}, where the samples cannot tell the parameters apart: first give "
            f"starts and bounds of what stands inside a signal, params={{{given}}}; else hold one, or take a "
            "record that moves more or longer."
        )

    def _overflow(self) -> str:
        """That an exponential with parameters inside overflowed, where all samples have values."""
        if self._without_value() or self._absurd():
            return ""
        from ..equations.symbolic.arguments import exponentials
        from ..equations.symbolic.words import said

        steep = exponentials(self.layout.compiled)
        if not steep:
            return ""
        names = dict.fromkeys([name for _, own in steep for name in own])
        given = ", ".join(f"{name!r}: mf.Free(start, min=..., max=...)" for name in names)
        return (
            "The numbers left the range of floating point: the search took "
            f"{listed([said(one) for one, _ in steep])} out of it. First give starts and bounds of what "
            f"stands inside, params={{{given}}}."
        )

    def _absurd(self) -> bool:
        """Whether samples are so large that their powers overflow."""
        return any(
            np.max(np.abs(rec.y), initial=0.0, where=np.isfinite(rec.y)) > HUGE for rec in self.records or ()
        )

    def _may_lack_values(self) -> bool:
        """Whether samples overflow, or equations may have no value beside them.

        Logarithms and roots of signals alone have been seen at the samples by `_without_value`.
        """
        if self._absurd():
            return True
        texts = getattr(self.structure, "texts", None)  # a state space has none of them
        if texts is None or self.layout.compiled.hidden:  # elimination divides and takes logarithms
            return True
        seen = not self.layout.formulas.words["signal_slopes"]
        return any(sign in text for text in texts for sign in ("/", "**", *["log", "sqrt"] * (not seen)))

    def _without_value(self) -> str:
        """Where a logarithm or root in the equations meets samples that are not positive."""
        for k, rec in enumerate(self.records or ()):
            found = self.layout.formulas.without_value(rec.y, driving(rec), rec.t)
            if found is None:
                continue
            from ..equations.symbolic.words import said  # SymPy is loaded already: it made the formulas

            whole, inner, values = found
            bad = np.flatnonzero(~(values > 0))
            runs, least, clear = _valued(values)
            pieces = [f"rec.window({rec.t[run.start]:.4g}, {rec.t[run.stop - 1]:.4g})" for run in runs]
            parts = pieces[0] if len(pieces) == 1 else f"mf.fit([{', '.join(pieces)}], model)"
            first, order, y = int(bad[0]), max(self.layout.orders), np.ascontiguousarray(rec.y)
            left, given = max(runs, key=lambda run: run.stop - run.start, default=slice(0)), ""
            try:
                noise_level(np.ascontiguousarray(y[:, left]), order)
            except DataError:  # too few to see it in
                told = ", ".join(f"{level:.3g}" for level in noise_level(y, order))
                told = f"[{told}]" if len(y) > 1 else told
                given = f", and give its noise, noise=mf.Noise(y={told})"
            starts = ", ".join(f"'{name}': ..." for name in self.param_names)
            return (
                f"{said(whole)} has no value at {bad.size} of {values.size} samples of record {k}, first at "
                f"t = {rec.t[first]:.4g} s, where {said(inner)} is {values[first]:.3g}: cut the record to "
                f"where {said(inner)} stays above {least:.3g}{clear}, such as {parts}{given}. An output "
                f"error takes all of it, from starts, {output_error_call(self, start=f'{{{starts}}}')}."
            )
        return ""

    @property
    def has_poles(self) -> bool:
        """Whether there is a linear model, as of a `StateSpace` all of whose parameters have numbers."""
        return bool(self.structure.linear and not self.structure._lost)

    @property
    def row_names(self) -> tuple[str, ...]:
        """What the rows of the residuals belong to: the equations."""
        return tuple(f"equation {k}" for k in range(1, len(self.layout.orders) + 1))

    @property
    def high_band_levels(self) -> F64:
        """Noise level of each output as seen in the unused high band; nan where it was given."""
        outputs = len(self.outputs)
        given = isinstance(self.options.noise, Noise)
        return np.full(outputs, np.nan) if given else geometric_mean(self.seen[:, :outputs], self.rows)

    @property
    def chi2(self) -> float:
        """Cost in units of the noise levels: about `df_resid` if all is well; nan without known levels."""
        if self.process_levels is not None:
            return float("nan")  # its levels are estimated from the same residuals
        if beside_samples(self):
            return self.df_resid * square_beside(self)
        weighted = self.options.method in ("awls", "ml") and self.options.noise != "equation"
        over = self.noise_scale * np.mean((self.levels / self.seen) ** 2)  # nothing but 1 where they agree
        return self.df_resid * float(over) if weighted else float("nan")

    def _gradient(self, of: Any) -> Any:
        """Values of a function of the linear model, and its derivatives to the parameters.

        Half of these on a bound, beyond which there is no model, as of a delay of 0: its error is unknown.
        """
        low, high = np.reshape(self.layout.formulas.words["bounds"], (-1, 2)).astype(float).T

        def at(params: F64) -> Any:
            params = np.clip(params, low, high)
            return of(self.structure.model(dict(zip(self.param_names, params.tolist(), strict=True))))

        return of(self.model), differences(at, self.params, self.bse)

    def pole_gradients(self, output: int = 0) -> Any:
        """Poles and their derivatives to the parameters, (pole, p)."""
        self._need_linear("poles")
        found = np.asarray(self.model.poles())

        def near(model: Any) -> Any:
            """Poles of a model close by, in the order of the estimate's."""
            left = list(model.poles())
            return np.array([left.pop(int(np.argmin(np.abs(np.array(left) - pole)))) for pole in found])

        value, slopes = self._gradient(near)
        return value, np.reshape(slopes, (self.params.size, len(value))).T

    def _need_linear(self, what: str) -> None:
        if not self.structure.linear:
            raise SpecError(
                f"a fit of an Equation, linear or not, is not asked for its {what}; fit a TransferFunction "
                "or a StateSpace, or see what it does by fit.model.simulate(...) and fit.predict()"
            )

    def response_gradients(self, omega: F64) -> Any:
        """Response (output, input, f) and its derivatives to the parameters (p, output, input, f)."""
        self._need_linear("frequency response")
        return self._gradient(lambda model: np.asarray(model.frequency_response(omega).response))

    def polynomials(self, output: int = 0) -> Never:
        """Not for equations: their coefficients have names of their own."""
        raise SpecError(
            "polynomials: the parameters of equations are not coefficients of a transfer function; "
            "use fit.params, or fit.model"
        )

    def path_model(self, output: int | str = 0) -> Never:
        """Not for equations; see `model`."""
        raise SpecError("path_model: equations have no path from one input to one output; use fit.model")

    @property
    def state_names(self) -> list[str]:
        """What `initial_state` holds: the states, of equations outputs and their derivatives."""
        structure: Any = self.structure
        if structure.linear:
            return list(structure.states)
        return list(model_of(structure.compiled(self.outputs, self.inputs), self.params, structure).states)

    def simulate(self, rec: Record, initial_state: Any = None) -> tuple[F64, InitialState]:
        """Simulated outputs for a record with the initial state and trend that `predict` takes."""
        if initial_state is not None:
            return simulate_equations(self, rec, initial_state)
        kept = self.__dict__.get("_simulated")  # errors, scores and plots ask for the same again
        if kept is None or kept[0] is not rec:
            kept = rec, self._from_past(rec) or simulate_equations(self, rec, None)
            self.__dict__["_simulated"] = kept
        found: tuple[F64, InitialState] = kept[1]
        return found

    def _from_past(self, rec: Record) -> tuple[F64, InitialState] | None:
        """The same for one of the fit's records that has a past, whose samples tell where it begins."""
        for k, (own, longer) in enumerate(zip(self.records or (), self.with_past or (), strict=False)):
            if own == rec and not isinstance(self.options.initial_state, str):
                return simulate_equations(self, rec, self.options.states(len(self.lines))[k])
            if own == rec and self.by_response and begins_in_zero(self):
                # The samples before it have the level that sums gave them.
                simulated, _ = from_zero(self, rec)
                _, free = simulate_equations(self, rec, None)
                _, initial = simulate_equations(self, rec._like(y=simulated, mask=None, sigma=None), None)
                return simulated, replace(initial, cov=free.cov, trend_cov=free.trend_cov)
            if own == rec:
                simulated, past = simulate_equations(self, longer, None)
                simulated = simulated[:, -rec.t.size :]
                _, initial = simulate_equations(self, rec._like(y=simulated, mask=None, sigma=None), None)
                return simulated, replace(initial, cov=past.cov, trend_cov=past.trend_cov)
        return None

    def _observed(self, rec: Record, eigenvalues: Any) -> Never:
        raise SpecError('initial_state: an observer is for transfer functions; use method="lstsq"')

    def own_values(self) -> dict[str, Any]:
        """What is kept of it besides what all fits have."""
        own: dict[str, Any] = {"levels": self.levels.tolist(), "seen": self.seen.tolist()}
        return own | ({"by_response": True, "follow_p": self.follow_p} if self.by_response else {})


def parts_with_values(fit: EquationFit) -> tuple[Record, ...]:
    """The parts of a fit's records where logarithms and roots have values; none where all samples have."""
    found: list[Record] = []
    lacking = False
    for rec in fit.records or ():
        lacks = fit.layout.formulas.without_value(rec.y, driving(rec), rec.t)
        lacking = lacking or lacks is not None
        runs = [slice(0, rec.t.size)] if lacks is None else _valued(lacks[2])[0]
        long = [run for run in runs if run.stop - run.start >= FEWEST]
        found += [rec.window(rec.t[run.start], rec.t[run.stop - 1]) for run in long]
    return tuple(found) if lacking else ()


def _valued(values: F64) -> tuple[list[slice], float, str]:
    """The longest runs of samples far enough above 0 for a logarithm, how far, and that in words."""
    # Next to 0 the noise makes anything of it, though it has a value.
    least, clear = CLEAR * float(noise_level(np.atleast_2d(values), 2)[0]), f", {CLEAR:g} times its noise"
    if not np.any(values > least):
        least, clear = 0.0, ""
    edges = np.concatenate([[-1], np.flatnonzero(~(values > least)), [values.size]])
    sizes = np.diff(edges) - 1
    runs = [
        slice(int(edges[at]) + 1, int(edges[at + 1])) for at in np.flatnonzero(sizes > LONG * sizes.max())
    ]
    return runs, least, clear
