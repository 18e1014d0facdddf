"""Frequency responses from whole periods: noise by periods, nonlinear distortion by realisations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..errors import DataError
from ..records.periods import periods
from ..records.record import Record
from ..systems.frequency_response import FrequencyResponse
from .coefficients import spectrum

__all__ = ["from_periods", "repeated"]

EXCITED = 1e-6  # power of a line over the largest of its input
NEIGHBOURS = 4  # lines left out, at most, that tell the distortion of one that is not


@dataclass(frozen=True)
class _Realisation:
    """As many records as there are inputs, on all lines of a period.

    Attributes
    ----------
    y : (output, record, line) array
        Means over periods.
    u : (input, record, line) array
    noise : (line, output, output) array
        Covariance of a period's output that scatter between periods has.
    degrees : int
        Of `noise`, complex.
    periods : int
    """

    y: C128
    u: C128
    noise: C128
    degrees: int
    periods: int


def from_periods(records: list[Record], low: float, high: float) -> FrequencyResponse:
    """Gains on the excited lines between two frequencies.

    Raises
    ------
    DataError
        Records of other periods, too few for the inputs, inputs that do not differ enough, or one period in
        all.
    """
    first, inputs = records[0], len(records[0].inputs)
    if len(records) % inputs:
        raise DataError(
            f'frf: method="periodic" with {inputs} inputs takes {inputs} records a realisation; there are '
            f"{len(records)}"
        )
    counts = [periods(rec) for rec in records]
    lengths = [rec.duration / count for rec, count in zip(records, counts, strict=True)]
    if np.ptp(lengths) > 1e-9 * lengths[0] or any(rec.dt != first.dt for rec in records):
        raise DataError(
            f"frf: the inputs repeat after {', '.join(f'{t:.6g}' for t in lengths)} s; records need one "
            "period and one step"
        )
    made = [
        _realisation(records[k : k + inputs], counts[k : k + inputs]) for k in range(0, len(records), inputs)
    ]
    if len(made) == 1 and made[0].degrees == 0:
        raise DataError(
            'frf: method="periodic" needs two periods or two realisations, and the inputs of this record do '
            'not repeat; cut whole periods with rec.window, or take method="lrm"'
        )
    spacing = 2 * np.pi / lengths[0]
    lines = np.arange(made[0].u.shape[2])
    excited = np.all([_excited(one.u) for one in made], axis=0)
    used = lines[excited & (lines > 0) & (lines * spacing >= low) & (lines * spacing <= high)]
    if not used.size:
        raise DataError(
            "frf: no line is excited by all inputs in the band; with several inputs each record must move "
            "all of them, with other signs or phases in each"
        )
    return _response(first, made, used, used * spacing)


def _realisation(records: list[Record], counts: list[int]) -> _Realisation:
    y, u, scatter, degrees = [], [], [], 0
    for rec, count in zip(records, counts, strict=True):
        steps = rec.intervals // count
        parts = [
            spectrum(rec._slice(k * steps, (k + 1) * steps + 1), steps // 2, "trapezoid")
            for k in range(count)
        ]
        each = np.array([part[0] for part in parts])
        y.append(each.mean(axis=0))
        u.append(np.mean([part[1] for part in parts], axis=0))
        apart = each - y[-1]
        scatter.append(np.einsum("pok,pqk->koq", apart, apart.conj()))
        degrees += count - 1
    return _Realisation(
        np.stack(y, axis=1),
        np.stack(u, axis=1),
        np.sum(scatter, axis=0) / max(degrees, 1),
        degrees,
        min(counts),
    )


def _excited(u: C128) -> NDArray[np.bool_]:
    """Lines on which every input moves in some record."""
    power = np.sum(np.abs(u) ** 2, axis=1)
    return np.asarray(np.all(power > EXCITED * power.max(axis=1, keepdims=True), axis=0))


def _response(
    first: Record, made: list[_Realisation], used: NDArray[np.int64], omega: F64
) -> FrequencyResponse:
    outputs, inputs = len(first.outputs), len(first.inputs)
    paths = outputs * inputs
    gains, covs = [], []
    for one in made:
        u = np.moveaxis(one.u[:, :, used], 2, 0)
        if np.any(np.linalg.cond(u) > 1e6):
            raise DataError(
                "frf: the inputs of the records of a realisation are nearly proportional on some lines; "
                "change signs or phases from record to record"
            )
        inverse = np.linalg.inv(u)
        gains.append(np.einsum("oek,kei->oik", one.y[:, :, used], inverse))
        share = np.einsum("kei,kej->kij", inverse, inverse.conj()) / one.periods
        covs.append(np.einsum("koq,kij->koiqj", one.noise[used], share).reshape(-1, paths, paths))
    mean = np.mean(gains, axis=0)
    noise = np.mean(covs, axis=0)
    degrees = float(sum(one.degrees for one in made))
    if len(made) > 1:
        apart = (np.array(gains) - mean).reshape(len(made), paths, -1)
        total = np.einsum("mpk,mqk->kpq", apart, apart.conj()) / (len(made) - 1)
        own = np.einsum("kpp->pk", total - noise).real.reshape(mean.shape)
        distortion = np.sqrt(np.maximum(own, 0.0)) if degrees else None
        cov, degrees = total / len(made), float(len(made) - 1)
    else:
        distortion, cov = _left_out(made[0], used), noise
    words = f"periodic, {made[0].periods} periods, {len(made)} realisation{'s' if len(made) > 1 else ''}"
    return FrequencyResponse(
        omega,
        mean,
        cov=cov,
        noise_cov=np.mean([one.noise[used] for one in made], axis=0) if made[0].degrees else None,
        degrees=np.full(omega.size, degrees),
        distortion=distortion,
        outputs=first.outputs,
        inputs=first.inputs,
        source=words,
    )


def _left_out(one: _Realisation, used: NDArray[np.int64]) -> F64 | None:
    """Distortion of the gains of one input by what the output has on lines that the input leaves out."""
    if one.u.shape[0] > 1:
        return None
    silent = np.setdiff1d(np.arange(used[0], used[-1] + 1), used)
    if np.all(used % 2 == 1):
        silent = silent[silent % 2 == 1]  # what is even of it falls on even lines
    if not silent.size:
        return None
    own = np.abs(one.y[:, 0, silent]) ** 2 - np.einsum("koo->ok", one.noise[silent]).real / one.periods
    near = np.argsort(np.abs(silent - used[:, None]), axis=1)[:, :NEIGHBOURS]
    level = np.maximum(own[:, near].mean(axis=2), 0.0)
    return np.asarray(np.sqrt(level)[:, None] / np.abs(one.u[:, 0, used]))


def repeated(method: str, records: list[Record]) -> tuple[str, ...]:
    """That polynomials see few of the lines that repeated inputs have."""
    most = max(periods(rec) for rec in records) if method == "lpm" else 1
    if most == 1:
        return ()
    return (
        f"The inputs repeat {most} times, so that one line in {most} has a signal, and polynomials miss "
        'resonances between lines so far apart. First try method="periodic", or "lrm".',
    )
