"""Names in messages: the one that was meant, and those that there are."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

__all__ = ["listed", "nearest"]

MANY, LONG = 40, 60  # names that a message lists, and letters of each


def nearest(name: object, known: Sequence[str]) -> str:
    """Return "did you mean ...? (there are ...)" for a name that is not among the known ones."""
    by_lower = {word.lower(): word for word in reversed(known)}
    text = str(name).lower()
    close = [by_lower[word] for word in difflib.get_close_matches(text, by_lower, n=3, cutoff=0.5)]
    if text:  # "q" is no close match of "Q (deg/s)" by letters, but what is meant all the same
        close += [word for word in known if word.lower().startswith(text) and word not in close][:3]
    guess = f"did you mean {' or '.join(repr(word) for word in close)}? " if close else ""
    return f"{guess}there are: {listed(known)}"


def listed(names: Sequence[str]) -> str:
    """Names for a message, cut where they are many or long, as in a file that is not a table."""
    shown = [name if len(name) <= LONG else f"{name[:LONG]}…" for name in map(str, names[:MANY])]
    more = f", … ({len(names)} in all)" if len(names) > MANY else ""
    return (", ".join(shown) or "none") + more
