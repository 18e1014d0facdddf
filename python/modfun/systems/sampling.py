"""Systems in discrete time: sampled ones of continuous-time systems, and back."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ..base.arguments import public, real
from ..base.arrays import F64
from ..base.names import nearest
from ..errors import SpecError
from .lti import LTI
from .making import linear, ss, tf

__all__ = ["c2d", "d2c"]

METHODS = {"zoh": "zoh", "foh": "foh", "tustin": "bilinear", "impulse": "impulse"}  # here, and in SciPy
WHOLE = 1e-9  # of a delay, or of a sample: how near it is to a whole number of samples


@public
def c2d(system: Any, dt: float, method: str = "zoh") -> Any:
    """Sample a continuous-time system.

    Parameters
    ----------
    system : LTI, Fit of one, or a system of python-control or SciPy
    dt : float
        Sampling interval in seconds.
    method : {"zoh", "foh", "tustin", "impulse"}
        Input held, input in straight lines, bilinear transformation, or the same impulse response.

    Returns
    -------
    scipy.signal.dlti
        With one input and one output the class of `system`, transfer function or state space; else a state
        space. Each sample of delay that was begun is a pole at 0; in a state space it is a state, behind
        those of `system`.

    Raises
    ------
    SpecError
        Something else than a continuous-time system, a delay that differs from output to output or, unless
        the input is held, is no whole number of samples, or an unknown method.

    See Also
    --------
    modfun.d2c : The way back.
    modfun.LTI.simulate : Exact responses to sampled inputs.

    References
    ----------
    G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, Addison-Wesley, 1998.

    Examples
    --------
    >>> import modfun as mf
    >>> sampled = mf.c2d(mf.tf([1], [1, 1]), 0.1)
    >>> print(sampled.den.round(4), sampled.dt)
    [ 1.     -0.9048] 0.1
    """
    from scipy.signal import BadCoefficients

    model = getattr(system, "model", None)  # of a fit
    system = model if isinstance(model, LTI) else linear(system, "c2d")
    if not isinstance(system, LTI):
        raise SpecError(f"c2d: give a linear system (mf.tf, mf.ss, fit.model), not {type(system).__name__!r}")
    if method not in METHODS:
        raise SpecError(f"c2d: method={method!r} is not available; {nearest(method, list(METHODS))}")
    step = _step("c2d", dt)
    delays = system.input_delays("c2d")
    late, rests = _samples(delays, step)
    if any(rests) and method != "zoh":
        delay = delays[np.argmax(rests)]
        raise SpecError(
            f"c2d: the delay of {delay:g} s is {delay / step:.6g} samples of {step:g} s, not a whole number; "
            f'take method="zoh", a dt that divides it, as {delay / max(round(delay / step), 1):.6g}, or a '
            "Padé form, mf.ss(system.to_control(pade=3))"
        )
    plain = system.without_delays().to_scipy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BadCoefficients)  # numerators that begin with a zero
        if any(rests):
            return _held_late(plain, late, rests, step)
        return _delayed(plain.to_discrete(step, method=METHODS[method]), late)


def _samples(delays: tuple[float, ...], dt: float) -> tuple[list[int], list[float]]:
    """Delays of the inputs in whole samples, and what is left of them in s."""
    late, rests = [], []
    for delay in delays:
        whole = abs(delay - round(delay / dt) * dt) <= WHOLE * max(delay, dt)
        late.append(round(delay / dt) if whole else int(delay // dt))
        rests.append(0.0 if whole else delay - late[-1] * dt)
    return late, rests


def _delayed(system: Any, late: list[int]) -> Any:
    """A sampled system whose inputs are late by so many samples."""
    from scipy.signal import TransferFunction

    if not any(late):
        return system
    if isinstance(system, TransferFunction):
        return TransferFunction(system.num, np.append(system.den, np.zeros(late[0])), dt=system.dt)
    nothing = np.zeros_like(system.B), np.zeros_like(system.D)
    return _registers(system.A, system.C, (system.B, system.D), nothing, late, late, system.dt)


def _held_late(plain: Any, late: list[int], rests: list[float], dt: float) -> Any:
    """A system whose held inputs are late by samples and a rest: each sample acts in two intervals.

    K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, section 2.3.
    """
    from scipy.signal import TransferFunction, ss2tf

    system = plain.to_ss()
    now, before = np.zeros_like(system.B), np.zeros_like(system.B)
    direct, direct_before = system.D.copy(), np.zeros_like(system.D)
    phi = _over(system.A, system.B, dt)[0]
    for k, rest in enumerate(rests):
        through, own = _over(system.A, system.B[:, [k]], dt - rest)
        now[:, [k]] = own
        if rest:
            before[:, [k]] = through @ _over(system.A, system.B[:, [k]], rest)[1]
            direct[:, k], direct_before[:, k] = 0.0, system.D[:, k]
    if isinstance(plain, TransferFunction):
        first, den = ss2tf(phi, now, system.C, direct)
        second, _ = ss2tf(phi, before, system.C, direct_before)
        num = np.append(first[0], 0.0) + np.append(0.0, second[0])
        return TransferFunction(np.trim_zeros(num, "f"), np.append(den, np.zeros(late[0] + 1)), dt=dt)
    counts = [own + (rest > 0) for own, rest in zip(late, rests, strict=True)]
    return _registers(phi, system.C, (now, direct), (before, direct_before), late, counts, dt)


def _over(a: F64, b: F64, dt: float) -> tuple[F64, F64]:
    """What states become after a while, and what a held input adds to them."""
    from scipy.linalg import expm

    n, inputs = b.shape
    whole = expm(np.block([[a, b], [np.zeros((inputs, n + inputs))]]) * dt)
    return whole[:n, :n], whole[:n, n:]


def _registers(
    phi: F64,
    out: F64,
    now: tuple[F64, F64],
    before: tuple[F64, F64],
    late: list[int],
    counts: list[int],
    dt: float,
) -> Any:
    """A state space with a state for each sample of delay.

    `now`: how the sample that is `late` acts on states and outputs; `before`: the same of the one before it,
    where the register of an input is longer by one (`counts`).
    """
    from scipy.signal import StateSpace

    n, size, at = len(phi), len(phi) + sum(counts), len(phi)
    a, c = np.zeros((size, size)), np.zeros((len(out), size))
    b, d = np.zeros((size, len(late))), np.zeros_like(now[1])
    a[:n, :n], c[:, :n] = phi, out
    for k, (samples, count) in enumerate(zip(late, counts, strict=True)):
        # Each state of this row is the sample before it.
        if count:
            b[at, k] = 1.0
            a[range(at + 1, at + count), range(at, at + count - 1)] = 1.0
        if samples:
            a[:n, at + samples - 1], c[:, at + samples - 1] = now[0][:, k], now[1][:, k]
        else:
            b[:n, k], d[:, k] = now[0][:, k], now[1][:, k]
        if count > samples:
            a[:n, at + samples], c[:, at + samples] = before[0][:, k], before[1][:, k]
        at += count
    return StateSpace(a, b, c, d, dt=dt)


@public
def d2c(system: Any, method: str = "zoh") -> LTI:
    """Return the continuous-time system of a sampled one.

    Parameters
    ----------
    system : discrete-time system of SciPy or python-control
        With its sampling interval ``dt``.
    method : {"zoh", "tustin"}
        How it was sampled: the input held, or the bilinear transformation.

    Returns
    -------
    LTI
        A transfer function of one with one input and output, else a state space.

    Raises
    ------
    SpecError
        A system without dt, or with poles that no sampled system has, such as negative real ones.

    See Also
    --------
    modfun.c2d : Samples a system.

    References
    ----------
    As `c2d`.

    Examples
    --------
    >>> import modfun as mf
    >>> mf.d2c(mf.c2d(mf.tf([5], [1, 3, 8]), 0.1))
          5
    -------------
    s^2 + 3 s + 8
    """
    if method not in ("zoh", "tustin"):
        raise SpecError(f"d2c: method={method!r} is not available; {nearest(method, ['zoh', 'tustin'])}")
    dt = getattr(system, "dt", None)
    if isinstance(dt, bool) or dt in (None, 0):
        raise SpecError(f"d2c: give a sampled system with its dt, not {type(system).__name__!r}")
    matrices, single = _matrices(system)
    found = ss(*(_held if method == "zoh" else _bilinear)(*matrices, _step("d2c", dt)))
    if not single:
        return found
    num, den = found.polynomials()
    top = num[0][0].copy()
    top[np.abs(top) < 1e-10 * np.abs(top).max()] = 0.0  # rounding of the logarithm
    return tf(np.trim_zeros(top, "f") if top.any() else [0.0], den[0][0])


def _step(what: str, dt: Any) -> float:
    step = real(what, "dt", dt)
    if not step > 0:
        raise SpecError(f"{what}: dt={dt!r}; give the sampling interval in seconds, above 0")
    return step


def _matrices(system: Any) -> tuple[tuple[F64, F64, F64, F64], bool]:
    """A, B, C, D, and whether the system was a transfer function of one input and output."""
    if all(hasattr(system, name) for name in "ABCD"):
        return tuple(np.atleast_2d(getattr(system, name)) for name in "ABCD"), False  # type: ignore[return-value]
    from scipy import signal

    nums: Any = [[getattr(system, "num", None)]]
    dens: Any = [[getattr(system, "den", None)]]
    num, den = getattr(system, "num_list", nums), getattr(system, "den_list", dens)
    if len(num) != 1 or len(num[0]) != 1 or num[0][0] is None or np.ndim(num[0][0]) != 1:
        raise SpecError("d2c: give a system in state space, or a transfer function of one input and output")
    return signal.tf2ss(num[0][0], den[0][0]), True


def _held(a: F64, b: F64, c: F64, d: F64, dt: float) -> tuple[F64, F64, F64, F64]:
    """The system whose input was held: exp([[A, B], [0, 0]]·dt) has the blocks of the sampled one."""
    from scipy.linalg import logm

    n, inputs = b.shape
    poles = np.linalg.eigvals(a) if n else np.ones(1)
    if bad := [pole for pole in poles if pole.real <= 0 and abs(pole.imag) < 1e-12 * max(abs(pole), 1e-300)]:
        raise SpecError(f"d2c: the pole {bad[0].real:.4g} is none of a held system; method='tustin' takes it")
    whole = np.block([[a, b], [np.zeros((inputs, n)), np.eye(inputs)]])
    rate = np.real(logm(whole)) / dt
    return rate[:n, :n], rate[:n, n:], c, d


def _bilinear(a: F64, b: F64, c: F64, d: F64, dt: float) -> tuple[F64, F64, F64, F64]:
    """The system of which z = (1 + s·dt/2)/(1 − s·dt/2) made the sampled one."""
    one = np.eye(len(a))
    try:
        over = np.linalg.inv(a + one)
    except np.linalg.LinAlgError:
        raise SpecError("d2c: a pole at -1 has no counterpart in continuous time") from None
    return 2 / dt * over @ (a - one), 2 / dt * over @ b, 2 * c @ over, d - c @ over @ b
