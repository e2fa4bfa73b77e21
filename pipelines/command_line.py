"""The command line: what to read, what to write, and how it ends.

Exit codes: 0 done; 1 the input is bad, one line on stderr; 2 usage; 3 done, but data were lost or a
result is flagged; 130 interrupted, 129 and 143 terminated, nothing half-written. Commands import what they
need when they run, and only the module of the command that is called is loaded, so that each begins quickly.
"""

from __future__ import annotations

import io
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final, NoReturn

import typer

from pipelines.commands.application import DONE_BUT_FLAGGED, INPUT_IS_BAD, INTERRUPTED, USAGE, app
from pipelines.commands.completion import PROGRAM, answer_a_shell
from pipelines.report.terminal import complain, say
from sloshlab import interrupt
from sloshlab.errors import RecordingInterruptedError, SloshlabError

__all__ = ["DONE_BUT_FLAGGED", "INPUT_IS_BAD", "INTERRUPTED", "USAGE", "application", "main", "run"]

_PLACES: Final = {
    "demo": "demo",
    "import": "recordings",
    "check": "recordings",
    "analyse": "analysis",
    "shaker": "analysis",
    "work": "analysis",
    "beam": "analysis",
    "ball": "analysis",
    "ball-network": "analysis",
    "train": "models",
    "validate": "models",
    "study": "models",
    "simulate": "models",
    "flutter": "flutter",
    "aircraft": "aircraft",
    "wing": "wing",
    "case": "case",
    "diagnose": "diagnosis",
    "benchmark": "field_benchmarks",
    "trial": "trial",
    "campaign": "campaign",
    "virtual": "virtual",
    "record": "laboratory",
    "recover": "laboratory",
    "replay": "laboratory",
    "info": "info",
}
"""Modules of the commands, which register themselves when they are imported; in the order of the help."""

# typer brings its own click or uses the installed one; either way this is the root of its usage errors
_UsageError: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")


def application(words: Sequence[str] = ()) -> typer.Typer:
    """The application with the command that words begin with, or with every one where they begin with none."""
    asked = _PLACES.get(words[0]) if words else None
    for module in dict.fromkeys([asked] if asked else _PLACES.values()):
        import_module(f"pipelines.commands.{module}")
    order = list(_PLACES)
    app.registered_commands.sort(key=lambda command: order.index(command.name or command.callback.__name__))  # type: ignore[union-attr]
    app.registered_groups.sort(key=lambda group: order.index(group.name or ""))
    return app


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        answer_a_shell()
        with interrupt.never_lost():
            code = int(application(words)(args=words, prog_name=PROGRAM, standalone_mode=False) or 0)
        if code == INTERRUPTED:  # some versions of typer turn Ctrl-C into this code without a word
            raise KeyboardInterrupt
        return code
    except RecordingInterruptedError as error:
        complain(f"sloshlab: {error}")
        return INTERRUPTED
    except SloshlabError as error:
        complain(f"sloshlab: {error}")
        return INPUT_IS_BAD
    except _UsageError as error:
        _show(error)
        return USAGE
    except (KeyboardInterrupt, typer.Abort) as end:
        # typer takes an end of file for Ctrl-D at a question; commands ask none: it is a file that ends early
        if isinstance(end.__cause__, EOFError):
            raise end.__cause__ from None
        complain("sloshlab: interrupted; nothing half-written")
        return INTERRUPTED
    except interrupt.Terminated as termination:
        print(f"sloshlab: ended by {termination}; nothing half-written", file=sys.stderr)  # noqa: T201
        return termination.exit_code
    except OSError as error:
        what = f"{error.filename}: " if error.filename else ""
        remedy = "check that the path can be written, and that a folder or file of this name is not in the way"
        complain(f"sloshlab: {what}got {error.strerror or error}; remedy: {remedy}")
        return INPUT_IS_BAD


def _show(error: Any) -> None:
    """A usage error, or the help of a command that was called without anything."""
    text = io.StringIO()
    error.show(text)
    for line in text.getvalue().expandtabs().splitlines():
        if line.startswith("Error:"):
            complain(line)
        else:
            say(line, error=True)


def main() -> NoReturn:
    """Entry point of the ``sloshlab`` command."""
    code = run()
    for number in (signal.SIGINT, *interrupt.TERMINATIONS):
        signal.signal(number, signal.SIG_IGN)  # what is done is done: nothing is left to interrupt
    sys.exit(code)


if __name__ == "__main__":
    main()
