"""How the inputs of a stream go between samples: declared, told by a record, or decided by its samples."""

from __future__ import annotations

from ..base.arrays import F64
from ..base.between import AUTO, form_of
from ..fitting.fit import Estimator
from ..fitting.single import fit_quietly
from ..fitting.undeclared import decided_by_fit, in_sentences, read_as
from ..records.record import Record

__all__ = ["Forms"]


class Forms:
    """The words of a stream's inputs, and what its samples looked like when they were decided.

    Attributes
    ----------
    said, words : tuple of str
        What the user said, and how inputs are read; "smooth" before they move.
    notes : tuple of str
        What fits decided.
    """

    def __init__(self, said: tuple[str, ...], estimator: Estimator) -> None:
        self.said, self._estimator = said, estimator
        self.words = tuple("smooth" if word == AUTO else word for word in said)
        self.clear()

    def clear(self) -> None:
        """Begin as a stream that has seen no input move."""
        self._forms = tuple("rest" if word == AUTO else "" for word in self.said)
        self._told = "rest" not in self._forms
        self.notes: tuple[str, ...] = ()

    @property
    def undecided(self) -> bool:
        """Whether no input has moved whose word the samples decide."""
        return not self._told and set(self._forms) <= {"rest", ""}

    @property
    def waiting(self) -> bool:
        """Whether an input is still at rest."""
        return not self._told and "rest" in self._forms

    def differ(self, rows: F64) -> bool:
        """Whether inputs look otherwise than when they were decided; one at rest looks like nothing."""
        if self._told:
            return False
        seen = [form_of(row) if old else "" for old, row in zip(self._forms, rows, strict=True)]
        old, self._forms = (
            self._forms,
            tuple(was if now == "rest" else now for was, now in zip(self._forms, seen, strict=True)),
        )
        return self._forms != old

    def told_by(self, rec: Record) -> bool:
        """Take the words of a record that is followed, for good."""
        self._told = True
        return self.taken(rec)

    def taken(self, rec: Record) -> bool:
        """Take the words of a record, by a fit where samples leave them open; whether any is another one."""
        both = list(zip(rec.inputs, self.said, rec.intersample, strict=True))
        rec = rec._like(
            intersample=tuple(theirs if own == AUTO else own for _, own, theirs in both),
            _seen={name: rec._seen[name] for name, own, _ in both if own == AUTO and name in rec._seen},
        )
        found = decided_by_fit([(rec,)], self._estimator.model, self._estimator.options, fit_quietly)
        before, self.words = self.words, read_as((rec,), found)[0].intersample
        self.notes = in_sentences(found)
        return self.words != before

    def read(self, rec: Record) -> Record:
        """A record of the stream's samples, with its inputs as they are read."""
        return rec if self.undecided else rec._read_as(self.words)
