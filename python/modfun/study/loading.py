"""What `modfun.load` opens: a fit that was saved, or the directory of a study."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ..base.arguments import public
from ..base.writing import named
from ..errors import DataError, SpecError
from ..results.loading import fit_from_dict
from .shards import load as load_study

__all__ = ["load"]


@public
def load(path: str | Path) -> Any:
    """Read a fit that was written with `Fit.save`, or the directory of a study.

    Parameters
    ----------
    path : str or Path
        The JSON file, or the `directory` of `MonteCarlo.run`.

    Returns
    -------
    Fit or Results
        A fit equals the saved one but for the samples: give a record to `predict`, `score` and the like.
        Results are those of the run, `Results.replicate` included.

    Raises
    ------
    SpecError
        No such file, or no directory of a study.
    DataError
        Something else, a damaged file, or a study with parts missing.

    See Also
    --------
    modfun.Fit.save : Writes a fit.
    modfun.MonteCarlo.run : Writes a study with `directory=`.

    References
    ----------
    RFC 8259 (JSON).

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> path = Path(tempfile.mkdtemp()) / "fit.json"
    >>> fit.save(path)
    >>> mf.load(path).status
    'ok'
    """
    place = named("load", path)
    if os.path.isdir(place):
        return load_study(place)
    if not os.path.isfile(place):  # where Path.is_file raises: of a name that is too long
        raise SpecError(f"load: there is no file {str(place)!r}")
    try:
        values = json.loads(place.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # ValueError: no JSON, no UTF-8, numbers without an end
        raise DataError(
            f"load: {str(place)!r} is not JSON ({error}); it should be what fit.save wrote"
        ) from None
    try:
        return fit_from_dict(values)
    except DataError as error:
        raise DataError(f"load: {str(place)!r}: {str(error).removeprefix('loading a fit: ')}") from None
