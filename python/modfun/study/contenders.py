"""Estimators of a study, made ready for its groups."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.callables import source
from ..base.names import nearest
from ..errors import DataError, FitError, ModfunError, SpecError
from ..fitting.fit import Estimator
from ..fitting.prepared import (
    counts_start,
    joint_words,
    plain_words,
    prepare,
    refuse_process_noise,
    spans,
)
from ..fitting.single import fit_quietly, fit_whole, refuse_whole
from ..fitting.undeclared import Which, Word, decided_by_fit, read_as
from ..fitting.weights import weighting
from ..models.layout import Layout
from ..models.options import WORDS, Options
from ..models.process import with_inputs
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..systems.lti import LTI
from .generated import Generated
from .groups import Group

__all__ = ["Contender", "contenders"]

Rule = Callable[[Record, np.random.Generator], Any]
KNOWN = ("zero", "rest")  # initial states of which nothing is estimated
TRENDS = ("constant", "linear")


@dataclass(frozen=True, eq=False)
class Contender:
    """An estimator of the study, made ready for each group.

    Attributes
    ----------
    name : str
    call : callable or None
        A user's estimator; None for one that runs in the compiled core.
    estimators : tuple of Estimator
        One per group, with the band settled; empty for a user's estimator.
    structures : tuple of TransferFunction, Equation, StateSpace or None
        What is fitted, one per group; None: a function without a structure.
    params : tuple of tuple of str
        Names of the parameters, one per group.
    truth : tuple of ndarray
        True parameters, one per group; nan where unknown.
    words : tuple of dict
        How open inputs of undeclared records are read, decided once by the first record of each group.
    alone : bool
        Whether it fits each record by itself, in no batch: what it knows of the start stands before records
        as their past, or its options ask for more than least squares.
    """

    name: str
    call: Rule | None
    estimators: tuple[Estimator, ...]
    structures: tuple[Any, ...]
    params: tuple[tuple[str, ...], ...]
    truth: tuple[F64, ...]
    words: tuple[dict[Which, Word], ...] = ()
    alone: bool = False

    def read(self, group: Group | Generated, rec: Record) -> Record:
        """The record as the estimator reads it: no record of a study decides by itself."""
        return read_as((rec,), self.words[group.index])[0]._like(_seen={})

    def names(self, group: Group | Generated) -> tuple[str, ...]:
        """Names of the parameters in a group."""
        return self.params[group.index]

    def layout(self, group: Group) -> Layout:
        """The structure for the channels of a group."""
        own = self.estimators[group.index]
        found: Layout = own.model.layout(group.outputs, group.inputs)
        return found

    @property
    def undeclared(self) -> bool:
        """Whether nothing says what a user's function knows of the start, or estimates of a trend."""
        return self.call is not None and not (
            hasattr(self.call, "initial_state") or hasattr(self.call, "trend")
        )

    @property
    def initial_state(self) -> Any:
        """What it knows of the initial states; a rival or a function says so by an attribute of that name."""
        if self.estimators:
            return self.estimators[0].options.initial_state
        told = getattr(self.call, "initial_state", "unknown")
        return told if told in KNOWN else "unknown"

    def trend(self, group: Group) -> str | None:
        """Trend fitted beside the model in a group; a rival or a function says so by an attribute."""
        if not self.estimators:
            told = getattr(self.call, "trend", None)
            return told if told in TRENDS else None
        own = self.estimators[group.index]
        equations = own.options.trend == "auto" and not isinstance(own.model, TransferFunction)
        found: str | None = own.model.trend if equations else own.options.fitted_trend
        return found

    def core(self, group: Group) -> dict[str, Any]:
        """Keywords of the compiled core for this group."""
        own = self.estimators[group.index]
        rec, layout = group.record(group.y), self.layout(group)
        if layout.plain and own.options.plain_noise:
            return plain_words(layout, (rec.intersample,), own.options)
        refuse_process_noise(own.options)
        return {
            **weighting(layout, own.options, [rec], spans(layout, [rec])),
            **joint_words(layout, (rec.intersample,), own.options),
        }

    def described(self, group: Group | Generated) -> Any:
        """All that its estimates depend on."""
        if self.call is not None:
            return source(self.call)
        own = self.estimators[group.index]
        own_model = own.model
        told = repr(own_model) if isinstance(own_model, TransferFunction) else own_model.to_dict()
        return [told, repr(own.options.settled())]


