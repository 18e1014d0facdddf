"""What the report says in numbers or in words that can be tested, beside what modfun finds."""

from __future__ import annotations

import numpy as np
import pem
import problems
from claims import TRUE, Claim, figure_2, flights, section_4, section_410, setting, studied
from page import Section, absent, limit

NSR = (
    "the report does not define its noise-to-signal ratio: see the row below, where noise is counted on the mean "
    "magnitude of y; the bias grows as NSR² (Orders) and is 12 % at 51 % of the rms"
)
PEM = (
    "the report does not say which structure its PEM had, and none that was tried has this bias (\"The report's "
    'PEM" below): why it is 6–7 % is not known'
)
SPREAD = (
    "this PEM has two numerator coefficients, which 25.6 Hz hardly tells apart; with b u(t − 1) alone, nearly as "
    "free of bias, the spreads are nearly the same (rows below)"
)
STATES = (
    "the report does not say how large its initial states were; ones of the rms of the response die away with a "
    "time constant of 0.67 s and add little to 10 s of signal"
)
REASONS = {
    "Fig. 2, bias of the method": NSR,
    "Fig. 2, bias of PEM": PEM,
    "Fig. 2, sd of the method over that of PEM": SPREAD,
    "Fig. 2, random states: change of bias": STATES,
    "Fig. 2, random states: change of sd": STATES,
    "Fig. 2, random states: PEM": STATES
    + "; PEM that assumes rest is the worse for it, but not several times",
    "4.3, time": "not the same comparison: compiled code here against SciPy, two toolboxes of MATLAB there",
}

NOT = (
    ("Fig. 1(a), (b)", "a step response and a magnitude of [24]; both follow from the system and are not results"),
    ("Fig. 1(c)", "curves without numbers in the text we have; ours in `modfun reproduce report`, orders below"),
    ("4.3, PEM's bias and spread at random states", "\"unpredictable behaviour that is difficult to reproduce\": no number"),
    ("4.4, covariance (8) of [16], (2.25) of [20]", "in other works; the formula is held to a dense twin (`tests/python/oracle/banded.py`)"),
    ("4.4, gain of `awls` on [24]", "in Shen's thesis, section 2.4; ours in `modfun reproduce report`"),
    ("4.5, examples of reduction", "in Shen's thesis, chapter 3; the classic of fourth order is under Benchmarks"),
    ("4.6, weighting between outputs", "left to the user there; estimated here ([linear.md](linear.md))"),
    ("4.7, F-18 flight, lateral, 9–12 dB", "other records; the lateral record we have, at 40° angle of attack, gives 2 to 6 dB as a whole and 16 dB in its second part ([page](records/f18_lateral.md), `python examples/records/f18_lateral.py`)"),
    ("4.7, figures 5.5, 5.8, 5.12, 5.14 of [20]", "in Shen's thesis"),
    ("4.8, parabolic damping", "\"good noise rejection\", no number; ours in [nonlinear.md](nonlinear.md) (`python benches/nonlinear.py parabolic`)"),
    ("4.8, nonlinear models", "\"mainly of theoretical interest thus far\"; ours in [nonlinear.md](nonlinear.md)"),
    ("4.9, two inputs, two outputs", "an example in [22], no number; ours in [response.md](response.md), and under Benchmarks"),
    ("4.10, orders", "no number; the rate of true orders found is in [order.md](order.md) (`python benches/order.py`)"),
    ("4.10, definition of \"degree of collinearity\"", "in [11]; taken: the share of a regressor that the others explain"),
    ("4.10, time lag", "no number; that z' = Az + Bu holds exactly is `tests/python/timelag/test_timelag.py::test_z_obeys_its_equation_along_the_delay_equation`, more in [timelag.md](timelag.md)"),
)  # fmt: skip


def section(scale: float = 1.0) -> Section:
    """The section."""
    out = Section("The report", reasons=REASONS)
    runs = max(int(20_000 * scale), 2000)
    few = 200 if scale >= 1 else 10
    claims = [*figure_2(few, runs), *section_4(runs), *section_410(runs)]
    flown: list[Claim] = []
    needed = problems.FOLDER / "f18_polynomial_model"
    if needed.exists():
        flown = list(flights())
    z = limit(len(claims) + len(flown))
    out.say(
        f"A row is ok where our number lies within what the report says, or not more than {z:.1f} Monte Carlo standard "
        "errors outside (1 % false alarms in the whole section). Where the report has words, the range taken for them "
        f"is in the table. Runs a point: {few}, as in the report, for Fig. 2; the others {runs:,} or as their command "
        'says. "Away" is the distance from the range in standard errors; of numbers without scatter it is empty.'
    )
    columns = ("what", "report", "range", "modfun", "±", "away", "command", "why")
    out.table(columns, [_row(out, c, z) for c in claims])
    out.say(
        "What the report finds and this does not: a fall of its method's bias and spread with random initial states. "
        "Here both stay within their errors; states of five times the rms of the response change the bias by half a "
        "point to two, some up, some down. And the bias of its PEM."
    )
    out.under("The report's PEM")
    out.say(
        "Discrete-time output error of second order from rest, in the structures and with the conversions to "
        "continuous time that it may have had: bias without noise, in %, by conversion; bias and sd at NSR 60 %, and "
        f"the sd of `ls` over it, with logarithms; {few} runs. Half an interval out of time, b u(t), or difference "
        "quotients in the place of logarithms make a bias that does not depend on the noise, of 5 to 13 %; none makes "
        "6–7 %. What the report did is not known."
    )
    heads = (
        "numerator", *(f"{way}, NSR 0" for way in pem.CONVERSIONS), "bias, NSR 60 %", "sd", "sd of `ls` over it",
    )  # fmt: skip
    spread = 100 * float(np.sqrt(np.mean((studied([0.6], ("ls",), runs).sd.reshape(-1) / TRUE) ** 2)))
    out.table(heads, pem.rows(setting, few, spread))
    out.under("Applications to an F-18 (4.7)")
    if flown:
        out.say(
            "S/E, the ratio of the output to the error of its simulation. Theoretical: the published linear model of "
            "the F/A-18 moved by the inputs of two flights; 20 replicates, white noise. More than the report reaches is ok: the report does not say how strong its noise was, "
            "and its flight record is another."
        )
        out.table(columns, [_row(out, c, z) for c in flown])
    else:
        out.say(absent(needed))
    out.under("What cannot be compared")
    out.table(("what", "why"), NOT, left=2)
    return out


def _row(out: Section, c: Claim, z: float) -> tuple[str, ...]:
    verdict = out.judge(c.name, c.away <= z)
    away = f"{c.away:.1f}" if c.error else ""
    error = f"{c.error:.{c.digits}f}" if c.error else ""
    span = f"{c.low:g} … {c.high:g}".replace("-inf … ", "≤ ").replace(" … inf", " or more")
    return c.name, c.said, span, f"{c.value:.{c.digits}f}", error, away, c.command, verdict
