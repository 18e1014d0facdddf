"""Making systems: from polynomials, from matrices, and from those of python-control and SciPy."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import complexes, public, real, reals
from ..base.samples import frozen, numbered
from ..errors import SpecError
from .lti import LTI, Delays, state_space
from .polynomials import polynomials_of, strip

__all__ = ["linear", "named", "ss", "system_of", "tf", "zpk"]


@public
def tf(num: Any, den: Any = None, *, delay: float | Sequence[float] | Sequence[Sequence[float]] = 0.0) -> LTI:
    """Transfer function num(s)/den(s)·e^(−delay·s).

    Parameters
    ----------
    num : array_like, or nested lists of them, or a system of python-control or SciPy
        Numerator in descending powers of s: one polynomial; a list of polynomials, one per input; or a
        list (output) of lists (input) of polynomials. A `control.TransferFunction`, `control.StateSpace`
        or `scipy.signal.lti` object stands alone; one in state space stays so.
    den : array_like, or nested lists of them
        Denominator, common to all paths, or nested as `num` is. It is made monic.
    delay : float, sequence of float, or sequence of such sequences
        Delay, s, at least 0: one, one per input, or one per path, nested [output][input].

    Returns
    -------
    LTI

    Raises
    ------
    SpecError
        A numerator of higher degree than its denominator, a zero or missing denominator, a delay below
        0, a discrete-time system.

    See Also
    --------
    modfun.ss : Of matrices.
    modfun.LTI : What it returns.

    References
    ----------
    T. Kailath, Linear Systems, Prentice-Hall, 1980.

    Examples
    --------
    >>> tf([5], [1, 3, 8])
          5
    -------------
    s^2 + 3 s + 8
    """
    if den is None:
        return system_of(num, delay)
    nums = polynomials_of(num, "num")
    outputs, inputs = len(nums), len(nums[0])
    dens = polynomials_of(den, "den")
    if len(dens) == 1 and len(dens[0]) == 1:
        dens = [dens[0] * inputs] * outputs
    if any(len(row) != inputs for row in [*nums, *dens]) or len(dens) != outputs:
        raise SpecError(
            f"mf.tf: num has {outputs} output(s) of {[len(r) for r in nums]} input(s), den "
            f"{len(dens)} of {[len(r) for r in dens]}; give one denominator, or one per path, nested as num"
        )
    top, bottom = [], []
    for num_row, den_row in zip(nums, dens, strict=True):
        tops, bottoms = [], []
        for n, d in zip(num_row, den_row, strict=True):
            n, d = strip(n), strip(d)
            if d[0] == 0:
                raise SpecError("mf.tf: the denominator is zero; give at least one nonzero coefficient")
            if n.size > d.size:
                raise SpecError(
                    f"mf.tf: the numerator has degree {n.size - 1}, the denominator {d.size - 1}; "
                    "an improper system has no response to samples: lower the numerator's degree "
                    "or add fast poles"
                )
            with np.errstate(over="ignore"):
                n, d = n / d[0], d / d[0]
            if not (np.isfinite(n).all() and np.isfinite(d).all()):
                raise SpecError(
                    "mf.tf: the leading coefficient of the denominator is so small beside the others that "
                    "their quotients overflow; leave it out, or count time in another unit"
                )
            tops.append(frozen(n))
            bottoms.append(frozen(d))
        top.append(tuple(tops))
        bottom.append(tuple(bottoms))
    return LTI(tuple(top), tuple(bottom), None, _delays(delay, outputs, inputs, "mf.tf"))


@public
def ss(
    A: ArrayLike | Any,
    B: ArrayLike | None = None,
    C: ArrayLike | None = None,
    D: ArrayLike | None = None,
    *,
    delay: float | Sequence[float] = 0.0,
) -> LTI:
    """State space x' = Ax + Bu(t − delay), y = Cx + Du(t − delay).

    Parameters
    ----------
    A, B, C : array_like
        Matrices (state, state), (state, input), (output, state); a vector B is one input, C one output.
        A system (`LTI`, or of python-control or SciPy) stands alone.
    D : array_like, optional
        Feedthrough (output, input), default zero.
    delay : float or sequence of float
        Delay of the inputs, s, at least 0; one, or one per input.

    Returns
    -------
    LTI

    Raises
    ------
    SpecError
        Matrices whose sizes do not fit, or are not finite.

    See Also
    --------
    modfun.tf : Of polynomials.
    modfun.LTI : What it returns.

    References
    ----------
    T. Kailath, Linear Systems, Prentice-Hall, 1980.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.ss([[0, 1], [-8, -3]], [[0], [5]], [[1, 0]])
    >>> print(system.poles().round(3))
    [-1.5-2.398j -1.5+2.398j]
    """
    if B is None and C is None and D is None and not isinstance(A, np.ndarray | list | tuple | float | int):
        return system_of(A, delay).to_ss()
    if B is None or C is None:
        raise SpecError("mf.ss: give A, B and C (and D), or a system of python-control or SciPy")
    a = np.atleast_2d(reals("mf.ss", "A", A))
    n = a.shape[0] if a.size else 0
    a = a.reshape(n, n) if a.size == n * n else a
    b = reals("mf.ss", "B", B)
    b = b.reshape(n, -1) if b.ndim < 2 and n and b.size % n == 0 else np.atleast_2d(b)
    c = np.atleast_2d(reals("mf.ss", "C", C))
    d = np.zeros((c.shape[0], b.shape[1])) if D is None else np.atleast_2d(reals("mf.ss", "D", D))
    shapes = [m.shape for m in (a, b, c, d)]
    if shapes != [(n, n), (n, b.shape[1]), (c.shape[0], n), (c.shape[0], b.shape[1])]:
        raise SpecError(
            f"mf.ss: A, B, C, D have shapes {', '.join(map(str, shapes))}; they must be (state, state), "
            "(state, input), (output, state), (output, input)"
        )
    made = state_space(a, b, c, d, _delays(delay, d.shape[0], d.shape[1], "mf.ss"))
    made.input_delays("mf.ss")
    return made


@public
def zpk(zeros: ArrayLike, poles: ArrayLike, gain: float, *, delay: float = 0.0) -> LTI:
    """Transfer function gain·Π(s − zeros)/Π(s − poles)·e^(−delay·s) of one input and output.

    Parameters
    ----------
    zeros, poles : array_like of complex
        In rad/s, complex ones in conjugate pairs; ``[]`` for none.
    gain : float
        Ratio of the leading coefficients.
    delay : float
        In seconds, at least 0.

    Returns
    -------
    LTI

    Raises
    ------
    SpecError
        A complex root without its conjugate, more zeros than poles, or as `tf`.

    See Also
    --------
    modfun.tf : Of polynomials.

    References
    ----------
    T. Kailath, Linear Systems, Prentice-Hall, 1980.

    Examples
    --------
    >>> zpk([-0.5], [-1 + 2j, -1 - 2j], 3)
      3 s + 1.5
    -------------
    s^2 + 2 s + 5
    """
    own = []
    for name, given in (("zeros", zeros), ("poles", poles)):
        found = np.atleast_1d(complexes("mf.zpk", name, given)).ravel()
        polynomial = np.atleast_1d(np.poly(found))
        if np.iscomplexobj(polynomial):  # NumPy makes it real where all roots have their conjugates
            raise SpecError(
                f"mf.zpk: {name}={found.tolist()} hold a complex number without its conjugate; give both"
            )
        own.append(polynomial)
    return tf(real("mf.zpk", "gain", gain) * own[0], own[1], delay=delay)


def foreign(given: Any) -> bool:
    """Whether it is a system of python-control or SciPy, neither of which is imported for that."""
    homes = ("control.", "scipy.signal.")
    return any(f"{kind.__module__}.".startswith(homes) for kind in type(given).__mro__)


def linear(given: Any, what: str) -> Any:
    """A system of python-control or SciPy as an LTI, and all else as it is: for whatever takes an LTI."""
    return system_of(given, 0.0, what) if foreign(given) else given


def system_of(given: Any, delay: Any = 0.0, what: str = "mf.tf") -> LTI:
    """A system of python-control or SciPy as an LTI, by what it has rather than by its class."""
    if isinstance(given, LTI):
        if not np.any(delay):
            return given
        if any(given.delays):
            raise SpecError(f"{what}: the system has delays {given.delays} s of its own; leave delay= out")
        if given.matrices is not None:
            return ss(*given.matrices, delay=delay)
        return tf(given.numerators, given.denominators, delay=delay)
    if hasattr(given, "frdata") or hasattr(given, "omega"):
        raise SpecError(
            f"{what}: this is a frequency response, which has no polynomials; it is data: "
            "mf.FrequencyResponse(omega=..., response=...)"
        )
    if getattr(given, "dt", None) not in (None, 0):
        raise SpecError(
            f"{what}: the system is discrete in time (dt = {given.dt}); convert it to continuous time first"
        )
    if all(hasattr(given, name) for name in "ABCD"):
        return _labelled(ss(given.A, given.B, given.C, given.D, delay=delay), given)
    if hasattr(given, "num_list") and hasattr(given, "den_list"):
        return _labelled(tf(given.num_list, given.den_list, delay=delay), given)
    if hasattr(given, "num") and hasattr(given, "den"):
        num: Any = given.num
        if np.ndim(given.den) == 1 and isinstance(num, np.ndarray) and num.ndim == 2:
            num = [[row] for row in num]  # SciPy: one input, several outputs
        return tf(num, given.den, delay=delay)
    if hasattr(given, "to_tf"):
        return system_of(given.to_tf(), delay, what)
    if isinstance(model := getattr(given, "model", None), LTI):  # of a fit or a reduction
        return system_of(model, delay, what)
    raise SpecError(
        f"{what}: got only {type(given).__name__}; give num and den, or a system of python-control or SciPy"
    )


def named(system: LTI, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> LTI:
    """The system with the names of its channels, but for those that number them."""
    return replace(
        system,
        outputs=None if outputs == numbered("y", len(outputs)) else outputs,
        inputs=None if inputs == numbered("u", len(inputs)) else inputs,
    )


def _labelled(system: LTI, given: Any) -> LTI:
    """The system with the names that python-control's has, but for those that number channels: u[0]."""
    own: list[tuple[str, ...] | None] = []
    for name in ("input_labels", "output_labels"):
        labels = tuple(getattr(given, name, ()))
        numbers = all(re.fullmatch(r"\w+\[\d+\]", label) for label in labels)
        own.append(None if numbers else labels)
    return replace(system, inputs=own[0], outputs=own[1])


def _delays(given: Any, outputs: int, inputs: int, what: str) -> Delays:
    values = np.atleast_1d(reals(what, "delay", given))
    if values.size == 1:
        values = np.full(inputs, values.item())
    if values.ndim == 2 and np.all(values == values[:1]):
        values = values[0]
    if values.shape not in ((inputs,), (outputs, inputs)):
        raise SpecError(
            f"{what}: {values.size} delays for {inputs} input(s) and {outputs} output(s); give one, one per "
            "input, or one per path [output][input]"
        )
    if not np.all(np.isfinite(values)) or np.any(values < 0):
        raise SpecError(
            f"{what}: delay is {values.tolist()} s; delays are finite and at least 0 "
            "(an output that leads its input is not causal: shift the output instead)"
        )
    rows = values.tolist()
    return tuple(map(tuple, rows)) if values.ndim == 2 else tuple(rows)
