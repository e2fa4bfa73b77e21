"""The folder of a challenge, and everything in it that should not be there.

CHALLENGE/cases/NAME/           rig.toml, model.toml or twin.py; recordings/*.nc, other *.nc that rig.toml names
CHALLENGE/commitments.json      optional: what was true, fixed before anybody answered
CHALLENGE/answers.json          written by us: hashes of all answers
CHALLENGE/diagnoses/NAME/       written by us: the answers

Nothing is followed, opened or hashed before its kind, name and size have been looked at: the folder is somebody
else's.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sealed_trial.sealing.commitment import file_hash
from sealed_trial.sealing.locked_truths import MAGIC
from sealed_trial.sealing.trial_folder import COMMITMENTS, LOCKED
from sloshlab.errors import InputError

CASES: Final = "cases"
ANSWERS: Final = "answers.json"
RIG, TWIN, MODEL, RECORDINGS = "rig.toml", "twin.py", "model.toml", "recordings"
_DESCRIPTIONS: Final = (RIG, TWIN, MODEL)
PURPOSE: Final = "challenge"

NAME_PATTERN: Final = r"[A-Za-z][A-Za-z0-9_-]{0,63}"
_NAME: Final = re.compile(NAME_PATTERN, re.ASCII)
_RECORDING: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\.nc", re.ASCII)
_READ_ME: Final = ("README", "README.md", "README.txt")
_ALLOWED_NAME: Final = "a letter, then at most 63 letters, digits, _ or -"

MOST_CASES: Final = 1000
MOST_FILES: Final = 220
"""Of a case: as many recordings as a diagnosis takes, and some models."""
LARGEST_TEXT_BYTES: Final = 1_000_000
LARGEST_CASE_BYTES: Final = 2 * 2**30
_LARGEST_COMMITMENTS_BYTES: Final = 64 * 2**20


@dataclass(frozen=True)
class ChallengeCase:
    """One case of a challenge.

    Attributes
    ----------
    name : str
    folder : Path
    files : tuple of str
        Paths of its files within the folder.
    """

    name: str
    folder: Path
    files: tuple[str, ...]

    @property
    def twin(self) -> Path | None:
        """The Python module that is its twin; None where rig.toml describes it."""
        return self.folder / TWIN if TWIN in self.files else None

    @property
    def model(self) -> Path | None:
        """The model file of a wing in flight; None for other cases."""
        return self.folder / MODEL if MODEL in self.files else None

    @property
    def recordings(self) -> tuple[Path, ...]:
        """Files of its recordings."""
        return tuple(self.folder / name for name in self.files if name.startswith(f"{RECORDINGS}/"))

    def hashes(self) -> dict[str, str]:
        """SHA-256 of every file, by its path within the case."""
        return {name: file_hash(self.folder / name) for name in self.files}


def is_challenge(folder: Path) -> bool:
    """Whether a folder has cases, and no commitments of a trial of our own."""
    if not (folder / CASES).is_dir():
        return False
    path = folder / COMMITMENTS
    if not path.is_file() or path.stat().st_size > _LARGEST_COMMITMENTS_BYTES:
        return not path.exists()
    try:
        return bool(json.loads(path.read_bytes())["purpose"] == PURPOSE)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return False


def found_cases(folder: Path) -> tuple[tuple[ChallengeCase, ...], tuple[InputError, ...]]:
    """Cases of a challenge in the order of their names, and every defect of names, kinds and sizes.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        If there is no such folder, or no cases in it.
    """
    if not (folder / CASES).is_dir() or (folder / CASES).is_symlink():
        got = "no folder cases" if folder.is_dir() else "a file" if folder.exists() else "no such folder"
        raise InputError(f"challenge {folder}", got=got, allowed="a folder with cases/NAME/recordings/*.nc")
    defects = _strangers(folder)
    with os.scandir(folder / CASES) as listed:
        entries = sorted(listed, key=lambda entry: entry.name)
    if not 1 <= len(entries) <= MOST_CASES:
        raise InputError(f"{folder / CASES}", got=f"{len(entries)} cases", allowed=f"1 … {MOST_CASES}")
    cases = []
    for entry in entries:
        if not _NAME.fullmatch(entry.name):
            defects.append(InputError(f"case {_shown(entry.name)}", got="this name", allowed=_ALLOWED_NAME))
        elif not entry.is_dir(follow_symlinks=False):
            got = "a link" if entry.is_symlink() else "a file"
            defects.append(InputError(f"case {entry.name}", got=got, allowed="a folder"))
        else:
            case, its_defects = _found_case(entry.name, Path(entry.path))
            cases.append(case)
            defects += its_defects
    return tuple(cases), tuple(defects)


def require_cases(folder: Path) -> tuple[ChallengeCase, ...]:
    """Cases of a challenge without a defect of names, kinds or sizes.

    Raises
    ------
    InputError
        The first defect.
    """
    cases, defects = found_cases(folder)
    if defects:
        raise defects[0]
    return cases


def _strangers(folder: Path) -> list[InputError]:
    """What lies beside the cases and is no part of a challenge: it may be a truth."""
    defects = []
    with os.scandir(folder) as listed:
        entries = sorted(listed, key=lambda entry: entry.name)
    for entry in entries:
        is_folder = entry.is_dir(follow_symlinks=False)
        known = entry.name in (COMMITMENTS, ANSWERS, *_READ_ME) and entry.is_file(follow_symlinks=False)
        known |= is_folder and (
            entry.name == CASES or re.fullmatch(r"diagnoses(_\w{1,80})?", entry.name) is not None
        )
        known |= entry.name.startswith(".sloshlab-")
        known |= entry.name == LOCKED and _begins_with(Path(entry.path), MAGIC)
        if is_folder and known and entry.name != CASES and (link := _link_below(entry.path)):
            # answers would be written through it
            defects.append(
                InputError(f"challenge {folder}: {_shown(link)}", got="a link", allowed="files and folders")
            )
        if not known:
            allowed = f"{CASES}/, {COMMITMENTS}, {ANSWERS}, {LOCKED}, README.md"
            what = f"challenge {folder}: {_shown(entry.name)}"
            defects.append(
                InputError(what, got="no part of a challenge", allowed=allowed, remedy="keep it elsewhere")
            )
    return defects


def _link_below(folder: str) -> str:
    """The first link below a folder, by its path within it; empty where there is none."""
    for place, folders, files in os.walk(folder):
        for name in sorted([*folders, *files]):
            if os.path.islink(os.path.join(place, name)):
                return os.path.relpath(os.path.join(place, name), os.path.dirname(folder))
    return ""


def _found_case(name: str, folder: Path) -> tuple[ChallengeCase, list[InputError]]:
    """A case by its directory alone; its files are not opened."""
    files: dict[str, int] = {}
    defects = []
    for prefix, place in (("", folder), (f"{RECORDINGS}/", folder / RECORDINGS)):
        if not place.is_dir() or place.is_symlink():
            continue
        with os.scandir(place) as listed:
            for number, entry in enumerate(listed):
                if number >= MOST_FILES:
                    defects.append(InputError(f"case {name}", got="too many files", allowed=f"≤ {MOST_FILES}"))
                    break
                if (trouble := _trouble(prefix, entry)) is not None:
                    what = f"case {name}: {_shown(prefix + entry.name)}"
                    allowed = f"{RIG}, {MODEL} or {TWIN}, {RECORDINGS}/NAME.nc, NAME.nc"
                    defects.append(InputError(what, got=trouble, allowed=allowed))
                elif prefix or entry.name != RECORDINGS:
                    files[prefix + entry.name] = entry.stat(follow_symlinks=False).st_size
    case = ChallengeCase(name, folder, tuple(sorted(files)))
    return case, [*sorted(defects, key=str), *_incomplete(case, files)]


def _trouble(prefix: str, entry: os.DirEntry[str]) -> str | None:
    """Why an entry of a case is none of it."""
    mode = entry.stat(follow_symlinks=False).st_mode
    if stat.S_ISLNK(mode):
        return "a link"
    if not prefix and entry.name == RECORDINGS:
        return None if stat.S_ISDIR(mode) else "a file in the place of a folder"
    if not stat.S_ISREG(mode):
        return "a folder" if stat.S_ISDIR(mode) else "no regular file"
    is_known = bool(_RECORDING.fullmatch(entry.name)) or (not prefix and entry.name in _DESCRIPTIONS)
    return None if is_known else "no file of a case"


def _incomplete(case: ChallengeCase, sizes: dict[str, int]) -> list[InputError]:
    """What a case lacks, has twice or has too large."""
    defects = []
    descriptions = [name for name in _DESCRIPTIONS if name in sizes]
    if len(descriptions) != 1:
        got = " and ".join(descriptions) or f"neither {RIG} nor {TWIN}"
        allowed = f"{RIG}, {MODEL} for a wing in flight, or {TWIN} for a twin of your own"
        defects.append(InputError(f"case {case.name}", got=got, allowed=allowed))
    if not case.recordings:
        defects.append(InputError(f"case {case.name}", got=f"no {RECORDINGS}/*.nc", allowed="at least one"))
    for name, size in sizes.items():
        most = LARGEST_TEXT_BYTES if name in _DESCRIPTIONS else LARGEST_CASE_BYTES
        if not 0 < size <= most:
            defects.append(InputError(f"case {case.name}: {name}", got=f"{size} bytes", allowed=f"1 … {most}"))
    if sum(sizes.values()) > LARGEST_CASE_BYTES >= max(sizes.values()):
        got = f"{sum(sizes.values())} bytes together"
        defects.append(InputError(f"case {case.name}", got=got, allowed=f"≤ {LARGEST_CASE_BYTES}"))
    return defects


def truths_in_reach(folder: Path, places: Sequence[Path]) -> tuple[InputError, ...]:
    """Files that look like readable truths beside a challenge and where the program is called.

    What lies within the challenge is told by `found_cases`.
    """
    found: dict[Path, InputError] = {}
    for place in (folder.resolve().parent, *places):
        for path in sorted(place.glob("*")):
            if path.resolve().parent != folder.resolve() and _holds_truths(path):
                got, remedy = f"readable truths in {path}", "keep them where nobody diagnoses"
                defect = InputError(f"challenge {folder}", got=got, allowed="none in reach", remedy=remedy)
                found.setdefault(path.resolve(), defect)
    return tuple(found.values())


_TRUTHS: Final = re.compile(
    rb'"sloshlab_truths"|^\s*hidden\s*=\s*["\']|"hidden"\s*:|^\W*case\W+hidden\b', re.MULTILINE
)


def _holds_truths(path: Path) -> bool:
    try:
        if path.suffix.lower() not in (".toml", ".json", ".csv") or not path.is_file():
            return False
        with path.open("rb") as file:
            return _TRUTHS.search(file.read(LARGEST_TEXT_BYTES)) is not None
    except OSError:
        return False


def _begins_with(path: Path, content: bytes) -> bool:
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(content)) == content


def _shown(name: str) -> str:
    """A foreign name as ASCII, cut, that no terminal and no page obeys."""
    return ascii(name)[:80]
