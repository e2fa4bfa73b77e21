"""The command `demo`: conceal, find, show."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from pipelines.demonstration.comparison import error_lines, judgement, number_lines, truth_sentence
from pipelines.demonstration.sealed_cases import DIAGNOSIS, TRUTH, conceal, earlier_files
from pipelines.report.progress import is_silenced
from sealed_trial.demonstrations import DEMONSTRATIONS, DOMAIN
from sealed_trial.running import DIAGNOSE
from sealed_trial.scoring.answer import read_answer
from sealed_trial.scoring.mark import marked
from sealed_trial.sealing.sealed_case import CASE, LOCKED, PublishedCase, key_of, opened_truth, read_published
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import AnalysisError, InputError

_DONE: Final = (0, 3)
"""Exit codes of a diagnosis that gave an answer."""
Say = Callable[[str], None]


def list_lines() -> list[str]:
    """All demonstrations, one a line."""
    width = max(len(name) for name in DEMONSTRATIONS)
    return [f"{name:<{width}}  {known.title}" for name, known in DEMONSTRATIONS.items()]


def demonstrate(
    name: str, output: Path, say: Say, *, seed: int | None = None, opens_page: bool = True
) -> dict[str, Any]:
    """Hide physics in a laboratory run, have it diagnosed by a process that does not know it, open the truth.

    Parameters
    ----------
    name : str
        One of `DEMONSTRATIONS`.
    output : Path
        Folder; new, empty, or of an earlier demonstration.
    say : callable
        Takes every line at once.
    seed : int, optional
        Draws another case than the ready-made one.
    opens_page : bool
        Whether the report is opened where there is a browser to show it.

    Raises
    ------
    InputError
        If there is no such demonstration, the seed is negative, or the folder is in use.
    AnalysisError
        If no case can be drawn, or the diagnosis gives no answer.
    """
    if name not in DEMONSTRATIONS:
        raise InputError("demo", got=name, allowed=", ".join(DEMONSTRATIONS), remedy="sloshlab demo --list")
    if seed is not None and seed < 0:
        raise InputError("--seed", got=str(seed), allowed="≥ 0")
    # before the first word: what is refused is refused in one line
    earlier_files(output)
    began = time.monotonic()
    published, seed = _concealed(name, seed, output, say)
    _find(output, say)
    told = _show(name, seed, published, output, say)
    page = output / DIAGNOSIS / "report.html"
    opened = opens_page and open_page(page)
    say("")
    say(f"Page: {page.resolve()}{' (opened in the browser)' if opened else ''}")
    say(f"Another case of this kind: sloshlab demo {name} --seed {seed + 1}; other kinds: sloshlab demo --list")
    return {**told, "output": str(output), "page": str(page), "wall_s": round(time.monotonic() - began, 1)}


def _concealed(name: str, seed: int | None, output: Path, say: Say) -> tuple[PublishedCase, int]:
    chosen = DEMONSTRATIONS[name]
    say(f"1. CONCEAL: {chosen.title}")
    say("   A laboratory that shares no code with the analysis")
    say(f"   {chosen.measured}.")
    published, used = conceal(name, seed, output)
    say(f"   Its rig file says nothing of what is hidden; how much of it there is was drawn from seed {used}.")
    say(f"   The truth is locked in {output / LOCKED}.")
    say(f"   Its fingerprint, published before anybody looks: SHA-256 {published.commitment[:16]}…")
    return published, used


def _find(output: Path, say: Say) -> None:
    say("")
    say(f"2. FIND – sloshlab diagnose {output / CASE}")
    say("   A process of its own compares the simulation with the recordings; it has neither key nor seed.")
    began = time.monotonic()
    words = [*DIAGNOSE, str(output / CASE), "-o", str(output / DIAGNOSIS), *(["--quiet"] if is_silenced() else [])]
    # its progress goes to this terminal, its answer is read from the file
    ended = subprocess.run(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)
    if ended.returncode not in _DONE:
        raise AnalysisError(
            "demo: the diagnosis",
            got=f"exit code {ended.returncode}",
            allowed="an answer",
            remedy="see the line above",
        )
    say(f"   Answered after {time.monotonic() - began:.0f} s.")


def _show(name: str, seed: int, published: PublishedCase, output: Path, say: Say) -> dict[str, Any]:
    file = output / DIAGNOSIS / "verdict.json"
    verdict: dict[str, Any] = json.loads(file.read_bytes())
    # the case as it was published, the truth as it was committed to: both are checked here
    if read_published(output) != published:
        raise InputError(f"{output}", got="another commitment than before the search", allowed="the same")
    truth = opened_truth(output, published, key_of(DOMAIN, name, seed))
    write_bytes(output / TRUTH, (json.dumps(truth, indent=1, sort_keys=True) + "\n").encode())
    mark, fit = marked(truth, read_answer(file)), verdict["fit"]
    say("")
    say("3. SHOW – the truth is unlocked, and its fingerprint is the one published")
    say(f"   Answer:  {verdict['headline']}")
    say(f"   Hidden:  {truth_sentence(truth)}")
    say(f"   {judgement(mark)}")
    for line in number_lines(truth, verdict):
        say(f"     {line}")
    say("")
    runs = ", ".join(fit["heldout_runs"])
    say(f"   Error of the simulation on {runs}, which nothing was fitted to,")
    say("   in noise floors (1: as good as the recordings can tell):")
    for line in error_lines(fit):
        say(f"     {line}")
    return {
        "demo": name,
        "seed": seed,
        "right": mark.right,
        "judgement": mark.column,
        "verdict": verdict["verdict"],
        "truth": mark.truth,
        "answered": mark.answered,
        "headline": verdict["headline"],
        "heldout_before": fit["heldout_before"],
        "heldout_retuned": fit["heldout_retuned"],
        "heldout_after": fit["heldout_after"],
        "flags": [] if mark.right else [f"the answer is not the truth: {judgement(mark)}"],
    }


def open_page(page: Path) -> bool:
    """Open a page in a browser with a window of its own; False where there is none.

    A browser in the terminal is no place for a page with figures, and would take the terminal away.
    """
    has_display = sys.platform in ("win32", "darwin") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if not has_display or not sys.stdout.isatty():
        return False
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    in_terminal = isinstance(browser, webbrowser.GenericBrowser) and not isinstance(
        browser, webbrowser.BackgroundBrowser
    )
    return not in_terminal and browser.open(page.resolve().as_uri())
