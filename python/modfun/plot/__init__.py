"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings.

They are drawn where what they show is made; here they stand under one name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..base.axes import drawing
from ..inference.comparison import Comparison, CrossValidation
from ..inference.order import OrderSelection
from ..inference.term_selection import TermSelection
from ..records.record import Record
from ..reduction.reduction import Reduction
from ..results.drawing import bode, correlation, poles, response
from ..results.drawing_lines import harmonics, residual_tests, residuals
from ..results.drawing_sheet import fit
from ..results.drawing_systems import impulse, nyquist, step
from ..signals.signals import Signals
from ..signals.spectrum import Spectrum
from ..streams.track import Track
from ..study.drawing import study
from ..study.drawing_estimates import histogram, quantiles
from ..tones.results import Sinusoids

__all__ = [
    "bode",
    "comparison",
    "correlation",
    "cross_validation",
    "fit",
    "harmonics",
    "histogram",
    "impulse",
    "nyquist",
    "order",
    "poles",
    "quantiles",
    "record",
    "reduction",
    "residual_tests",
    "residuals",
    "response",
    "signals",
    "sinusoids",
    "spectrum",
    "step",
    "study",
    "terms",
    "track",
]


@drawing
def record(rec: Record, ax: Any = None, *, beside: Sequence[Record] = ()) -> Any:
    """Draw a record over time: outputs above, inputs below, held inputs as steps.

    Masked samples are left out; dotted lines bridge them.

    Parameters
    ----------
    rec : Record
    ax : Axes or sequence of Axes, optional
        One Axes a channel, or a single one for all channels (with a legend); new ones by default. With
        others beside it row by row, one per channel and record.
    beside : sequence of Record, optional
        Records of the same channels, drawn beside it on the same scales.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one channel or one was given, otherwise one per channel; with others
        beside it (channel, record).

    See Also
    --------
    modfun.Record.plot : The same as a method.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> ax = mf.plot.record(rec)
    >>> [one.get_ylabel() for one in ax]
    ['y', 'u']
    """
    return rec.plot(ax, beside=beside)


@drawing
def signals(given: Signals, ax: Any = None) -> Any:
    """Draw the inputs of an experiment over time, held ones as steps.

    Parameters
    ----------
    given : Signals
    ax : Axes or sequence of Axes, optional
        One Axes an input, or a single one for all inputs (with a legend); new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one input or one was given, otherwise one per input.

    See Also
    --------
    modfun.signals.doublet : A signal to draw.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> ax = mf.plot.signals(mf.signals.doublet("de", width=0.8, dt=0.02, amplitude=2.0, duration=10.0))
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'time (s)', 'de')
    """
    return given.plot(ax)


