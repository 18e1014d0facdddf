"""Structures: what may be fitted, without numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import is_sequence, public, reals, whole
from ..base.named import in_order
from ..base.names import nearest
from ..base.samples import numbered
from ..errors import SpecError
from ..systems.lti import LTI
from ..systems.making import linear, tf
from .free import Free, bounds_meant
from .layout import Layout, routes
from .transfer_words import (
    Delay,
    degree_of,
    delay_of,
    depth,
    improper,
    nested,
    order_of,
    params_of,
    plain,
    table_of,
)

__all__ = ["TransferFunction", "system_of"]


DENOMINATORS = ("common", "separate")
Degrees = int | None


@public
@dataclass(frozen=True, kw_only=True)
class TransferFunction:
    """Transfer functions with a number of poles, zeros a path and delays; keywords only.

    yⁿ + a1 yⁿ⁻¹ + … + an y = Σ over inputs of (b0 p^zeros + b1 p^(zeros−1) + …) u(t − delay).

    Parameters
    ----------
    poles : int, or sequence of int
        Order n of the denominator, at least 1; with denominator="separate" also one per output.
    zeros : int, or sequence of int and None, or sequence of such sequences, optional
        Degree of the numerators: one for all, one per input, or [output][input]; None where there is no
        path. Default: poles − 1 (None where outputs differ in their poles).
    delay : float or Free, or sequence of these, or sequence of such sequences, default 0
        Delay in s: known, or to be estimated (`Free` with a `max`); one for all inputs, one per input, or
        [output][input]. A `Free` given for an input is one parameter, given for a path it is one of its own.
    denominator : {"common", "separate"}, optional
        For several outputs: one denominator that all share (report, eq. 25), or one per output (eq. 26).
    params : mapping from name to float or Free, optional
        Parameters that are held at a number (``{"a2": 0.0}``: an integrator), bounded, or known beforehand
        with a standard deviation, `mf.Free`.

    Raises
    ------
    SpecError
        More zeros than poles, negative counts or delays, or lengths that differ.

    See Also
    --------
    modfun.fit : Estimates its coefficients.
    modfun.Free : Bounds, starts and priors.
    modfun.select_order : How many poles.

    Notes
    -----
    Parameters are a1 … an, then the numerator of each input in descending powers: b0, b1, … with one
    input, b0[de], b1[de], … with several. With several outputs the output stands first, b0[q,de]; with
    denominator="separate" in the denominators, too: a1[q]. Delays come last: delay, delay[de]. What is
    held is not a parameter of the fit.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.2.

    Examples
    --------
    >>> TransferFunction(poles=2, zeros=[1, None], delay=[0.1, 0]).param_names(["de", "da"])
    ('a1', 'a2', 'b0[de]', 'b1[de]')
    >>> TransferFunction(poles=2, zeros=0, denominator="common").param_names(["de"], ["alpha", "q"])
    ('a1', 'a2', 'b0[alpha]', 'b0[q]')
    """

    poles: int | tuple[int, ...]
    zeros: int | tuple[Degrees, ...] | tuple[tuple[Degrees, ...], ...] | None
    delay: Delay | tuple[Delay, ...] | tuple[tuple[Delay, ...], ...]
    denominator: str | None
    params: tuple[tuple[str, float | Free], ...]

    def __init__(
        self,
        *,
        poles: int | Sequence[int],
        zeros: int | Sequence[Any] | None = None,
        delay: Delay | Sequence[Any] = 0.0,
        denominator: str | None = None,
        params: Mapping[str, float | Free] | None = None,
    ) -> None:
        if denominator is not None and denominator not in DENOMINATORS:
            raise SpecError(
                f"TransferFunction: denominator={denominator!r} is not available; "
                f"{nearest(denominator, DENOMINATORS)}"
            )
        orders: int | tuple[int, ...]
        if is_sequence(poles):
            orders = tuple(order_of(n) for n in poles)  # type: ignore[union-attr]
            if not orders:
                raise SpecError(
                    "TransferFunction: poles=[] names no output; give a number, or one per output"
                )
            if denominator != "separate":
                raise SpecError(
                    f"TransferFunction: poles={list(orders)} gives each output its own; that takes "
                    'denominator="separate"'
                )
        else:
            orders = order_of(poles)
        most = max(orders) if isinstance(orders, tuple) else orders
        degrees: Any = orders - 1 if isinstance(orders, int) else None
        if zeros is not None:
            degrees = nested("zeros", zeros, lambda value: degree_of(value, most))
        late = nested("delay", delay, delay_of)
        object.__setattr__(self, "poles", orders)
        object.__setattr__(self, "zeros", degrees)
        object.__setattr__(self, "delay", late)
        object.__setattr__(self, "denominator", denominator)
        object.__setattr__(self, "params", params_of(params))
        for what, counts in (("outputs", self._outputs()), ("inputs", self._inputs())):
            if len(counts) > 1:
                raise SpecError(
                    f"TransferFunction: poles, zeros={plain(self.zeros)} and delay={plain(self.delay)} are "
                    f"for different numbers of {what} ({', '.join(map(str, sorted(counts)))}); give all for "
                    "the same, or one number for all"
                )
        if denominator is None and self._outputs() - {1}:
            raise SpecError(
                f"TransferFunction: zeros={plain(self.zeros)}, delay={plain(self.delay)} name several "
                "outputs (output, input); say whether they share their poles: "
                'denominator="common" or "separate"'
            )
        rows = self.zeros if depth(self.zeros) == 2 else [self.zeros]
        for row in rows:  # type: ignore[union-attr]
            if isinstance(row, tuple) and all(z is None for z in row):
                raise SpecError(
                    f"TransferFunction: zeros={plain(self.zeros)} leaves an output no input with a path; "
                    "give the degree of at least one numerator"
                )

    def _outputs(self) -> set[int]:
        counts = {len(given) for given in (self.zeros, self.delay) if depth(given) == 2}  # type: ignore[arg-type]
        return counts | ({len(self.poles)} if isinstance(self.poles, tuple) else set())

    def _inputs(self) -> set[int]:
        rows = [row for given in (self.zeros, self.delay) if depth(given) == 2 for row in given]  # type: ignore[union-attr]
        rows += [given for given in (self.zeros, self.delay) if depth(given) == 1]
        return {len(row) for row in rows}  # type: ignore[arg-type]

    @property
    def n_inputs(self) -> int | None:
        """Number of inputs, or None where the structure serves any number."""
        return next(iter(self._inputs()), None)

    @property
    def n_outputs(self) -> int | None:
        """Number of outputs, or None where the structure serves any number (without denominator=: one)."""
        return next(iter(self._outputs()), None) if self.denominator is not None else 1

    def layout(self, outputs: Sequence[str], inputs: Sequence[str]) -> Layout:
        """Coefficients, paths and parameter names for the channels of a record.

        Parameters
        ----------
        outputs, inputs : sequence of str
            Names of the record's channels.

        Raises
        ------
        SpecError
            The structure was made for another number of channels, or `params` names what it has not.
        """
        return _laid_out(self, tuple(outputs), tuple(inputs))

    def plain_layout(self, inputs: Sequence[str], what: str) -> Layout:
        """Layout for one output, for what takes free parameters and known delays only.

        Parameters
        ----------
        inputs : sequence of str
            Names of the record's inputs.
        what : str
            Who asks, for the message.

        Raises
        ------
        SpecError
            Several outputs, held or bounded parameters, delays to be estimated.
        """
        layout = self.layout(("y",), inputs)
        if not layout.plain:
            raise SpecError(
                f"{what}: takes one output, free parameters and known delays, and the structure is {self}; "
                "leave params= out and give numbers for the delays"
            )
        return layout

    def param_names(self, inputs: Sequence[str] = ("u",), outputs: Sequence[str] = ("y",)) -> tuple[str, ...]:
        """Names of the parameters.

        Parameters
        ----------
        inputs, outputs : sequence of str
            Names of the record's channels; they stand in the names when there are several.
        """
        return self.layout(outputs, inputs).param_names

    def model(
        self,
        theta: ArrayLike | Mapping[str, float],
        inputs: int | None = None,
        outputs: int | None = None,
    ) -> LTI:
        """The system with these parameters.

        Parameters
        ----------
        theta : array_like, or mapping of str to float
            Parameters in the order of `param_names`, or by name.
        inputs, outputs : int, optional
            Number of channels; default: the structure's own, or 1.

        Returns
        -------
        LTI
        """
        layout = self.layout(
            _numbered("y", (self.n_outputs or 1) if outputs is None else outputs),
            _numbered("u", (self.n_inputs or 1) if inputs is None else inputs),
        )
        theta = in_order("TransferFunction.model", theta, layout.param_names)
        values = reals("TransferFunction.model", "theta", theta)
        if values.shape != (len(layout.param_names),):
            raise SpecError(
                f"TransferFunction.model: {values.size} numbers for {len(layout.param_names)} parameters; "
                f"give {', '.join(layout.param_names[:6])}{', …' if len(layout.param_names) > 6 else ''}"
            )
        return system_of(layout, values)

    def theta(self, system: LTI) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Parameters of a system in this structure, in the order of `param_names`.

        Parameters
        ----------
        system : LTI, or a system of python-control or SciPy

        Raises
        ------
        SpecError
            The system has other poles, more zeros, other delays, or other values of what is held.
        """
        system = linear(system, "TransferFunction.theta")
        count, inputs = system.shape
        layout = self.layout(_numbered("y", count), _numbered("u", inputs))
        values = np.full(len(layout.names), np.nan)
        num, den = system.polynomials()
        dens, nums = layout.places
        fits = True

        def take(first: int, poly: Any) -> None:
            nonlocal fits
            for k, value in enumerate(poly, start=first):
                # One denominator for all outputs, or for none.
                fits = fits and (np.isnan(values[k]) or abs(values[k] - value) <= 1e-9 * abs(value))
                values[k] = value

        for i, order in enumerate(layout.orders):
            own = [d for d, n in zip(den[i], num[i], strict=True) if np.any(n)] or [den[i][0]]
            fits = fits and all(d.size == order + 1 for d in own)
            fits = fits and all(np.allclose(d, own[0], rtol=1e-9, atol=0) for d in own)
            if not fits:
                break
            take(dens[i], own[0][1:])
            for k, degree in enumerate(layout.numerators[i]):
                n = np.trim_zeros(num[i][k], "f")
                fits = fits and n.size <= (0 if degree is None else degree + 1)
                if fits and degree is not None:
                    take(nums[i][k], np.concatenate([np.zeros(degree + 1 - n.size), n]))
        late = []
        for at, path in enumerate(layout.paths):
            taken = [
                (float(system.path_delays[i, k]), bool(np.any(num[i][k])))
                for i, row in enumerate(layout.routes)
                for k, route in enumerate(row)
                if route == at
            ]
            if isinstance(path.delay, Free):
                used = [delay for delay, moves in taken if moves] or [taken[0][0]]
                late.append(used[0])
                fits = fits and len(set(used)) == 1
            else:
                fits = fits and all(path.delay == delay for delay, moves in taken if moves)
        for value, held in zip(values, layout.fixed, strict=True):
            fits = fits and (held is None or abs(value - held) <= 1e-9 * max(abs(held), abs(value)))
        if not fits:
            raise SpecError(
                f"the system is {system!r}, which the structure {self} does not hold: other poles, more "
                "zeros, other delays or other values of what is held"
            )
        return np.concatenate([values[list(layout.free)], late])

    @classmethod
    def from_system(cls, system: LTI) -> TransferFunction:
        """The structure a system has: its poles, zeros and delays.

        Parameters
        ----------
        system : LTI, or a system of python-control or SciPy

        Raises
        ------
        SpecError
            A static gain, or paths to one output with denominators of their own.
        """
        system = linear(system, "TransferFunction.from_system")
        outputs, inputs = system.shape
        num, den = system.polynomials()
        own: list[Any] = []
        for i in range(outputs):
            if any(d.size != den[i][0].size or np.any(d != den[i][0]) for d in den[i]):
                raise SpecError(
                    "TransferFunction.from_system: the inputs have different denominators; bring them to a "
                    "common one, mf.tf([num1, num2], den)"
                )
            own.append(den[i][0])
        if any(d.size < 2 for d in own):
            raise SpecError(
                "TransferFunction.from_system: a static gain has no poles; there is nothing to fit"
            )
        degrees = [tuple(p.size - 1 if np.any(p) else None for p in row) for row in num]
        if outputs == 1:
            if inputs == 1 and degrees[0][0] is not None:
                return cls(poles=own[0].size - 1, zeros=degrees[0][0], delay=system.delays[0])
            return cls(poles=own[0].size - 1, zeros=degrees[0], delay=system.delays)
        if all(d.size == own[0].size and np.all(d == own[0]) for d in own):
            return cls(poles=own[0].size - 1, zeros=degrees, delay=system.delays, denominator="common")
        poles = [d.size - 1 for d in own]
        return cls(poles=poles, zeros=degrees, delay=system.delays, denominator="separate")

    def __repr__(self) -> str:
        poles = list(self.poles) if isinstance(self.poles, tuple) else self.poles
        words = [f"poles={poles}"]
        words += [] if self.zeros is None else [f"zeros={plain(self.zeros)}"]
        late = self.delay if isinstance(self.delay, tuple) else (self.delay,)
        words += [f"delay={plain(self.delay)}"] if any(d != 0 for d in late) else []
        words += [] if self.denominator is None else [f"denominator={self.denominator!r}"]
        words += [f"params={dict(self.params)}"] if self.params else []
        return f"TransferFunction({', '.join(words)})"


