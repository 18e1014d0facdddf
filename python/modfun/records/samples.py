"""Samples of outputs and inputs by channel, and what can be cut and changed of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..base import html
from ..base.arrays import F64
from ..base.between import AUTO, BY_FIT, CLOSE, DOUBTFUL, LOOP, MIXED, OPEN, decided
from ..base.elsewhere import RECORD, Elsewhere
from ..base.names import nearest
from ..base.samples import (
    FEWEST,
    Names,
    Origin,
    channels_of,
    frozen,
    listed,
    refuse_duplicates,
    refuse_nonfinite,
    times_of,
)
from ..errors import DataError, ModfunWarning, SpecError
from .cutting import SLACK, pieces_between, pieces_every, pieces_on
from .functions import known, sampled, shown, warn_of_others
from .mask import Mask, filled, mask_of, present, refuse_scarce, rows_of, scarce, sigma_of

__all__ = ["Samples"]

Own = TypeVar("Own", bound="Samples")


class Samples(Elsewhere):
    """The fields of a `Record`, unchecked and never changed."""

    _elsewhere = RECORD

    __slots__ = (
        "_functions", "_keep", "_lost", "_seen", "_timed", "_units", "dt", "inputs", "intersample", "mask",
        "outputs", "sigma", "source", "t", "u", "y",
    )  # fmt: skip

    y: F64
    u: F64
    t: F64
    dt: float | None
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    intersample: tuple[str, ...]
    mask: Mask | None
    sigma: F64 | None
    source: Origin | None
    _functions: dict[str, Any]  # text or functions of t, by channel; of inputs and kept channels
    _units: dict[str, str]
    _keep: dict[str, F64]
    _timed: bool  # a source said the unit of the times, or the step was given
    _lost: Mask | None  # rows that the times lacked
    _seen: dict[str, str]  # what samples look like that decided on intersample, by input

    def _set(self, **fields: Any) -> None:
        for name in ("y", "u", "t", "mask", "sigma", "_lost"):
            if fields[name] is not None:
                fields[name] = frozen(fields[name])
        fields["_keep"] = {name: frozen(values) for name, values in fields["_keep"].items()}
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _like(self, **changes: Any) -> Self:
        """Return a record with some fields replaced, without the checks that its samples have passed.

        Other inputs than before are known by their samples alone, unless `_functions` says more.
        """
        if "u" in changes:
            changes.setdefault("_functions", {})
        return _restore(type(self), {**self._fields(), **changes})

    def _fields(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in Samples.__slots__}

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(
            f"a Record cannot be changed ({name}); use assign, select or window for a new one"
        )

    def __delattr__(self, name: str) -> None:
        raise AttributeError(
            f"a Record cannot be changed ({name}); use assign, select or window for a new one"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self._fields())

    # What it is ------------------------------------------------------------------------------

    @property
    def intervals(self) -> int:
        """Number of sampling intervals N; there are N+1 samples."""
        return len(self.t) - 1

    @property
    def duration(self) -> float:
        """Time T spanned by the samples, in seconds: N·dt."""
        return float(self.t[-1] - self.t[0]) if self.dt is None else self.intervals * self.dt

    @property
    def t0(self) -> float:
        """Time of the first sample in seconds."""
        return float(self.t[0])

    @property
    def units(self) -> dict[str, str]:
        """Units by channel name, where known (a copy)."""
        return dict(self._units)

    @property
    def functions(self) -> dict[str, Any]:
        """Inputs that are known at all times, as text or functions of t by name (a copy)."""
        found = zip(self.inputs, known(self), strict=True) if self._functions else ()
        return {name: source for name, source in found if source is not None}

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of further channels, neither outputs nor inputs."""
        return tuple(self._keep)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of all channels: outputs, inputs, kept ones."""
        return (*self.outputs, *self.inputs, *self._keep)

    def __getitem__(self, channel: str) -> F64:
        """Return the samples of a channel by name, shape (time,), read only."""
        if channel in self.outputs:
            row: F64 = self.y[self.outputs.index(channel)]
            return row
        if channel in self.inputs:
            row = self.u[self.inputs.index(channel)]
            return row
        if channel in self._keep:
            return self._keep[channel]
        raise SpecError(f"Record: no channel {channel!r}; {nearest(channel, self.channels)}")

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Any:
        raise TypeError(
            "a Record is not a sequence; use rec.channels for the names, rec.y and rec.u for the samples"
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Samples):
            return NotImplemented
        return (
            (self.dt, self.outputs, self.inputs, self.intersample, self._units, self.kept)
            == (other.dt, other.outputs, other.inputs, other.intersample, other._units, other.kept)
            and self.functions == other.functions
            and all(
                np.array_equal(getattr(self, name), getattr(other, name))  # None is equal to None alone
                for name in ("y", "u", "t", "mask", "sigma")
            )
            and all(np.array_equal(self._keep[name], other._keep[name]) for name in self._keep)
        )

    __hash__ = None  # type: ignore[assignment]

    # Parts and changes -----------------------------------------------------------------------

    def window(self, t0: float, t1: float) -> Self:
        """Return the samples from time `t0` to time `t1`, both included.

        Parameters
        ----------
        t0, t1 : float
            Times in seconds on the record's own clock (`t`), which is kept.

        Raises
        ------
        DataError
            If fewer than 8 samples lie in the window, or the mask leaves fewer of an output.
        """
        slack = SLACK * self.duration / self.intervals
        first = int(np.searchsorted(self.t, t0 - slack, side="left"))
        last = int(np.searchsorted(self.t, t1 + slack, side="right"))
        if last - first < FEWEST:
            raise DataError(
                f"window({t0:g}, {t1:g}) holds {max(last - first, 0)} samples, at least {FEWEST} are needed; "
                f"the record runs from {self.t[0]:g} to {self.t[-1]:g} s"
            )
        part = self._slice(first, last)
        refuse_scarce(part.mask, part.outputs, f"window({t0:g}, {t1:g})")
        return part

    def _slice(self, first: int, last: int) -> Self:
        part = slice(first, last)
        t, dt = self.t[part], self.dt
        if dt is None:  # a part of an uneven record may well be even
            t, dt = times_of(last - first, None, None, t, 0.0)
        keep = {name: values[part] for name, values in self._keep.items()}
        mask = None if self.mask is None or self.mask[:, part].all() else self.mask[:, part]
        sigma = None if self.sigma is None else self.sigma[:, part]
        lost = None if self._lost is None or not self._lost[part].any() else self._lost[part]
        return self._like(
            y=self.y[:, part], u=self.u[:, part], t=t, dt=dt, _keep=keep, mask=mask, sigma=sigma, _lost=lost,
            _functions=self._functions,
        )  # fmt: skip

    def split(
        self, *, every: float | None = None, on: str | None = None, gap: float | None = None
    ) -> list[Self]:
        """Cut the record into several.

        Parameters
        ----------
        every : float, optional
            Length of the pieces in seconds. Neighbours share the sample between them, so each spans
            `every` exactly; a shorter rest at the end is left out.
        on : str, optional
            Name of a channel (such as an event marker carried along by `keep`): one record for each
            time it is on, that is, above the middle of its range. A counter, of whole numbers that last
            (three or more, or n and n + 1 with n > 0): one record for each stretch at a number that is not 0.
        gap : float, optional
            Seconds: one record for each stretch whose samples are not farther apart.

        Returns
        -------
        list of Record
            Without pieces too short or too much masked to be records, with a warning.

        Raises
        ------
        SpecError
            If not exactly one of `every`, `on` and `gap` is given, or the channel does not exist.
        DataError
            If no piece would have 8 samples.
        """
        if [every, on, gap].count(None) != 2:
            raise SpecError("split: give one of every= (seconds), gap= (seconds) and on= (name of a channel)")
        if on is not None:
            return self._pieces(*pieces_on(self.t, self[on], on))
        if gap is not None:
            return self._pieces(*pieces_between(self.t, gap, present(self._lost, self.t.size)))
        assert every is not None
        return self._pieces(*pieces_every(self.t, every))

    def _pieces(self, bounds: Sequence[tuple[int, int]], what: str) -> list[Self]:
        """Return the pieces of which the mask leaves enough."""
        pieces = [self._slice(first, last) for first, last in bounds]
        left = [piece for piece in pieces if not scarce(piece.mask).size]
        if not left:
            refuse_scarce(pieces[0].mask, self.outputs, what)
        if len(left) < len(pieces):
            warnings.warn(
                f"{what}: of {len(pieces) - len(left)} of {len(pieces)} pieces the mask leaves fewer than "
                f"{FEWEST} samples of an output; they are left out",
                ModfunWarning,
                stacklevel=4,
            )
        return left

    def select(self, outputs: Names = None, inputs: Names = None) -> Self:
        """Return a record with these channels as outputs and inputs; the others are dropped.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names of any channels of the record, kept ones included; None: as they are. ``inputs=[]``
            leaves no input. Kept channels that are not named stay kept. A channel that becomes an
            output counts in all its samples.

        Raises
        ------
        SpecError
            If a channel does not exist or is named twice, or no output is left.
        DataError
            If an output with masked samples would become an input, which must be known everywhere.
        """
        outs = self.outputs if outputs is None else listed(outputs)
        ins = self.inputs if inputs is None else listed(inputs)
        if not outs:
            raise SpecError(f"select: a record needs an output; there are: {', '.join(self.channels)}")
        refuse_duplicates((*outs, *ins))
        for name in ins:
            if not self._good(name).all():
                raise DataError(
                    f"select: {name!r} has {int((~self._good(name)).sum())} masked samples, and an input "
                    "must be known everywhere; take a window without them, or assign it with the gaps filled"
                )
        count = len(self.t)
        good = np.array([self._good(name) for name in outs])
        sigma = None
        if self.sigma is not None:
            rows = dict(zip(self.outputs, self.sigma, strict=True))
            sigma = np.array([rows.get(name, np.ones(count)) for name in outs])
        new = [name for name in ins if name not in self.inputs]
        words, forms = self._between(ins, {name: self[name] for name in new}, self._functions)
        keep = {name: values for name, values in self._keep.items() if name not in (*outs, *ins)}
        return self._like(
            y=np.reshape([self[name] for name in outs], (len(outs), count)),
            u=np.reshape([self[name] for name in ins], (len(ins), count)),
            outputs=tuple(outs),
            inputs=tuple(ins),
            intersample=words,
            _functions={name: f for name, f in self._functions.items() if name in (*ins, *keep)},
            _seen=forms,
            mask=None if good.all() else good,
            sigma=sigma,
            _keep=keep,
            _units={name: unit for name, unit in self._units.items() if name in (*outs, *ins, *keep)},
        )

    def assign(
        self, *, units: Mapping[str, str] | None = None, **channels: ArrayLike | Callable[[Self], ArrayLike]
    ) -> Self:
        """Return a record with channels replaced or added.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units by channel name, for labels only; those not named stay as they are.
        **channels : array_like, shape (time,), callable or str
            Samples by channel name, or a function of the record that returns them; all functions see
            the record as it was. Text is a function of the time t, as in `Record`: an input so replaced is
            known at all times. A new name becomes a kept channel: `select` makes it an output or
            input. The unit of a channel that is replaced is forgotten, unless `units` says the new one;
            what is masked stays masked and may be nan.

        Raises
        ------
        DataError
            If samples are missing or not finite.
        SpecError
            If `units` names no channel.

        Warns
        -----
        ModfunWarning
            Where text differs from the samples of the input that it replaces.

        Examples
        --------
        >>> import numpy as np
        >>> rec = Record(y=np.arange(9.0), dt=0.1, outputs="q")
        >>> bool(rec.assign(q=lambda r: np.deg2rad(r["q"]))["q"][-1] == np.deg2rad(8.0))
        True
        """
        y, u, keep = self.y.copy(), self.u.copy(), dict(self._keep)
        for name, given in channels.items():
            values = channels_of(self._computed(name, given), f"channel {name!r}", -1)
            if values.shape != (1, len(self.t)):
                raise DataError(
                    f"assign({name}=...): shape {values.shape[1:] if len(values) == 1 else values.shape} "
                    f"where ({len(self.t)},) is needed, one value a sample"
                )
            if name in self.outputs:
                values = filled(values, self._good(name)[None], self.t)
            refuse_nonfinite((name,), values)
            if name in self.outputs:
                y[self.outputs.index(name)] = values[0]
            elif name in self.inputs:
                u[self.inputs.index(name)] = values[0]
            else:
                keep[name] = values[0]
        labels = {name: unit for name, unit in self._units.items() if name not in channels}
        for name, unit in (units or {}).items():
            if name not in (*self.outputs, *self.inputs, *keep):
                raise SpecError(
                    f"assign: units names {name!r}, which is not a channel; "
                    f"{nearest(name, (*self.outputs, *self.inputs, *keep))}"
                )
            labels[str(name)] = str(unit)
        texts = {name: text for name, text in channels.items() if isinstance(text, str)}
        warn_of_others(self, texts, u)
        fresh = {name: u[k] for k, name in enumerate(self.inputs) if name in channels and name in self._seen}
        words, forms = self._between(self.inputs, fresh, texts)
        left = {name: f for name, f in self._functions.items() if name not in channels}
        left |= {name: text for name, text in texts.items() if name not in self.outputs}
        new = {"y": y, "u": u, "_keep": keep, "_units": labels, "_seen": forms, "_functions": left}
        return self._like(intersample=words, **new)

    def _between(
        self, inputs: Sequence[str], fresh: Mapping[str, F64], functions: Mapping[str, Any]
    ) -> tuple[tuple[str, ...], dict[str, str]]:
        """Return words and forms of inputs, those of `fresh` by its samples, the others as they are."""
        known = dict(zip(self.inputs, self.intersample, strict=True))
        new = {name: "smooth" if name in functions else AUTO for name in fresh}
        words = [new.get(name) or known[name] for name in inputs]
        rows = [fresh.get(name, self.t) for name in inputs]
        found, forms = decided(words, rows, None if self.dt else self.t, self.y)
        kept = {name: form for name, form in self._seen.items() if name in inputs and name not in fresh}
        return found, kept | {inputs[k]: form for k, form in forms.items()}

    def _read_as(self, words: Sequence[str]) -> Self:
        """Return the record with these words for inputs that were not declared; "mixed" leaves its own."""
        each = zip(self.inputs, self.intersample, words, strict=True)
        kinds = tuple([word if name in self._seen and word != MIXED else own for name, own, word in each])
        return self if kinds == self.intersample else self._like(intersample=kinds)

    def _read_like(self, words: Sequence[str]) -> Self:
        """Return the record read as those of a fit; of smooth inputs, one seen to be held stays so."""
        both = zip(self.inputs, words, strict=True)
        held = [word == "smooth" and self._seen.get(name) == "held" for name, word in both]
        return self._read_as(["zoh" if own else word for own, word in zip(held, words, strict=True)])

    def _computed(self, name: str, given: ArrayLike | Callable[[Self], ArrayLike]) -> ArrayLike:
        if not callable(given):
            return sampled(given, self.t)  # type: ignore[no-any-return]
        try:
            return given(self)
        except Exception as error:
            told = f"assign({name}=...): the function raised {type(error).__name__}: {error}"
            raise DataError(told) from error

    def weigh(
        self, mask: ArrayLike | Mapping[str, ArrayLike] | None = None, sigma: ArrayLike | None = None
    ) -> Self:
        """Return a record with samples of its outputs left out, or trusted less.

        Parameters
        ----------
        mask, sigma : array_like, shape (time,) or (output, time), or mapping, optional
            As in `Record`; a mask also as ``{output: mask of it}``. Samples already masked stay so; None
            leaves things as they are.

        Examples
        --------
        >>> rec = Record(y=[0.0, 1, 2, 3, 99, 5, 6, 7, 8], dt=0.1, outputs="q")
        >>> rec.weigh(mask=rec["q"] < 50)["q"][4]
        np.float64(4.0)
        """
        more = mask_of(rows_of(mask, self.outputs, len(self.t)), self.y.shape)
        good = more if self.mask is None else self.mask if more is None else self.mask & more
        refuse_scarce(good, self.outputs, "weigh")
        weights = self.sigma if sigma is None else sigma_of(sigma, good, self.t, self.y.shape)
        return self._like(y=filled(self.y, good, self.t), mask=good, sigma=weights)

    def _good(self, channel: str) -> Mask:
        """Return where the samples of a channel count."""
        if self.mask is not None and channel in self.outputs:
            row: Mask = self.mask[self.outputs.index(channel)]
            return row
        return np.ones(len(self.t), dtype=np.bool_)

    def _shown(self, channel: str) -> F64:
        """Return the samples of a channel, nan where they are masked."""
        return np.where(self._good(channel), self[channel], np.nan)

    def _between_words(self) -> list[str]:
        """How each input goes between samples, and whether its samples alone say so."""
        told = {BY_FIT: "by the fit", **dict.fromkeys((*DOUBTFUL, CLOSE, LOOP, OPEN), "doubtful")}
        origin = {name: told.get(form, "seen") for name, form in self._seen.items()}
        both = zip(self.inputs, self.intersample, strict=True)
        words = {n: f"{w} ({origin[n]})" if n in origin else w for n, w in both}
        return list((words | {name: shown(source) for name, source in self.functions.items()}).values())

    def _summary(self) -> tuple[str, list[tuple[str, str, str]]]:
        if self.dt is None:
            steps = np.diff(self.t)
            pace = f"uneven steps of {steps.min():.4g} to {steps.max():.4g} s"
        else:
            pace = f"dt = {self.dt:.6g} s"
        start = f" from t = {self.t0:g} s" if self.t0 else ""
        own = "" if self.sigma is None else ", own sigma"
        if self._lost is not None:
            own += f", {int(self._lost.sum())} of them missing"
        line = f"Record of {self.duration:.6g} s{start}: {len(self.t)} samples, {pace}{own}"
        roles = []
        for name in self.outputs:
            masked = int((~self._good(name)).sum())
            roles.append(f"output, {masked} masked" if masked else "output")
        roles += [f"input, {said}" for said in self._between_words()] + ["kept"] * len(self._keep)
        rows = []
        for name, role in zip(self.channels, roles, strict=True):
            values = self[name]
            span = f"{values.min():.4g} to {values.max():.4g}"
            rows.append((name, role, f"{span} {self._units.get(name, '')}".rstrip()))
        return line, rows

    def __repr__(self) -> str:
        line, rows = self._summary()
        widths = [max(len(row[k]) for row in rows) for k in range(2)]
        return "\n".join([line, *(f"  {a.ljust(widths[0])}  {b.ljust(widths[1])}  {c}" for a, b, c in rows)])

    def _repr_html_(self) -> str:
        line, rows = self._summary()
        return html.table(("channel", "role", "range"), rows, title=line)


def _restore(kind: type[Own], fields: dict[str, Any]) -> Own:
    made = object.__new__(kind)
    # Their pickles have all words declared.
    of_old: dict[str, Any] = {"_seen": {}, "_lost": None, "_functions": {}, "_timed": False}
    made._set(**{**of_old, **fields})
    return made
