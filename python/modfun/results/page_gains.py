"""The gains of a frequency response on the page of their fit."""

from __future__ import annotations

from collections.abc import Iterable

from ..fitting.of_gains import ResponseFit
from ..pages.parts import Block, Facts, Grid, Section, section
from .fit import Fit

__all__ = ["after", "before", "level"]


def before(fit: Fit) -> tuple[Section, ...]:
    """The gains as a table; their picture stands beside the model's."""
    return (section("data", "Data", lambda: _gains(fit)),)


def after(fit: Fit) -> tuple[Section, ...]:
    """Nothing: gains have no time."""
    return ()


def level(fit: Fit) -> Iterable[Block]:
    """How well the model explains the gains."""
    facts = dict(fit.facts())
    yield Facts(tuple((name, facts[name]) for name in ("Weights", "Condition", "Errors")))


def _gains(fit: Fit) -> Iterable[Block]:
    assert isinstance(fit, ResponseFit)
    yield Facts(tuple(fit.data._facts()))
    yield Grid.of(fit.data.table(), "Gains")