def contenders(
    given: Any,
    options: Mapping[str, Any],
    model: Any,
    found: Sequence[Group | Generated],
    firsts: Sequence[Record],
    seed: int,
) -> tuple[Contender, ...]:
    """Check the estimators of a study and make them ready for its groups.

    `firsts` has a record of each group, on which bands are chosen: noise-free where there is a system. Where
    a function of the user makes records of other inputs each time, bands are chosen on several. Bands of
    robust fits follow the weights, so that each replicate has its own.
    """

    @cache  # estimators share the records of a group
    def several(group: Generated) -> list[Record]:
        return group.several(seed)

    words = WORDS["method"]
    if isinstance(given, str) or not isinstance(given, Mapping | Sequence) or not given:
        raise SpecError(
            f"MonteCarlo: estimators={given!r}; give a list of method names, as ['ls', 'ml'], or a dict from "
            "names to estimators"
        )
    if not isinstance(given, Mapping):
        for word in given:
            if not isinstance(word, str):
                raise SpecError(
                    f"MonteCarlo: estimators holds {word!r}; a list names methods ({', '.join(words)}); "
                    "estimators of your own need a name: give a dict"
                )
        if len(set(given)) < len(given):
            raise SpecError(
                f"MonteCarlo: estimators={list(given)!r} names a method twice; for two settings of "
                "one method give a dict from names to mf.Estimator(structure, method=…, …)"
            )
        given = {word: word for word in given}
    for name in given:
        if not isinstance(name, str) or not name.strip():
            raise SpecError(f"MonteCarlo: estimators has the name {name!r}; names of estimators are texts")
    if options and not any(isinstance(value, str) for value in given.values()):
        raise SpecError(
            f"MonteCarlo: {', '.join(options)} would apply to method names, and there are none; write the "
            "options into mf.Estimator(structure, …)"
        )
    if model is not None and not hasattr(model, "param_names"):
        raise SpecError(
            f"MonteCarlo: model is a {type(model).__name__}; give a structure, "
            "TransferFunction(poles=, zeros=) or mf.Equation(...)"
        )
    structures = tuple(_structure(g, model) for g in found)
    made = []
    for name, value in given.items():
        if isinstance(value, str):
            if value not in words:
                raise SpecError(f"MonteCarlo: there is no method {value!r}; {nearest(value, words)}")
            checked = Options.checked("MonteCarlo", **{**options, "method": value})
            if None in structures:
                raise SpecError(
                    f"MonteCarlo: the method {value!r} needs a structure, and there is no system to take it "
                    "from; give model=mf.TransferFunction(poles=, zeros=) or mf.Equation(...)"
                )
            own = tuple(Estimator(s, **checked.given()) for s in structures if s is not None)
        elif isinstance(value, Estimator):
            own = (value,) * len(found)
        elif callable(value) and not isinstance(value, type):
            made.append(_contender(str(name), value, (), structures, found))
            continue
        else:
            raise SpecError(
                f"MonteCarlo: the estimator {name!r} is a {type(value).__name__}; give a method name, an "
                "mf.Estimator, one of mf.rivals or a function of (record, rng)"
            )
        read = tuple(
            decided_by_fit([(rec,)], e.model, e.options, fit_quietly, many=True)
            for e, rec in zip(own, firsts, strict=True)
        )
        for e, g, rec in zip(own, found, firsts, strict=True):
            _refuse(name, e, g, rec)
        settled = tuple(
            _settled_by_several(_settled(e, g, read_as((rec,), one)[0]), e, g, several, one)
            for e, g, rec, one in zip(own, found, firsts, read, strict=True)
        )
        alone = any(not e.options.is_plain or _has_past(e, rec) for e, rec in zip(own, firsts, strict=True))
        one = _contender(str(name), None, settled, tuple(e.model for e in own), found)
        made.append(replace(one, words=read, alone=alone))
    return tuple(made)


def _structure(group: Group | Generated, model: Any) -> Any:
    if model is not None or not isinstance(group, Group):
        return model
    system = group.system
    return TransferFunction.from_system(system) if isinstance(system, LTI) else system.structure


def _contender(
    name: str,
    call: Rule | None,
    estimators: tuple[Estimator, ...],
    structures: tuple[Any, ...],
    found: Sequence[Group | Generated],
) -> Contender:
    params = []
    for structure, g in zip(structures, found, strict=True):
        if structure is None and not (isinstance(g, Generated) and g.known):
            raise SpecError(
                f"MonteCarlo: nothing says which parameters the estimator {name!r} returns; give "
                "truth={'name': value}, nan where it is not known, or model="
            )
        params.append(g.names(structure))
    truth = tuple(g.truth(s) for s, g in zip(structures, found, strict=True))
    return Contender(name, call, estimators, structures, tuple(params), truth)


