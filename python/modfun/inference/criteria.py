"""AIC and BIC of fits beside each other: over the widest band of all, or of few uneven samples themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.names import listed
from ..fitting.by_response import sample_likelihood
from ..fitting.by_samples import LOGS, is_few
from ..results.cures import again, bic_beside, on_band
from ..results.fit import Fit

__all__ = ["Criteria", "criteria_of"]

UNKNOWN = (float("nan"), float("nan"))
Found = dict[str, tuple[float, int]]


@dataclass(frozen=True)
class Criteria:
    """What the criteria of models on the same data are made of.

    Parameters
    ----------
    found : dict of str to (float, int)
        Twice the negative log likelihood and the number of unknowns of each model that has them.
    rows : float
        Real equations, or samples, that all count as having.
    together : int
        Outputs whose noise covariance is fitted.
    notes : tuple of str
        What they count where that is not lines, and why a model has none.
    """

    found: Found = field(default_factory=dict)
    rows: float = float("nan")
    together: int = 1
    notes: tuple[str, ...] = ()

    def of(self, name: str) -> tuple[float, float]:
        """AIC and BIC of a model, nan where it has none."""
        if name not in self.found:
            return UNKNOWN
        deviance, unknowns = self.found[name]
        return deviance + 2 * unknowns, float(deviance + unknowns * np.log(self.rows))


def criteria_of(fits: Mapping[str, Fit]) -> Criteria:
    """The criteria of fits on what they have in common, see `Comparison`."""
    if not fits:
        return Criteria()
    if apart := _apart(list(fits.values())):
        return Criteria(notes=(f"aic and bic do not compare: {apart}.",))
    if any(map(_ends_at_samples, fits.values())):
        return _of_samples(fits)
    return _of_lines(fits)


def _apart(fits: Sequence[Fit]) -> str:
    """Why criteria of fits do not compare, in words; empty where they do."""
    if any(fit.again is None or fit.records is None for fit in fits):
        return "a fit was loaded without its records"
    if any(fit.records != fits[0].records for fit in fits):
        return "the fits are not of the same records"
    for word in ("noise", "output_weights"):
        if len({getattr(fit.options, word) for fit in fits}) > 1:
            return f"the fits differ in {word}="
    return "the fits differ in their outputs" if len({fit.outputs for fit in fits}) > 1 else ""


def _ends_at_samples(fit: Any) -> bool:
    """Whether a fit of uneven samples is least squares of these, or so few that its lines tell little."""
    uneven = any([rec.dt is None for rec in fit.records or ()])
    white = fit.options.noise in ("output", LOGS)
    return bool(uneven and fit.usable and (getattr(fit, "by_response", False) or (white and is_few(fit))))


def _of_lines(fits: Mapping[str, Fit]) -> Criteria:
    """Over the widest band of all, or of the samples where a fit over that band ends there."""
    band = min(fit.band[0] for fit in fits.values()), max(fit.band[1] for fit in fits.values())
    made = {
        name: again(fit, fit.records or (), fit.structure, on_band(fit, band)) for name, fit in fits.items()
    }
    usable = {name: fit for name, fit in made.items() if fit is not None}
    if any(map(_ends_at_samples, usable.values())):
        return _of_samples(fits)
    over = f"over the band of all, {band[0]:.4g} to {band[1]:.4g} rad/s"
    notes = _without([name for name in fits if name not in usable], f"cannot be fitted {over}")
    if not usable:
        return Criteria(notes=notes)
    # Beside the longest windows: what has a delay is compared over its own, which starts late, and does not
    # compare where the other has no answer there.
    base = max(usable.values(), key=lambda fit: sum(fit.intervals))
    rows = float(base.df_resid + base.params.size)
    found: Found = {}
    for name, fit in usable.items():
        deviance = float(bic_beside(fit, base) - fit.params.size * np.log(rows))
        if np.isfinite(deviance):
            found[name] = deviance, fit.params.size
    late = [name for name in usable if name not in found]
    notes += _without(late, "leaves nothing, or starts so late that the others have no fit over its window")
    together = len(base.outputs) if base.options.fits_covariance else 1
    return Criteria(found, rows, together, notes)


def _of_samples(fits: Mapping[str, Fit]) -> Criteria:
    """Of the samples that count, with free initial states and trends among the unknowns."""
    made = {name: sample_likelihood(fit) for name, fit in fits.items()}
    usable = {name: own for name, own in made.items() if own is not None and np.isfinite(own[0])}
    notes = _without(
        [name for name in fits if name not in usable], "has no response with a likelihood of the samples"
    )
    counts = {count for _, _, count in usable.values()}
    if not usable:
        return Criteria(notes=notes)
    if len(counts) > 1:
        told = listed([str(count) for count in sorted(counts)])
        return Criteria(notes=(*notes, f"aic and bic do not compare: the fits count {told} samples."))
    count = counts.pop()
    note = f"aic and bic are of the responses at the {count} samples, which are too few and uneven for sums."
    found = {name: (deviance, unknowns) for name, (deviance, unknowns, _) in usable.items()}
    return Criteria(found, float(count), 1, (note, *notes))


def _without(names: Sequence[str], why: str) -> tuple[str, ...]:
    return tuple([f"No aic and bic of {name!r}: it {why}." for name in names])
