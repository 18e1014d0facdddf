"""Frequency responses as data: what `frequency_response` returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DataError
from .extras import optional

__all__ = ["FrequencyResponse"]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Complex gains at angular frequencies.

    Parameters
    ----------
    omega : ndarray, shape (omega,)
        Angular frequencies, rad/s.
    response : ndarray of complex, shape (output, input, omega)
        Gains; a one-dimensional array is taken as one output and one input.

    Raises
    ------
    DataError
        Shapes that do not fit.
    """

    omega: NDArray[np.float64]
    response: NDArray[np.complex128]

    def __post_init__(self) -> None:
        omega = np.atleast_1d(np.array(self.omega, dtype=np.float64))
        response = np.array(self.response, dtype=np.complex128)
        if response.ndim == 1:
            response = response[None, None, :]
        if omega.ndim != 1 or response.ndim != 3 or response.shape[2] != omega.size:
            raise DataError(
                f"FrequencyResponse: {omega.size} frequencies and a response of shape {response.shape}; "
                "give (output, input, omega), or (omega,) for one output and one input"
            )
        omega.flags.writeable = response.flags.writeable = False
        object.__setattr__(self, "omega", omega)
        object.__setattr__(self, "response", response)

    def plot(self, *, ax: Any = None, hz: bool = False) -> Any:
        """Magnitude in dB and phase in degrees over frequency (extra ``plot``); returns Axes."""
        from .plot import bode

        return bode(self, ax=ax, hz=hz)

    def to_control(self) -> Any:
        """The same as a `control.FrequencyResponseData` (extra ``control``)."""
        return optional("control", "control", "FrequencyResponse.to_control").frd(self.response, self.omega)
