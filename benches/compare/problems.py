"""The two problems on which estimators are compared: the report's eq. (24), Rao and Garnier's system."""

import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import modfun as mf
import numpy as np

STATES = ("zero", "random")
FOLDER = Path(os.environ.get("MODFUN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data")
DEFINITION = FOLDER / "rao_garnier" / "definition.json"


@dataclass(frozen=True)
class Problem:
    """A known system with its experiment; θ is a1 … an, b0 … bm as in mf.TransferFunction."""

    name: str
    system: mf.LTI
    u: np.ndarray  # samples of the input
    dt: float
    hold: str  # "smooth" or "zoh": what the input does between its samples
    zeros: int
    cutoff: float  # rad/s, of the first filter of SRIVC: about the natural frequency

    @property
    def poles(self) -> int:
        """Order n."""
        return len(self.system.den) - 1

    @property
    def model(self) -> mf.TransferFunction:
        """The structure to fit."""
        return mf.TransferFunction(poles=self.poles, zeros=self.zeros)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters."""
        return self.model.param_names(("u",))

    @cached_property
    def truth(self) -> np.ndarray:
        """θ."""
        return np.concatenate([np.asarray(self.system.den)[1:], np.asarray(self.system.num)])

    @property
    def experiment(self) -> dict:
        """Arguments of mf.simulate and mf.MonteCarlo."""
        intervals = self.u.size - 1
        return {
            "input": self.u, "duration": intervals * self.dt, "intervals": intervals, "intersample": self.hold
        }  # fmt: skip

    def record(
        self, number: int, nsr: float, state: str, all_states: bool = False, seed: int = 1
    ) -> mf.Record:
        """A record by its number; the same noise, scaled, for every nsr, and the same for all rivals."""
        return mf.simulate(
            self.states if all_states else self.system,
            **self.experiment,
            nsr=nsr,
            initial_state=state,
            seed=seed,
            replicate=number,
        )

    @cached_property
    def states(self) -> mf.LTI:
        """The system with all its states as outputs, y the first: those of the observer form."""
        n = self.poles
        a = np.eye(n, k=1)
        a[:, 0] -= self.truth[:n]
        b = np.zeros((n, 1))
        b[n - 1 - self.zeros :, 0] = self.truth[n:]
        return mf.ss(a, b, np.eye(n), np.zeros((n, 1)))

    def bound(self, nsr: float, initial_state: str = "unknown") -> np.ndarray:
        """Cramér–Rao standard deviations."""
        rec = self.record(0, 0.0, "zero")
        return mf.crlb(self.system, rec, nsr=nsr, initial_state=initial_state).sd

    def failed(self, theta: np.ndarray) -> np.ndarray:
        """Of estimates (record, parameter): not finite, unstable, or a parameter over 50 % off."""
        with np.errstate(invalid="ignore"):
            off = ~np.all(np.abs(theta / self.truth - 1) <= 0.5, axis=1)
        for k in np.flatnonzero(~off):
            off[k] = np.any(np.roots(np.concatenate([[1.0], theta[k, : self.poles]])).real >= 0)
        return off


def report() -> Problem:
    """Eq. (24): 5/(s² + 3s + 8), u = sin(t²/5), 10 s, 256 intervals."""
    t = np.linspace(0.0, 10.0, 257)
    return Problem("eq. (24)", mf.tf([5], [1, 3, 8]), np.sin(t**2 / 5), 10 / 256, "smooth", 0, 3.0)


def rao_garnier() -> Problem:
    """Order 4, a fast and a slow mode, a zero in the right half plane; held binary input, 7161 samples."""
    given = json.loads(DEFINITION.read_text())
    register, bits = [1] * 10, []
    for _ in range(2**10 - 1):
        bits.append(1.0 if register[-1] else -1.0)
        register = [register[9] ^ register[6], *register[:-1]]
    system = mf.tf(given["B"], given["F"])
    return Problem("Rao–Garnier", system, np.repeat(bits, 7), given["Ts"], "zoh", 1, 10.0)


def published() -> dict:
    """The definition file of Rao and Garnier's benchmark."""
    return json.loads(DEFINITION.read_text())
