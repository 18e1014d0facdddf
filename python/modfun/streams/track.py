"""Estimates over time, as a stream gives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import public
from ..base.arrays import F64
from ..base.names import nearest
from ..base.optional import optional
from ..base.tables import Table
from ..errors import SpecError
from . import drawing

__all__ = ["Track", "joined"]


@public
@dataclass(frozen=True, eq=False, repr=False)
class Track:
    """Estimates of one structure at many moments of a stream.

    Attributes
    ----------
    t : (moment,) array
        Time of the last sample seen, s.
    params : (moment, p) array
        Estimates; nan where the numbers allow none.
    bse : (moment, p) array
        Standard errors of the chosen `cov_type`.
    status : (moment,) array of str
        "ok", "maxiter", "rank" or "nonfinite".
    nit : (moment,) array of int
    param_names : tuple of str
    window : float
        Length of the window behind each moment, s. Moments less than that apart share samples: their errors
        are correlated.

    See Also
    --------
    modfun.Stream.follow : Makes it.
    modfun.plot.track : Draws it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.9.

    Examples
    --------
    >>> import modfun as mf
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.02, duration=20.0)
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input=chirp, nsr=0.05, seed=0)
    >>> estimator = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=10)
    >>> stream = mf.Stream(estimator, dt=rec.dt, window=10.0)
    >>> track = stream.follow(rec, every=50)
    >>> track.params.shape
    (10, 3)
    """

    t: F64
    params: F64
    bse: F64
    status: NDArray[np.str_]
    nit: NDArray[np.intp]
    param_names: tuple[str, ...]
    window: float

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which estimates can be used."""
        return np.asarray(self.status == "ok")

    def __len__(self) -> int:
        return int(self.t.size)

    def __getitem__(self, name: str) -> F64:
        """Estimates of one parameter, (moment,)."""
        if name not in self.param_names:
            raise SpecError(f"there is no parameter {name!r}; {nearest(name, self.param_names)}")
        return self.params[:, self.param_names.index(name)]

    def table(self) -> Table:
        """One row per moment: t, each parameter with its standard error ("a1", "a1_bse"), status."""
        columns: dict[str, Any] = {"t": self.t}
        for k, name in enumerate(self.param_names):
            columns |= {name: self.params[:, k], f"{name}_bse": self.bse[:, k]}
        return Table({**columns, "status": self.status}, units={"t": "s"})

    def to_pandas(self) -> Any:
        """A pandas.DataFrame (extra ``pandas``) of `table`, indexed by time."""
        frame = optional("pandas", "pandas", "Track.to_pandas").DataFrame(self.table().to_dict())
        return frame.set_index("t")

    def plot(self, ax: Any = None) -> Any:
        """Draw every parameter over time with a band of two standard errors; see `modfun.plot.track`.

        Parameters
        ----------
        ax : Axes or sequence of Axes, optional
        """
        return drawing.estimates(self.t, self.params, self.bse, self.success, self.param_names, ax)

    def __repr__(self) -> str:
        if not len(self):
            return f"Track of no moment ({', '.join(self.param_names)})"
        last = ", ".join(
            f"{name}={value:.4g}±{error:.2g}"
            for name, value, error in zip(self.param_names, self.params[-1], self.bse[-1], strict=True)
        )
        return (
            f"Track of {len(self)} moments, {self.t[0]:g} to {self.t[-1]:g} s, {int(self.success.sum())} ok; "
            f"at last {last}"
        )


def joined(tracks: Sequence[Track]) -> Track:
    """One track of several, in their order."""
    parts = {
        name: np.concatenate([getattr(track, name) for track in tracks])
        for name in ("t", "params", "bse", "status", "nit")
    }
    return Track(**parts, param_names=tracks[0].param_names, window=tracks[0].window)
