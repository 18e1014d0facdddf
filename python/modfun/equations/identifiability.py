"""Which parameters equations determine, before any data."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import html

__all__ = ["Identifiability"]


@dataclass(frozen=True)
class Identifiability:
    """Which parameters can be found from rich, noise-free records; True if all can.

    Local: parameters near the true ones are told apart, others far away need not be. Prints as sentences.

    Attributes
    ----------
    found : tuple of str
        Parameters with one value near the true one.
    lost : tuple of str
        Parameters that cannot be found one by one.
    rank : int
        Number of independent combinations of parameters that can be found.
    sentences : tuple of str
        What is lost, why, and what would help.
    """

    found: tuple[str, ...]
    lost: tuple[str, ...]
    rank: int
    sentences: tuple[str, ...]

    def __bool__(self) -> bool:
        return not self.lost

    @property
    def title(self) -> str:
        """How many parameters can be found, in words."""
        count = len(self.found) + len(self.lost)
        if not self.lost:
            return f"All {count} parameters can be found."
        return f"{self.rank} of {count} parameters, or combinations of them, can be found."

    def __str__(self) -> str:
        return "\n".join([self.title, *(f"* {text}" for text in self.sentences)])

    def _repr_html_(self) -> str:
        return html.listing(self.sentences, title=self.title)
