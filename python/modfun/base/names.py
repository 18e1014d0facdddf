"""Names in messages: the one that was meant, and those that there are."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

__all__ = ["close", "listed", "nearest", "series"]

MANY, LONG = 40, 60  # names that a message lists, and letters of each


def nearest(name: object, known: Sequence[str]) -> str:
    """Return "did you mean ...? (there are ...)" for a name that is not among the known ones."""
    found = close(name, known)
    guess = f"did you mean {' or '.join(repr(word) for word in found)}? " if found else ""
    return f"{guess}there are: {listed(known)}"


def close(name: object, known: Sequence[str]) -> list[str]:
    """Return the known names that are like a name, the nearest first."""
    by_lower = {word.lower(): word for word in reversed(known)}
    text = str(name).lower()
    found = [by_lower[word] for word in difflib.get_close_matches(text, by_lower, n=3, cutoff=0.5)]
    if text:  # "q" is no close match of "Q (deg/s)" by letters, but what is meant all the same
        found += [word for word in known if word.lower().startswith(text) and word not in found][:3]
    return found


def listed(names: Sequence[str]) -> str:
    """Names for a message, cut where they are many or long, as in a file that is not a table."""
    shown = [name if len(name) <= LONG else f"{name[:LONG]}…" for name in map(str, names[:MANY])]
    more = f", … ({len(names)} in all)" if len(names) > MANY else ""
    return (", ".join(shown) or "none") + more


def series(words: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
