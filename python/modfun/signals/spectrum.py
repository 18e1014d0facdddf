"""Amplitude spectra by channel, of signals and of records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..base.arrays import F64
from ..base.names import nearest
from ..errors import SpecError
from . import drawing

__all__ = ["Spectrum"]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitudes of sinusoids by channel.

    Attributes
    ----------
    omega : ndarray, shape (line,)
        Angular frequencies in rad/s.
    amplitude : ndarray, shape (channel, line)
    channels : tuple of str
    units : dict of str to str
    """

    omega: F64
    amplitude: F64
    channels: tuple[str, ...]
    units: dict[str, str]

    def __getitem__(self, channel: str) -> F64:
        """Return the amplitudes of a channel by name, shape (line,)."""
        if channel not in self.channels:
            raise SpecError(f"Spectrum: no channel {channel!r}; {nearest(channel, self.channels)}")
        row: F64 = self.amplitude[self.channels.index(channel)]
        return row

    def plot(self, ax: Any = None, *, hz: bool = False) -> Any:
        """Draw the amplitudes over frequency; see `modfun.plot.spectrum`."""
        return drawing.spectrum(self.omega, self.amplitude, self.channels, self.units, ax, hz)
