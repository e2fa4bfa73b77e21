"""What bash, zsh and fish read to ask this program for words, and the files in which they look for it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

BASH: Final = """\
_sloshlab_completion() {
  local IFS=$'\\n'
  COMPREPLY=( $( env COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD _SLOSHLAB_COMPLETE=complete_bash "$1" ) )
  # a scheme is not the end of a word
  if [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[:?=/] ]] && type compopt &> /dev/null; then
    compopt -o nospace
  fi
}

complete -o default -F _sloshlab_completion sloshlab
"""
ZSH: Final = """\
#compdef sloshlab

_sloshlab_completion() {
  eval $(env _TYPER_COMPLETE_ARGS="${words[1,$CURRENT]}" _SLOSHLAB_COMPLETE=complete_zsh "${words[1]}")
}

compdef _sloshlab_completion sloshlab
# the first press of the key in a session loads this file, and wants its words already
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
  _sloshlab_completion "$@"
fi
"""
FISH: Final = """\
function _sloshlab_words
  env _SLOSHLAB_COMPLETE=complete_fish _TYPER_COMPLETE_FISH_ACTION=$argv[1] \\
    _TYPER_COMPLETE_ARGS=(commandline -cp | string collect) sloshlab
end

complete --command sloshlab --no-files --condition "_sloshlab_words is-args" \\
  --arguments "(_sloshlab_words get-args)"
"""


@dataclass(frozen=True)
class ShellFiles:
    """How a shell gets its script.

    Attributes
    ----------
    script : str
    place : callable
        Where the script goes, below a home folder.
    started_by : str
        File that the shell reads when it starts; empty where the place is enough.
    line : callable
        What has to stand in that file, by the place of the script.
    """

    script: str
    place: Callable[[Path], Path]
    started_by: str = ""
    line: Callable[[Path], str] = str


def _fish_place(home: Path) -> Path:
    settings = os.environ.get("XDG_CONFIG_HOME")
    return (Path(settings) if settings else home / ".config") / "fish" / "completions" / "sloshlab.fish"


SHELL_FILES: Final = {
    "bash": ShellFiles(
        BASH,
        lambda home: home / ".bash_completions" / "sloshlab.sh",
        ".bashrc",
        lambda place: f"source '{place}'",
    ),
    "zsh": ShellFiles(
        ZSH,
        lambda home: home / ".zfunc" / "_sloshlab",
        ".zshrc",
        lambda place: "fpath+=~/.zfunc; autoload -Uz compinit; compinit",
    ),
    "fish": ShellFiles(FISH, _fish_place),
}


def install(shell: ShellFiles, home: Path) -> Path:
    """Write a script to its place, and the line that loads it; what else stands in that file stays.

    Parameters
    ----------
    shell : ShellFiles
    home : Path
        Folder of the user.

    Returns
    -------
    Path
        The script.
    """
    place = shell.place(home)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(shell.script, encoding="utf-8")
    if shell.started_by:
        start, line = home / shell.started_by, shell.line(place)
        known = start.read_text(encoding="utf-8", errors="replace") if start.is_file() else ""
        if line not in known.splitlines():
            # appended, and not replaced: it may be a link into somebody's collection of such files
            with start.open("a", encoding="utf-8") as stream:
                stream.write(f"{'' if known.endswith(chr(10)) or not known else chr(10)}{line}\n")
    return place
