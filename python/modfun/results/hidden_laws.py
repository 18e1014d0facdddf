"""What drives equations: noise, or a control law behind a recorded input, as a yaw damper behind pedals."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from ..base.cached import kept
from .cures import STRONG, Cure, again, on_band
from .doubts import Doubt
from .driven_equations import beside_turbulence, bic_of_driven, without_noises
from .estimates import Estimates
from .linear_lines import linear_of, lines_beside, responses_of, signal_lines, testable
from .worth import Lines

__all__ = ["DRIVES", "Law", "hidden_law", "likeliest_law", "what_drives"]

DRIVES = "seems to drive the equations"

# Part of what noise in each equation lowers BIC by that a law does at least. Of pedals with a yaw damper it
# was 0.6 to 0.7, of 14 records in turbulence at most 0.14; of 60 such records none had a law.
SHARE = 1 / 3
TIMES = 8  # constants of lags that are tried, between the ends of the band


@dataclass(frozen=True)
class Law:
    """An answer of an input to an output, at once and through a lag.

    Attributes
    ----------
    channel, output : str
        Which input answers which output.
    time : float
        Constant of the lag, s.
    fall : float
        By how much BIC falls with it.
    """

    channel: str
    output: str
    time: float
    fall: float


@kept
def likeliest_law(fit: Estimates) -> Law | None:
    """The law behind an input that explains most of the residuals; None where none explains anything.

    What an input does to the outputs is known from the fit: an answer to an output goes the same way. A gain
    alone is none that could be told, as it changes the derivatives; with a lag beside it laws wash out an
    output, add its integral, or filter it. One Gauss-Newton step of the parameters and both gains.
    """
    if len(fit.outputs) < 2:
        return None  # of one output, noise inside the system and an answer to it look alike
    model = linear_of(fit) if testable(fit) and fit.inputs else None
    found = lines_beside(fit, []) if model else None
    if model is None or found is None:
        return None
    size, outputs = fit.params.size, len(fit.outputs)
    bare = [(e, columns[:size], ends) for e, columns, ends in found]
    before, _, cov = Lines(bare, size).settled([], fit.noise_cov)
    seen = []
    for k in range(len(bare)):
        v, _, _, powers, _ = signal_lines(fit, model, k, exact=False)
        answers = responses_of(fit, model, k, max(fit.lines[k][0], 1), fit.lines[k][1])
        seen.append((powers[1], answers, dict(zip(model.of, v, strict=True))))
    rows, best = fit.df_resid + size, None
    for time in np.geomspace(1 / fit.band[1], 1 / min(fit.omega0), TIMES).tolist():
        for j, channel in enumerate(fit.inputs):
            for i, output in enumerate(fit.outputs):
                parts = []
                for (e, columns, ends), (s, answers, signals) in zip(bare, seen, strict=True):
                    law = answers[:, j] * signals[i]
                    parts.append((e, np.concatenate([columns, [law, law / (1 + s * time)]]), ends))
                after, *_ = Lines(parts, size).settled([size, size + 1], cov)
                fall = rows / outputs * (before - after) - 3 * log(rows)
                if fall > (best.fall if best else 0.0):
                    best = Law(channel, output, time, fall)
    return best


def what_drives(fit: Estimates, cure: Cure, level: str, at_once: bool) -> Doubt:
    """What drives the equations, where noise in them explains residuals best.

    `level`: that of the residuals, in words; `at_once`: whether most of them stand at one time.
    """
    fallen = f"BIC falls from {cure.before:.4g} to {cure.after:.4g}"
    if at_once:  # gusts have no place in time
        return Doubt(
            f"{level}most of them at one time: an input that is not in the record seems to act, such as a "
            "rudder or a flap. First look when it does, fit.plot_response(), and add that input to the "
            f"record; otherwise {cure.words}, with which {fallen}."
        )
    if law := _told(fit, cure.before - cure.after):
        return Doubt(f"{level}and something {DRIVES}, but {law}.")
    cause = "One cause, such as a gust," if "ProcessNoise" in cure.words else "Turbulence or load"
    return Doubt(
        f"{level}and their spectra are no sensor's. {cause} {DRIVES}, and standard errors are too small; an "
        f"input that is not in the record, or a missing term, looks alike. First try {cure.words}: {fallen}."
    )


@kept
def hidden_law(fit: Estimates) -> Doubt | None:
    """That a fit takes for noise in its equations what a control law behind an input does."""
    model = without_noises(fit)
    white = fit.options.replace(noise="output", band=None, harmonics=None)
    plain = again(fit, fit.records, model, white) if model is not None else None
    law = likeliest_law(plain) if plain else None
    if plain is None or law is None or not law.fall > STRONG:
        return None
    wide = beside_turbulence(plain)
    over = again(plain, plain.records, model, on_band(plain, wide.band)) if wide else None
    told = _told(plain, over.bic - bic_of_driven(wide)) if wide and over else ""
    return Doubt(f"Something {DRIVES}, but {told}.") if told else None


def _told(fit: Estimates, fall: float) -> str:
    """That a law explains much of what noise in the equations does, by which BIC falls; "" if none does."""
    law = likeliest_law(fit)
    if law is None or not law.fall > max(STRONG, SHARE * fall):
        return ""
    u, y = law.channel, law.output
    return (
        f"the residuals move as if {u} answered {y}, too, through a lag or a washout (BIC falls by "
        f"{law.fall:.3g}, by {fall:.3g} with noise in the equations): a control law, such as a yaw damper, "
        f"may act behind the recorded {u}. First record what moves the system, as the position of the "
        f'surface, in place of the command {u}; noise="process" takes what the law does for noise, and '
        "leaves derivatives wrong by many of their errors"
    )
