"""The `modfun` command: exit codes, and where output goes. The commands are in `commands.py`.

Exit code 0 success, 1 a fit or a study failed or no term was found, 2 bad use or bad input. Data go to
standard output, everything else to standard error.
"""

from __future__ import annotations

import io
import re
import sys
import warnings
from collections.abc import Sequence

from ..errors import DataError, ModfunError, ModfunWarning, SpecError

# Options of functions that the command line has by another name than --name.
RENAMED = {"outputs": "output", "inputs": "input"}
OPTIONS = (
    "outputs", "inputs", "time", "dt", "intersample", "missing", "missing_values", "part", "units", "only",
    "on", "poles", "zeros", "delay", "denominator", "method", "band", "harmonics", "trend", "noise",
    "cov_type", "rule", "initial_state", "reference", "library", "target",
)  # fmt: skip
# Not in a call that is quoted, rec.select(outputs=...).
SAID = re.compile(rf"""(?<![(\w.])({"|".join(OPTIONS)})=(?:'([\w.]*)'|"([\w.]*)"|(?=(['"\w\[({{-]))|)""")
SWITCHES = re.compile(r"(?<![(\w.])(robust|stable)=True\b")

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.

    Returns
    -------
    int
        The exit code.
    """
    try:
        import rich  # noqa: F401
        import typer  # noqa: F401
    except ModuleNotFoundError:
        return _say('the command line needs typer and rich: pip install "modfun[cli]"', 2)
    from .app import app

    words = sys.argv[1:] if arguments is None else list(arguments)
    told = str if words[:1] == ["mc"] else in_options  # a study's options are keys of its file

    for stream in (sys.stdout, sys.stderr):
        # A terminal without Greek letters shows a question mark, not a traceback.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *rest, **more: _print(f"warning: {told(str(message))}")
        warnings.simplefilter("always", ModfunWarning)
        try:
            app(args=words, prog_name="modfun")
        except SystemExit as leaving:
            return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        except (DataError, SpecError) as error:
            return _say(told(str(error)), 2)
        except ModfunError as error:
            return _say(told(str(error)), 1)
        except ImportError as error:
            if "pip install" not in str(error):  # ours say so; any other is a defect and keeps its traceback
                raise
            return _say(str(error), 2)
        except OSError as error:
            place = f" {error.filename!r}" if error.filename else ""
            return _say(f"cannot use{place}: {error.strerror or error}", 2)
    return 0


def _say(text: str, code: int) -> int:
    _print(text)
    return code


def _print(text: str) -> None:
    print(f"modfun: {text}", file=sys.stderr)


def in_options(text: str) -> str:
    """A message in the words of the command line: time='t' as --time t."""

    def said(found: re.Match[str]) -> str:
        name, value = RENAMED.get(found[1], found[1]), found[2] or found[3] or ""
        return f"--{name.replace('_', '-')}{' ' if value or found[4] else ''}{value}"

    return SAID.sub(said, SWITCHES.sub(r"--\1", text))