def system_of(layout: Layout, params: Any) -> LTI:
    """The system that parameters make of a layout."""
    late = [layout.delays(params, i) for i in range(len(layout.outputs))]
    dens, nums = [], []
    for i in range(len(layout.outputs)):
        den, row = layout.polynomials(params, i)
        dens.append([den] * len(row))
        nums.append(row)
    if layout.common or len(layout.outputs) == 1:
        return tf(nums, dens[0][0], delay=late)
    return tf(nums, dens, delay=late)


@lru_cache(64)
def _laid_out(structure: TransferFunction, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> Layout:
    q, k = len(outputs), len(inputs)
    if q > 1 and structure.denominator is None:
        raise SpecError(
            f"TransferFunction: the record has {q} outputs ({', '.join(outputs)}); say whether they share "
            'their poles, denominator="common" or "separate", or choose one with '
            f"rec.select(outputs=[{outputs[0]!r}])"
        )
    for what, own, have in (("output", structure.n_outputs, q), ("input", structure.n_inputs, k)):
        if own is not None and own != have and not (what == "input" and have == 0):
            meant = bounds_meant(structure.delay)
            raise SpecError(
                f"TransferFunction: made for {own} {what}(s), used with {have}; give zeros and delay, one "
                f"per {what} of the record, or select its {what}s"
                + (f"; delay={plain(structure.delay)} is one per input{meant}" if meant else "")
            )
    if not k and structure.n_inputs is not None:
        raise SpecError(
            f"TransferFunction: the structure has {structure.n_inputs} input(s), the record has none; free "
            f"motion takes TransferFunction(poles={structure.poles!r})"
        )
    orders = structure.poles if isinstance(structure.poles, tuple) else (structure.poles,) * q
    if structure.zeros is None:
        numerators = tuple((n - 1,) * k for n in orders)
    else:
        numerators = table_of(structure.zeros, q, k)
    for row, n in zip(numerators, orders, strict=True):
        if any(z is not None and z > n for z in row):
            raise SpecError(
                f"TransferFunction: zeros={plain(structure.zeros)} holds more zeros than the {n} poles of "
                f"an output; {improper(n, max(z for z in row if z is not None))}"
            )
    paths, routed = routes(
        table_of(structure.delay, q, k), inputs, outputs, shared=depth(structure.delay) < 2
    )
    common = structure.denominator == "common" or q == 1
    names: list[str] = []
    if common:
        names += [f"a{j}" for j in range(1, orders[0] + 1)]
    for i, row in enumerate(numerators):
        if not common:
            names += [f"a{j}[{outputs[i]}]" for j in range(1, orders[i] + 1)]
        for channel, degree in zip(inputs, row, strict=True):
            where = [outputs[i]] if q > 1 else []
            where += [channel] if k > 1 else []
            suffix = f"[{','.join(where)}]" if where else ""
            names += [f"b{j}{suffix}" for j in range(0 if degree is None else degree + 1)]
    fixed: list[float | None] = [None] * len(names)
    bounds = [(-inf, inf)] * len(names)
    beforehand: list[tuple[float, float] | None] = [None] * len(names)
    known = [*names, *(path.name for path in paths)]
    for name, given in structure.params:
        if name not in known:
            raise SpecError(f"TransferFunction: params names {name!r}; {nearest(name, known)}")
        if name in names:
            at = names.index(name)
            if isinstance(given, Free):
                bounds[at], beforehand[at] = (given.min, given.max), given.prior
            else:
                fixed[at] = given
        else:
            late = given if isinstance(given, Free) else delay_of(given)
            paths = tuple(
                type(path)(path.input, delay_of(late), path.name) if path.name == name else path
                for path in paths
            )
    if all(value is not None for value in fixed):
        raise SpecError(
            "TransferFunction: params= fixes every coefficient; nothing is left to estimate. A number fixes "
            "a coefficient: leave out those to be estimated, which need no start values"
        )
    return Layout(
        outputs=outputs,
        inputs=inputs,
        orders=orders,
        common=common,
        numerators=numerators,
        paths=paths,
        routes=routed,
        names=tuple(names),
        fixed=tuple(fixed),
        bounds=tuple(bounds),
        beforehand=tuple(beforehand),
    )


def _numbered(letter: str, count: int) -> tuple[str, ...]:
    return numbered(
        letter, whole("TransferFunction.model", {"u": "inputs", "y": "outputs"}[letter], count, 0, 100)
    )
