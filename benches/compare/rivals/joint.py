"""Linear models of several outputs, fitted whole: each call makes a simulator from a record.

A simulator gives the outputs, (output, time), that its model has for other inputs, from rest.
"""

import modfun as mf
import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import dlsim, lfilter, ss2tf


def simulator(a, b, c, d, dt):
    """Of a discrete state space."""
    return lambda u: dlsim((a, b, c, d, dt), u.T)[1].T


def modfun_ml(rec, poles):
    """`mf.fit`: a denominator of its own for each output, default band, covariance of the noise estimated."""
    fit = mf.fit(rec, mf.TransferFunction(poles=poles, zeros=poles - 1, denominator="separate"))

    def simulated(u):
        intervals = u.shape[1] - 1
        return mf.simulate(
            fit.model, input=u, duration=intervals * rec.dt, intervals=intervals, intersample="zoh"
        ).y

    return simulated


def scipy_output_error(rec, poles):
    """`scipy.optimize.least_squares` of each simulated output, free responses estimated; starts at `ls`."""
    structure = mf.TransferFunction(poles=poles, zeros=poles - 1)
    inputs, impulse = rec.u.shape[0], np.zeros(rec.u.shape[1])
    impulse[0] = 1.0

    def filters(theta):
        whole = np.zeros((poles + inputs, poles + inputs))
        # Observer form: the output is the first state.
        whole[:poles, 0] = -theta[:poles]
        whole[np.arange(poles - 1), np.arange(1, poles)] += 1.0
        whole[:poles, poles:] = theta[poles:].reshape(inputs, poles).T
        held = expm(whole * rec.dt)
        c = np.eye(1, poles)
        columns = [held[:poles, [k]] for k in range(poles, poles + inputs)]
        pairs = [ss2tf(held[:poles, :poles], b, c, np.zeros((1, 1))) for b in columns]
        return [b[0] for b, _ in pairs], pairs[0][1]

    def driven(theta, u):
        numerators, a = filters(theta)
        return sum(lfilter(b, a, row) for b, row in zip(numerators, u, strict=True)), a

    found = []
    for name, y in zip(rec.outputs, rec.y, strict=True):
        den, nums = mf.fit(rec.select(outputs=[name]), structure, method="ls").polynomials()
        first = np.concatenate([den[1:], *[np.pad(b, (poles - b.size, 0)) for b in nums], np.zeros(poles)])
        scale = np.maximum(np.abs(first), 1e-3)

        def residual(x, y=y, scale=scale):
            theta, free = np.split(x * scale, [-poles])
            with np.errstate(all="ignore"):
                out, a = driven(theta, rec.u)
                return np.clip(np.nan_to_num(out + lfilter(free, a, impulse) - y), -1e6, 1e6)

        found.append((least_squares(residual, first / scale, method="lm").x * scale)[:-poles])
    return lambda u: np.array([driven(theta, u)[0] for theta in found])


def sippy_n4sid(rec, poles):
    """SIPPY's N4SID of as many states as the outputs have in all, horizons of 20 samples."""
    from .oe_sippy import quietly

    model = quietly(rec.y, rec.u, "N4SID", SS_fixed_order=poles * rec.y.shape[0], SS_f=20, SS_p=20)
    return simulator(*(np.asarray(part) for part in (model.A, model.B, model.C, model.D)), rec.dt)


def jax_sysid(rec, poles):
    """jax-sysid's LinearModel of as many states, initial state trained: Adam, then L-BFGS."""
    from jax_sysid.models import LinearModel

    outputs, inputs = rec.y.shape[0], rec.u.shape[0]
    u, y = rec.u.T / rec.u.std(axis=1), rec.y.T / rec.y.std(axis=1)
    model = LinearModel(poles * outputs, outputs, inputs, feedthrough=False, sigma=0.9, Ts=rec.dt)
    model.loss(rho_x0=1e-9, rho_th=1e-9)
    model.optimization(adam_epochs=1000, lbfgs_epochs=3000, iprint=-1)
    model.fit(y, u)
    a, b, c, d = (np.asarray(part) for part in model.ssdata())
    up, down = rec.y.std(axis=1)[:, None], rec.u.std(axis=1)
    return simulator(a, b / down, up * c, up * d / down, rec.dt)
