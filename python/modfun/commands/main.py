"""The `modfun` command: exit codes, and where output goes. The commands are in `commands.py`.

Exit code 0 success, 1 a fit or a study failed, 2 bad use or bad input. Data go to standard output,
everything else to standard error.
"""

from __future__ import annotations

import io
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from ..errors import DataError, ModfunError, ModfunWarning, SpecError

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

    for stream in (sys.stdout, sys.stderr):
        # A terminal without Greek letters shows a question mark, not a traceback.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        warnings.simplefilter("always", ModfunWarning)
        try:
            app(args=None if arguments is None else list(arguments), prog_name="modfun")
        except SystemExit as leaving:
            return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        except (DataError, SpecError) as error:
            return _say(str(error), 2)
        except ModfunError as error:
            return _say(str(error), 1)
        except ImportError as error:
            if "pip install" not in str(error):  # ours say so; any other is a defect and keeps its traceback
                raise
            return _say(str(error), 2)
        except OSError as error:
            place = f" {error.filename!r}" if error.filename else ""
            return _say(f"cannot use{place}: {error.strerror or error}", 2)
    return 0


def _say(text: str, code: int) -> int:
    print(f"modfun: {text}", file=sys.stderr)
    return code


def _show_warning(message: Any, category: type[Warning], *rest: Any, **more: Any) -> None:
    print(f"modfun: warning: {message}", file=sys.stderr)
