"""Texts that would be harmful if they were run, given wherever modfun takes a text, under an audit hook.

    python fuzz/python/injected.py        (in an empty folder; tells what it saw as JSON)

A call with a faulty but harmless text goes first: what it causes, and no more, may be caused by the others.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import modfun as mf
from modfun.language.evaluate import function_of
from modfun.signals.sources import evaluate
from modfun.study import toml_file

HARM = (
    "__import__('os').system('touch harmed')",
    "open('harmed', 'w')",
    "exec('open(chr(104), chr(119))')",
    "eval('1+1')",
    "compile('1', 'harmed', 'eval')",
    "__builtins__['open']('harmed', 'w')",
    "globals()['__builtins__']",
    "().__class__.__bases__[0].__subclasses__()",
    "(1).__class__.__mro__",
    "a1.__class__",
    "t.tofile('harmed')",
    "sin.__globals__",
    "getattr(t, 'tofile')('harmed')",
    "os.system('touch harmed')",
    "subprocess.run(['touch', 'harmed'])",
    "socket.create_connection(('127.0.0.1', 9))",
    "breakpoint()",
    "input('give')",
    "f'{open(chr(104), chr(119))}'",
    "f'{1}'",
    "(lambda: open('harmed', 'w'))()",
    "lambda x: x",
    "(x := 1)",
    "[x for x in ().__class__.__bases__]",
    "{x: 1 for x in 'ab'}",
    "(x for x in 'ab')",
    "1 if open('harmed', 'w') else 2",
    "1 and open('harmed', 'w')",
    "not 1",
    "1; import os",
    "1\nimport os",
    "1\r\nopen('harmed', 'w')",
    "1)\nopen('harmed', 'w'",
    "import os",
    "from os import system",
    "del t",
    "yield 1",
    "await open('harmed')",
    "@open\ndef f(): pass",
    "`touch harmed`",
    "$(touch harmed)",
    "!touch harmed",
    "%run harmed",
    "{{ ''.__class__ }}",
    "${open('harmed')}",
    "%(open)s",
    "Symbol('x')",
    "Symbol(x)",
    'S(\'open("harmed", "w")\')',
    "S(1)",
    "sympify('1')",
    "sympify(1)",
    "parse_expr('1')",
    "lambdify(x, 1)",
    "Function('f')(1)",
    "Integer(1)",
    "Lambda(x, x)",
    "numpy.load('harmed')",
    "np.fromfile('harmed')",
    "\uff4f\uff50\uff45\uff4e(1)",  # fullwidth open
    "\uff45xec(1)",
    "ope\u0578(1)",  # an Armenian n
    "\uff11",
    "\U0001d49c",
    "__import__\uff08'os'\uff09",
    "_\u200b_import__",
    "\u202e1",
    "\x001",
    "1\x00",
    "\\x6f\\x70\\x65\\x6e(1)",
    "b'\\x80\\x04'",
    "'a' * 10**9",
    "[0] * 10**9",
    "1 .real",
    "1 is 1",
    "...",
    "*t",
    "**t",
)

PLANT = mf.tf([5], [1, 3, 8])
REC = mf.simulate(PLANT, input="sin(t)", duration=10.0, intervals=64, nsr=0.1, seed=0)
FIT = mf.fit(REC, mf.TransferFunction(poles=2, zeros=0), harmonics=6)
STUDY = {
    "input": '"sin(t)"',
    "duration": "10.0",
    "intervals": "64",
    "nsr": "0.1",
    "estimators": '["ls"]',
    "harmonics": "6",
    "system": "{ num = [5], den = [1, 3, 8] }",
}


def study(key: str, value: str) -> Any:
    """What the study file is read to, with `value` at a key."""
    told = STUDY | {key: value}
    Path("study.toml").write_text("\n".join(f"{name} = {one}" for name, one in told.items()), "utf-8")
    return toml_file.load("study.toml")


CALLS: dict[str, Callable[[str], Any]] = {
    "an equation": lambda x: mf.Equation(x).compiled(),
    "a term": lambda x: mf.Equation(f"y' + {x}*y = u").compiled(),
    "a right side": lambda x: mf.Equation(["y1' + a*y1 = u", f"y2' + y1 = {x}"]).compiled(),
    "a varying coefficient": lambda x: mf.Equation("y' + c(t)*y = u", varying={"c": ["1", x]}).compiled(),
    "an entry": lambda x: mf.StateSpace([[x, 1], ["a", "b"]], [0, 1]).compiled(),
    "an entry of B": lambda x: mf.StateSpace([[-1]], [[x]]).compiled(),
    "an output": lambda x: mf.Equation("y' + a*y = u", outputs=[x]).compiled(),
    "a state": lambda x: mf.StateSpace([["a"]], [1], states=[x]).compiled(),
    "a held parameter": lambda x: mf.Equation("y' + a*y = u", params={x: 1.0}).compiled(),
    "a parameter of a structure": lambda x: mf.fit(REC, mf.TransferFunction(poles=2, zeros=0, params={x: 1})),
    "derived": lambda x: FIT.derived(it=x),
    "expression": lambda x: function_of(x, ["a1"])({"a1": 1.0}),
    "evaluate": lambda x: evaluate(x, [0.0, 1.0]),
    "an input": lambda x: mf.simulate(PLANT, input=x, duration=1.0, intervals=8),
    "a column": lambda x: mf.read({"t": REC.t, "y": REC.y[0]}, outputs=x),
    "a study's input": lambda x: study("input", json.dumps(x)),
    "a study's system": lambda x: study("system", json.dumps(x)),
    "a study's estimator": lambda x: study("estimators", f"[{json.dumps(x)}]"),
    "a study's truth": lambda x: study("truth", f"{{ {json.dumps(x)} = 1.0 }}"),
    "a study's text": lambda x: study("seed", x),
}


# Harmless, most of them with a fault: what these cause is allowed.
PLAIN = ("1", "a1", "$", "a b", "1 +", "nothing(1)", "'x'", "a1.b", "\u00e9", "t\x00")

# Channels and parameters with dangerous names are names: code is generated of them, which holds nothing else.
NAMED = "exec' + open*exec + max(exec, 0)*eval*exec + where(exec < 0, 1, exec)*import_ = system"


def words(event: str, given: tuple[Any, ...]) -> str:
    """An event in words that are equal for equal events: no addresses and no counts."""
    first = given[0] if given else ""
    if event == "exec":
        first = f"{first.co_name} of {first.co_filename}"
    elif event == "compile":
        first = given[1]  # the file; parsing, too, is told as compiling
    elif not event.startswith(("open", "import", "os.", "subprocess", "socket", "shutil")):
        first = ""
    return re.sub(r"\d+", "0", f"{event} {first}")


class Watch:
    """What was caused while a call went on; a hook stays for ever, so there is one."""

    def __init__(self) -> None:
        self.on = False
        self.events: list[str] = []
        self.sources: list[str] = []
        sys.addaudithook(self.hook)

    def hook(self, event: str, given: tuple[Any, ...]) -> None:
        if self.on:
            self.events.append(words(event, given))
            if event == "compile" and "lambdify" in str(given[1]):
                self.sources.append(given[0].decode() if isinstance(given[0], bytes) else str(given[0]))

    def call(self, function: Callable[[str], Any], text: str) -> tuple[str, set[str]]:
        """How it ended, and the events."""
        self.events, self.on = [], True
        try:
            function(text)
            ended = "a result"
        except mf.ModfunError as error:
            ended = type(error).__name__
        except BaseException as error:  # told, whatever it is
            ended = f"{type(error).__name__}: {error}"[:200]
        self.on = False
        return ended, set(self.events)


def named(text: str) -> Any:
    """A fit of an equation with dangerous names, and its simulation."""
    rec = mf.read({"t": REC.t, "exec": REC.y[0], "system": REC.u[0]}, outputs="exec", inputs="system")
    model = mf.Equation(text, outputs=["exec"], inputs=["system"])
    mf.simulate(model.model({"open": 1, "eval": 1, "import_": 1}), input="1", duration=1.0, intervals=8)
    return mf.fit(rec, model, harmonics=6)


def main() -> None:
    """Every text at every call."""
    watch = Watch()
    report: dict[str, Any] = {"attempts": 0, "ended": {}, "wrong": []}
    report["run"] = sorted(watch.call(eval, "open('run', 'w').close()")[1])  # the hook does see
    for name, call in CALLS.items():
        for text in PLAIN:
            watch.call(call, text)  # imports, once for all
        benign = set().union(*(watch.call(call, text)[1] for text in PLAIN))
        for text in HARM:
            ended, events = watch.call(call, text)
            report["attempts"] += 1
            report["ended"][ended] = report["ended"].get(ended, 0) + 1
            if events - benign or ended not in ("SpecError", "DataError"):
                report["wrong"].append([name, text, ended, sorted(events - benign)])
    watch.sources = []
    report["named"] = watch.call(named, NAMED)[0]
    report["sources"] = watch.sources
    report["files"] = sorted(os.listdir("."))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