@drawing
def spectrum(spec: Spectrum, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw amplitude spectra, both axes logarithmic.

    Parameters
    ----------
    spec : Spectrum
    ax : Axes or sequence of Axes, optional
        One Axes a channel, or a single one for all channels (with a legend); new ones by default.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one channel or one was given, otherwise one per channel.

    See Also
    --------
    modfun.Record.spectrum : Makes it.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> ax = mf.plot.spectrum(rec.spectrum())
    >>> [one.get_ylabel() for one in ax]
    ['y', 'u']
    """
    return spec.plot(ax, hz=hz)


@drawing
def sinusoids(found: Sinusoids, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the spectrum of a record and of what its tones leave, in dB, the tones as dots.

    Zero-padded, without a window: a tone that does not decay stands at its amplitude.

    Parameters
    ----------
    found : Sinusoids
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes

    See Also
    --------
    modfun.sinusoids : Finds the tones.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> t = np.arange(200) * 0.1
    >>> y = np.sin(1.3 * t) + 0.01 * np.random.default_rng(0).normal(size=t.size)
    >>> found = mf.sinusoids(mf.Record(y=y, dt=0.1), count=1)
    >>> ax = mf.plot.sinusoids(found)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'frequency (rad/s)', 'amplitude (dB)')
    """
    return found.plot(ax=ax, hz=hz)


@drawing
def track(found: Track, ax: Any = None) -> Any:
    """Draw estimates over time, each with a band of two standard errors.

    Parameters
    ----------
    found : Track
        Of `Stream.follow`. Moments whose estimates cannot be used are left out.
    ax : Axes or sequence of Axes, optional
        One per parameter; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one parameter, otherwise one per parameter.

    See Also
    --------
    modfun.Stream.follow : Makes the track.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.02, duration=20.0)
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input=chirp, nsr=0.05, seed=0)
    >>> estimator = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=10)
    >>> stream = mf.Stream(estimator, dt=rec.dt, window=10.0)
    >>> track = stream.follow(rec, every=50)
    >>> ax = mf.plot.track(track)
    >>> [one.get_ylabel() for one in ax]
    ['a1', 'a2', 'b0']
    """
    return found.plot(ax)


@drawing
def reduction(red: Reduction, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the gains of a system, of its reduced model and of their difference over frequency.

    Parameters
    ----------
    red : Reduction
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes
        With several channels the largest gain over directions is drawn.

    See Also
    --------
    modfun.reduce : Makes the reduction.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> reduction = mf.reduce(mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24]), 2)
    >>> ax = mf.plot.reduction(reduction)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'frequency (rad/s)', 'gain')
    """
    return red.plot(ax=ax, hz=hz)


@drawing
def comparison(table: Comparison, ax: Any = None) -> Any:
    """Draw the measured outputs of a record and what each fit simulates, with its fit in per cent.

    Parameters
    ----------
    table : Comparison
    ax : Axes or sequence of Axes, optional
        One Axes an output, or a single one for all; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one output or one was given, otherwise one per output.

    See Also
    --------
    modfun.compare : Makes the table.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> other = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1))
    >>> table = mf.compare({"no zero": fit, "one zero": other}, rec)
    >>> ax = mf.plot.comparison(table)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'time (s)', 'y')
    """
    return table.plot(ax=ax)


@drawing
def cross_validation(table: CrossValidation, ax: Any = None) -> Any:
    """Draw how well each record left out is simulated, an estimator a line; below -100 % is left out.

    Parameters
    ----------
    table : CrossValidation
    ax : Axes or sequence of Axes, optional
        One Axes an output, or a single one for all; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes

    See Also
    --------
    modfun.cross_validate : Makes the table.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.04, duration=10.0)
    >>> records = [mf.simulate(system, input=chirp, nsr=0.1, seed=seed) for seed in range(3)]
    >>> two = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=12)
    >>> cv = mf.cross_validate(records, {"two": two})
    >>> ax = mf.plot.cross_validation(cv)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'record left out', 'fit (%)')
    """
    return table.plot(ax=ax)


@drawing
def order(selection: OrderSelection, ax: Any = None) -> Any:
    """Draw residual level and criterion of the candidates over the number of poles.

    Parameters
    ----------
    selection : OrderSelection
    ax : Axes or sequence of two Axes, optional
        A single Axes takes the criterion alone; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        Above the residual level (logarithmic) with the noise level dashed, below the criterion over its
        lowest value; a number at a point is that of its zeros, the chosen candidate is ringed.

    See Also
    --------
    modfun.select_order : Makes the selection.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> orders = mf.select_order(rec, poles=[1, 2, 3])
    >>> ax = mf.plot.order(orders)
    >>> [one.get_ylabel() for one in ax]
    ['residual level', 'calibrated BIC over its lowest']
    """
    return selection.plot(ax=ax)


@drawing
def terms(selection: TermSelection, ax: Any = None) -> Any:
    """Draw the criterion over the number of terms, and the probability that each term belongs.

    Parameters
    ----------
    selection : TermSelection
    ax : Axes or sequence of two Axes, optional
        A single Axes takes the criterion alone; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        Above the lowest criterion of each size over the lowest of all, the chosen size ringed; below the
        probabilities of the likeliest candidates, the chosen ones in red.

    See Also
    --------
    modfun.select_terms : Makes the selection.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> duffing = mf.Equation("y'' + 0.3*y' + y + 0.5*y**3 = u")
    >>> rec = mf.simulate(duffing.model({}), input="2*sin(1.1*t) + 1.5*sin(2.3*t)", duration=20.0,
    ...                   intervals=1024, nsr=0.05)
    >>> found = mf.select_terms(rec, "y, y**2, y**3, y', u", target="y''")
    >>> ax = mf.plot.terms(found)
    >>> [one.get_xlabel() for one in ax]
    ['number of terms', 'probability that a term belongs']
    """
    return selection.plot(ax=ax)
