"""A study laid out as plain JSON and arrays, and back: what its directory keeps of it."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.callables import address, at
from ..equations.equation import Equation
from ..equations.nonlinear import NonlinearModel, model_of
from ..equations.state_space import StateSpace
from ..errors import DataError, SpecError
from ..experiments.driven import Driven
from ..experiments.simulation import Experiment
from ..fitting.fit import Estimator
from ..models.options import Options
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..systems.lti import LTI
from .axes import Axis
from .contenders import Contender
from .generated import Generated
from .groups import Group
from .plan import Plan

__all__ = ["freeze", "thaw"]

Arrays = dict[str, NDArray[Any]]

# What a study is made of, by the name that stands in the file.
_NAMED = (
    Axis, Contender, Driven, Estimator, Experiment, Generated, Group, LTI, Options, Plan, ProcessNoise,
    TransferFunction,
)  # fmt: skip
_TEXTS = (Equation, StateSpace)
_READ = {kind.__name__: kind for kind in _TEXTS}
_KINDS: dict[str, type] = {kind.__name__: kind for kind in _NAMED}


class Lost:
    """Stands for a function that cannot be imported any more; it says so when it is called."""

    def __init__(self, place: str, why: str) -> None:
        self.place, self.why = place, why

    def __call__(self, *given: Any) -> Any:
        raise DataError(f"the function {self.place} of this study cannot be imported ({self.why})")


def freeze(value: Any, arrays: Arrays) -> Any:
    """Plain values for JSON; arrays go into `arrays` under a number."""
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        name = str(len(arrays))
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return [freeze(one, arrays) for one in value]
    if isinstance(value, dict):
        return {"dict": [[freeze(k, arrays), freeze(v, arrays)] for k, v in value.items()]}
    kind = type(value)
    if kind in _TEXTS:
        return {"is": kind.__name__, "text": json.dumps(value.to_dict())}
    if kind is NonlinearModel:
        if value.structure is None:
            raise SpecError("run: a study directory keeps equations made by mf.Equation(...).model(...) only")
        names = ["params", "structure"]
    elif kind is Estimator:
        names = ["model", "options"]
    elif is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in fields(value)]
    else:
        return {"function": address(value)}
    known = kind is NonlinearModel or kind in _KINDS.values()
    name = kind.__name__ if known else address(kind)
    return {"is": name} | {f: freeze(getattr(value, f), arrays) for f in names}


def thaw(value: Any, arrays: Arrays) -> Any:
    """What `freeze` was given, lists as tuples."""
    if isinstance(value, list):
        return tuple(thaw(one, arrays) for one in value)
    if not isinstance(value, dict):
        return value
    if "array" in value:
        array = arrays[value["array"]]
        array.flags.writeable = False
        return array
    if "dict" in value:
        return {thaw(k, arrays): thaw(v, arrays) for k, v in value["dict"]}
    if "function" in value:
        return _imported(value["function"])
    given = {name: thaw(one, arrays) for name, one in value.items() if name != "is"}
    name = value["is"]
    if name == "Estimator":
        return Estimator(given["model"], **given["options"].given())
    if name == "ProcessNoise":
        return ProcessNoise.of_filters(given["filters"])
    if name in _READ:
        return _READ[name].from_dict(json.loads(given["text"]))
    if name == "NonlinearModel":
        structure = given["structure"]
        return model_of(structure.simulated(), given["params"], structure)
    kind = _KINDS.get(name) or _imported(name)
    if isinstance(kind, Lost):
        return kind
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise DataError(f"the study holds a {name}, which is no dataclass any more")
    return kind(**given)


def _imported(place: str) -> Any:
    try:
        return at(place)
    except (Exception, SystemExit) as error:  # whatever its module does today
        return Lost(place, f"{type(error).__name__}: {error}")
