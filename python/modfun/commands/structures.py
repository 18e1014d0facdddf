"""What `modfun fit` fits: a transfer function, equations or a state space, as written in the shell."""

from __future__ import annotations

from typing import Any

from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import SpecError
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .reading import Reading
from .words import by_path, degree_of, delay_of, matrix_rows, one_or_all, param_of

__all__ = ["structure_of"]


def structure_of(
    data: Reading,
    first: Record,
    *,
    equation: list[str] | None,
    hidden: list[str] | None,
    matrices: dict[str, str],
    states: str | None,
    poles: list[int] | None,
    zeros: list[str] | None,
    delay: list[str] | None,
    denominator: str | None,
    param: list[str] | None,
) -> Any:
    """The structure for the channels of a record.

    Raises
    ------
    SpecError
        Options of two kinds of structures together, or as the structures do.
    """
    given = {
        "--equation": bool(equation),
        "--A": bool(matrices),
        "--poles, --zeros and --denominator": any((poles, zeros, denominator)),
    }
    kinds = [name for name, on in given.items() if on]
    if len(kinds) > 1:
        raise SpecError(f"fit: {kinds[0]} beside {kinds[1]}: give the options of one structure")
    params = dict(param_of(word) for word in param or ())
    if equation and delay:
        raise SpecError('fit: --delay beside --equation: write it in the equation, as "u(t - h)"')
    if equation:
        return Equation(
            equation if len(equation) > 1 else equation[0],
            outputs=first.outputs,
            inputs=first.inputs,
            hidden=hidden,
            params=params,
        )
    if matrices:
        if "A" not in matrices:
            raise SpecError(
                f"fit: --{next(iter(matrices))} without --A; give the matrix of the states as well"
            )
        names = states.split(",") if states else None
        own = {name: matrix_rows(text) for name, text in matrices.items()}
        inputs = first.inputs if "B" in own else None
        outputs = first.outputs if "C" in own else None
        if bounded := [word for word in delay or () if ":" in word]:
            raise SpecError(
                f"fit: --delay {bounded[0]}: of a state space give seconds or a name, and its bounds "
                f"by --param, as --delay h --param h={bounded[0]}"
            )
        late = one_or_all(delay) or 0.0
        return StateSpace(**own, states=names, inputs=inputs, outputs=outputs, params=params, delay=late)
    if len(first.outputs) > 1 and denominator is None:
        raise SpecError(
            f"fit: {len(first.outputs)} outputs ({', '.join(first.outputs)}): say whether they share their "
            "poles, --denominator common or separate"
        )
    channels = (len(first.outputs), len(first.inputs))
    return TransferFunction(
        poles=one_or_all(poles) or 2,
        zeros=by_path("--zeros", zeros, degree_of, channels),
        delay=by_path("--delay", delay, delay_of, channels) or 0.0,
        denominator=denominator,
        params=params,
    )
