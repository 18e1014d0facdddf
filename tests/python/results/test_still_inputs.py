"""Inputs that never move: fits say so, and what they print leaves them out."""

from __future__ import annotations

import flights
import modfun as mf
import numpy as np
import pytest

WORDS = {"states": ["alpha", "q"], "inputs": ["de", "df"]}
FLAPPED = [["Za", 1], ["Ma", "Mq"]], [["Zd", "Zf"], ["Md", "Mf"]]
WRITTEN = [
    "alpha' = Za*alpha + q + Zd*de + Zf*df + c1",
    "q' = Ma*alpha + Mq*q + Md*de + Mf*df + c2",
]


def standing(seed: int, level: float) -> mf.Record:
    """A flight with a flap that stood at a level."""
    right = flights.flown(seed)
    u = {"de": right["de"], "df": np.full(right.t.size, level)}
    return mf.Record({"alpha": right["alpha"], "q": right["q"]}, u, dt=right.dt, intersample="smooth")


def model(kind: str, **words: object) -> mf.StateSpace | mf.Equation:
    if kind == "matrices":
        return mf.StateSpace(*FLAPPED, **WORDS, **words)
    return mf.Equation(WRITTEN, outputs=["alpha", "q"], inputs=["de", "df"], **words)


@pytest.mark.parametrize("level", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["matrices", "equations"])
def test_an_input_that_never_moves_is_named_and_both_cures_work(kind: str, level: float) -> None:
    """The warning advised to hold one parameter after the other."""
    rec = standing(0, level)
    fit, text = flights.warned(rec, model(kind))
    assert fit.status == "rank"
    assert f"Input 'df' never moved, at {level:g} throughout, so nothing can be learnt about its gain" in text
    assert text.removeprefix("fit: ") in fit.check().sentences
    held = eval(text.split("params=")[1].removesuffix("."))
    assert held == {"Zf": 0, "Mf": 0}
    fit, after = flights.warned(rec, model(kind, params=held))
    assert (fit.status, after) == ("ok", "")
    short = eval(text.split("of the record, ")[1].split(", or hold")[0], {"rec": rec})
    assert short.inputs == ("de",)
    assert flights.warned(short, flights.SHORT)[0].status == "ok"
    assert any("rec.select(inputs=['de'])" in one for one in rec.check())


def test_one_of_several_records_that_moves_it_is_enough() -> None:
    still, moves = standing(0, 0.0), standing(1, 0.0)
    flap = 0.05 * np.sin(moves.t)
    y = mf.ss([[-0.9, 1], [-5.2, -1.4]], [[-0.1], [1.0]], np.eye(2), np.zeros((2, 1))).simulate(
        u=flap, dt=moves.dt, intersample="smooth"
    )
    moves = moves.assign(alpha=moves["alpha"] + y[0], q=moves["q"] + y[1], df=flap)
    fit, text = flights.warned([still, moves], model("matrices"))
    assert (fit.status, text) == ("ok", "")


def test_two_that_never_move_are_named_together() -> None:
    rec = standing(0, 0.0).assign(de=np.ones(801))
    text = flights.warned(rec, model("matrices"))[1]
    assert "Inputs 'de' and 'df' never moved, at 1 and 0 throughout" in text
    assert "rec.select(inputs=[])" in text


def test_a_transfer_function_is_refused_with_the_inputs_that_are_left() -> None:
    rec = standing(0, 0.0).select(outputs="q")
    with pytest.raises(mf.DataError, match=r"rec\.select\(inputs=\['de'\]\)"):
        mf.fit(rec, mf.TransferFunction(poles=2, zeros=1))
