"""Who takes part in docs/rivals.md, with what each was given, and what is missing, with the reason."""

import contextlib
import importlib
import os
import shutil
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version

EQ24, RAO_GARNIER = "eq. (24)", "Rao–Garnier"


@dataclass(frozen=True)
class Competitor:
    """An estimator: a class of rivals/, made with a problem, called with a record for θ.

    `records`: how many of each cell's records it gets on eq. (24) and on Rao–Garnier; the slow get few.
    """

    name: str
    place: str  # module:class in rivals/
    records: tuple[int, int]
    given: str
    package: str = "modfun"
    licence: str = "BSD-3-Clause"
    options: dict = field(default_factory=dict)
    states: bool = False  # whether its records hold all states
    quick: bool = False

    def missing(self) -> str | None:
        """Why it cannot run here."""
        if self.package == "dsmc":
            return None if shutil.which("cargo") else "cargo is not installed"
        try:
            with silence():
                self._class()
        except ImportError as error:
            return f"{error}; pip install -r benches/compare/rivals/requirements.txt"
        return None

    def make(self, problem):
        """The estimator for a problem."""
        return self._class()(problem, **self.options)

    def count(self, problem, scale: float) -> int:
        """Records of a cell."""
        return max(2, round(scale * self.records[problem.name != EQ24]))

    def version(self) -> str:
        """Of its package."""
        if self.package == "dsmc":
            return "0.27"
        with contextlib.suppress(PackageNotFoundError):
            return version(self.package)
        return ""

    def _class(self):
        module, name = self.place.split(":")
        return getattr(importlib.import_module(f"rivals.{module}"), name)


@contextlib.contextmanager
def silence():
    """No standard output, that of compiled code included: some packages print every iteration."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


DISCRETE = "Discrete time, converted by the logarithm of its poles; "
COMPETITORS = (
    Competitor("modfun ml", "modfun_fit:Modfun", (1000, 200), "Defaults (offset estimated).", quick=True),
    Competitor(
        "modfun ml, trend=None", "modfun_fit:Modfun", (1000, 200), "Told that there is no offset.",
        options={"trend": None}, quick=True,
    ),
    Competitor(
        "modfun awls", "modfun_fit:Modfun", (1000, 200), "Defaults but for the method.",
        options={"method": "awls"},
    ),
    Competitor(
        "SciPy output error", "modfun_fit:OutputError", (300, 50),
        "`mf.rivals.output_error`: exact response and derivatives, initial state estimated; starts at `ls`.",
        package="scipy", quick=True,
    ),
    Competitor(
        "SRIVC, NumPy", "srivc_numpy:Srivc", (300, 50),
        "Own, with the free responses of 1/A; linear input on eq. (24).", package="numpy",
        quick=True,
    ),
    Competitor(
        "SRIVC, dsmc", "srivc_dsmc:Batch", (1000, 200),
        "Rust; assumes a system at rest; linear input on eq. (24).", package="dsmc", licence="MIT",
    ),
    Competitor(
        "SRIVC, dsmc, late", "srivc_dsmc:Batch", (1000, 200),
        "The same, the first fifth of the record left out of its sums.", package="dsmc", licence="MIT",
        options={"late": 0.2},
    ),
    Competitor(
        "jax-sysid", "linear_jax_sysid:Linear", (5, 2),
        DISCRETE + "initial state estimated; 1000 steps of Adam, then L-BFGS from 0.9 I, hardly regularised.",
        package="jax-sysid", licence="Apache-2.0",
    ),
    Competitor(
        "aeroid", "oe_aeroid:Aeroid", (5, 2),
        "Output error with JAX gradients, initial state as parameters; starts 0.8 and 1.25 times the truth.",
        package="aeroid", licence="MIT",
    ),
    Competitor(
        "pysib", "oe_pysib:Pysib", (30, 2), DISCRETE + "output error, assumes a system at rest.",
        package="pysib", licence="MIT",
    ),
    Competitor(
        "pysid", "oe_pysid:Pysid", (20, 2), DISCRETE + "output error, assumes a system at rest.",
        package="pysid", licence="MIT",
    ),
    Competitor(
        "SIPPY OE", "oe_sippy:SippyOE", (20, 2),
        DISCRETE + "output error by IPOPT; takes the first samples as measured.", package="sippy-unipi",
        licence="LGPL-3.0-or-later",
    ),
    Competitor(
        "SIPPY N4SID", "oe_sippy:SippyN4SID", (20, 4), DISCRETE + "subspace, horizons of 20 samples.",
        package="sippy-unipi", licence="LGPL-3.0-or-later",
    ),
    Competitor(
        "pySINDy weak", "weak_pysindy:Weak", (20, 8),
        "Needs every state: given all of them measured at the same NSR, a linear library, no threshold.",
        package="pysindy", licence="MIT", states=True,
    ),
)  # fmt: skip