def _settled(own: Estimator, group: Group | Generated, rec: Record) -> Estimator:
    """The estimator with its band chosen on a record of the group, if none was given."""
    options = own.options
    if not isinstance(own.model, TransferFunction):
        rec = with_inputs(rec, options.noise)
        own.model.compiled(rec.outputs, rec.inputs)  # refuses what does not go together
        return _settled_by_fit(own, group, rec)
    layout = own.model.layout(rec.outputs, rec.inputs)  # refuses what does not go together
    if isinstance(group, Group):
        _refuse_standing(layout, rec)
    if _has_past(own, rec) or rec.functions:
        return _settled_by_fit(own, group, rec)
    if options.band is not None or options.harmonics is not None or options.robust:
        return own
    with np.errstate(all="ignore"):
        found = prepare(own.model, options, [rec]).core.fit([rec.y], [rec.u])
    low, high = (int(line) for line in found["lines"][0])
    if isinstance(group, Group):
        return Estimator(own.model, **options.replace(harmonics=high - max(layout.orders)).given())
    omega0 = float(found["omega0"][0])  # in rad/s, as records may differ in length
    return Estimator(own.model, **options.replace(band=(low * omega0, high * omega0)).given())


def _settled_by_several(
    settled: Estimator,
    own: Estimator,
    group: Group | Generated,
    several: Callable[[Generated], list[Record]],
    words: dict[Which, Word],
) -> Estimator:
    """The estimator with the median of the bands that it chooses on several records, where inputs differ."""
    if isinstance(group, Group) or settled.options.band == own.options.band:
        return settled
    bands = [settled.options.band]
    for rec in several(group)[1:]:
        try:
            bands.append(_settled(own, group, read_as((rec,), words)[0]).options.band)
        except ModfunError:  # this replicate fails in the run, too
            continue
    middle = tuple(sorted(ends)[len(ends) // 2] for ends in zip(*filter(None, bands), strict=True))
    return Estimator(own.model, **own.options.replace(band=middle).given())


def _refuse(name: str, own: Estimator, group: Group | Generated, rec: Record) -> None:
    """Refuse options by which no replicate could be fitted."""
    missing = [one for one in own.options.reference if one not in rec.inputs]
    if missing and isinstance(group, Group):
        raise SpecError(
            f"MonteCarlo: estimator {name!r}: reference={missing[0]!r}: simulated records have no such "
            f"channel, only the inputs {', '.join(rec.inputs)}; make the records with generate=, a function "
            f"that returns mf.Record(..., keep={{{missing[0]!r}: samples}})"
        )
    try:
        refuse_whole((rec,), own.model, own.options)
    except (SpecError, DataError) as error:
        raise type(error)(f"MonteCarlo: estimator {name!r}: {error}") from None


def _refuse_standing(layout: Layout, rec: Record) -> None:
    """Refuse inputs that never move, with which no replicate could be fitted."""
    for k, name in enumerate(rec.inputs):
        used = any(row[k] is not None for row in layout.numerators)
        if used and np.ptp(rec[name]) == 0:
            raise DataError(
                f"MonteCarlo: input {name!r} stands at {rec[name][0]:g} throughout, so nothing can be learnt "
                "from it; give an input that moves"
            )


def _settled_by_fit(own: Estimator, group: Group | Generated, rec: Record) -> Estimator:
    """As `_settled`, for equations, records with a past and inputs known at all times: by a fit."""
    if own.options.band is not None or own.options.harmonics is not None or own.options.robust:
        return own
    with np.errstate(all="ignore"):
        try:
            fit = fit_whole((rec,), own.model, own.options)
        except FitError:  # one replicate without an estimate
            fit = fit_quietly((rec,), own.model, own.options.plain())
    by_lines = isinstance(group, Group) and not _has_past(own, rec)
    chosen = {"harmonics": fit.harmonics} if by_lines else {"band": fit.band}
    return Estimator(own.model, **own.options.replace(**chosen).given())


def _has_past(own: Estimator, rec: Record) -> bool:
    """Whether what the estimator knows of the start of a record stands before it as its past."""
    return own.options.initial_state != "unknown" and not counts_start(own.model, own.options, [rec])
