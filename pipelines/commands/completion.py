"""Tab completion: words for values that are none of files, and the script that a shell reads.

Paths are left to the shell. Vocabularies that stand in heavy modules are repeated here, because a shell waits for
them at every press of the key; a test compares them with where they stand.
"""

from __future__ import annotations

import glob
import importlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

from pipelines.commands.completion_scripts import SHELL_FILES, install
from sloshlab.errors import InputError

SHELLS: Final = (*SHELL_FILES, "powershell", "pwsh")
PROGRAM: Final = "sloshlab"
VARIABLE: Final = "_SLOSHLAB_COMPLETE"
"""Of the environment: a shell asks for words by it."""

DEMONSTRATIONS: Final = ("friction", "moving-liquid", "late-sensor", "two-at-once", "nothing-hidden")
BENCHMARKS: Final = ("silverbox", "emps", "f16", "bouc_wen", "cascaded_tanks", "wiener_hammerstein")
NETWORKS: Final = ("normalised_rbf", "rbf", "multilayer")
SWEEP_LAWS: Final = ("octave", "linear", "stepped")
LABORATORIES: Final = ("exact", "drawn")
LIQUIDS: Final = ("law", "numerical", "two_phase")
ALIGNMENTS: Final = ("host", "device", "counter")
_SERIAL_PORTS: Final = ("/dev/ttyUSB*", "/dev/ttyACM*", "/dev/cu.usb*")

Words = Callable[[str], list[str]]


def one_of(words: Iterable[str]) -> Words:
    """Completion of a value by a vocabulary.

    Examples
    --------
    >>> one_of(("octave", "linear"))("o")
    ['octave']
    """
    known = tuple(words)

    def complete(incomplete: str) -> list[str]:
        return [word for word in known if word.startswith(incomplete)]

    return complete


def source_url(incomplete: str) -> list[str]:
    """Schemes of the sources, and serial ports that are there."""
    from acquisition.sources.urls import BACKENDS

    ports = sorted(port for pattern in _SERIAL_PORTS for port in glob.glob(pattern))
    schemes = (f"{scheme}:" for scheme in BACKENDS.names)
    return one_of([*schemes, *(f"serial:{port}" for port in ports)])(incomplete)


def device_url(incomplete: str) -> list[str]:
    """Where a simulated device may appear."""
    return one_of(("serial:", "serial:socket://127.0.0.1:", "can:socketcand?", "can:slcan?"))(incomplete)


def replay_source(incomplete: str) -> list[str]:
    """What `replay` plays that is no file."""
    return one_of(("virtual:", "pattern:"))(incomplete)


def install_completion(shell: str) -> list[str]:
    """Write the completion script where a shell finds it; return what to say.

    Parameters
    ----------
    shell : str
        One of `SHELLS`; empty for the one that started this program.

    Raises
    ------
    InputError
        If the shell is unknown.
    """
    known = _known(shell)
    if known in SHELL_FILES:
        place = install(SHELL_FILES[known], Path.home())
    else:
        _, place = _typer_completion().install(shell=known, prog_name=PROGRAM, complete_var=VARIABLE)
    return [f"completion for {known}: {place}", "it works in the next terminal that is opened"]


def completion_script(shell: str) -> str:
    """The completion script of a shell, for somebody who installs it by hand.

    Raises
    ------
    InputError
        If the shell is unknown.
    """
    known = _known(shell)
    if known in SHELL_FILES:
        return SHELL_FILES[known].script
    return str(_typer_completion().get_completion_script(prog_name=PROGRAM, complete_var=VARIABLE, shell=known))


def answer_a_shell() -> None:
    """Make the shells known to the library that answers them, if one asks."""
    if VARIABLE in os.environ:
        _typer_completion().completion_init()


def _typer_completion() -> Any:
    """The module of typer that answers shells; it says of no name that it is for others."""
    return importlib.import_module("typer.completion")


def _known(shell: str) -> str:
    chosen = shell or _shell_around()
    if chosen not in SHELLS:
        got = repr(chosen) if chosen else "no shell that could be told"
        raise InputError(
            "completion", got=got, allowed=", ".join(SHELLS), remedy="name the shell after the option"
        )
    return chosen


def _shell_around() -> str:
    """Name of the shell that started this program; empty where nothing tells."""
    try:
        from shellingham import ShellDetectionFailure, detect_shell  # type: ignore[import-untyped]
    except ImportError:
        return os.path.basename(os.environ.get("SHELL", ""))
    try:
        return str(detect_shell()[0])
    except ShellDetectionFailure:
        return os.path.basename(os.environ.get("SHELL", ""))
