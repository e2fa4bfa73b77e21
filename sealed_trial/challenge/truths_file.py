"""Files of truths: TOML, JSON or CSV written by hand, and the one that `trial commit` keeps for their owner."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sealed_trial.challenge.challenge_folder import MOST_CASES, NAME_PATTERN
from sealed_trial.challenge.stated_truth import StatedTruth, stated_truth
from sealed_trial.sealing.locked_truths import MAGIC, opened
from sloshlab.errors import InputError
from sloshlab.toml_file import read_toml

FORMAT: Final = "sloshlab_truths"
"""Key of the file that `trial commit` writes; its value is the version."""
_LARGEST_BYTES: Final = 8_000_000
_NAME: Final = re.compile(NAME_PATTERN, re.ASCII)
_SALT: Final = re.compile(r"[0-9a-f]{64}", re.ASCII)
_COLUMNS: Final = (
    "case",
    "hidden",
    "block",
    "effect",
    "parameter",
    "value",
    "units",
    "equals",
    "strength",
    "note",
)


@dataclass(frozen=True)
class KeptTruth:
    """A truth as its owner keeps it.

    Attributes
    ----------
    truth : StatedTruth
    salt : bytes
        Empty where none was drawn: the truth was written by hand.
    """

    truth: StatedTruth
    salt: bytes = b""


def read_truths(path: Path, key: bytes | None = None) -> dict[str, KeptTruth]:
    """Truths by case.

    Parameters
    ----------
    path : Path
        TOML, JSON or CSV by its ending, or what `trial commit` wrote, locked or not.
    key : bytes, optional
        Opens a locked file.

    Raises
    ------
    InputError
        If the file is none of these, too large, locked by another key, or a truth in it is impossible.
    """
    what = f"truths {path}"
    head = _content(path, what, len(MAGIC))
    if head == MAGIC:
        if key is None:
            raise InputError(what, got="locked truths and no key", allowed="--key FILE, by which they were locked")
        return _kept(opened(path, key), what)
    if key is not None:
        raise InputError(what, got="a key for truths that are not locked", allowed="no --key, or locked truths")
    if path.suffix == ".toml":
        return _by_case(read_toml(path, what), what)
    if path.suffix == ".csv":
        return _by_case(_of_table(_text(path, what), what), what)
    if path.suffix == ".json":
        given = _parsed(_text(path, what), what)
        return _kept(given, what) if FORMAT in given else _by_case(given, what)
    raise InputError(
        what, got=f"the ending {ascii(path.suffix)[:20]}", allowed=".toml, .json, .csv, or locked truths"
    )


def kept_document(truths: Mapping[str, KeptTruth]) -> dict[str, Any]:
    """What `trial commit` writes for their owner."""
    cases = {
        case: {"salt": kept.salt.hex(), "truth": kept.truth.model_dump(mode="json")}
        for case, kept in truths.items()
    }
    return {FORMAT: 1, "cases": cases}


def _content(path: Path, what: str, most: int) -> bytes:
    """At most so many bytes of a file."""
    try:
        if not path.is_file():
            raise InputError(what, got="a folder" if path.is_dir() else "no such file", allowed="a file of truths")
        with path.open("rb") as file:
            return file.read(most)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise InputError(
            what, got=getattr(error, "strerror", None) or str(error), allowed="a readable file"
        ) from error


def _text(path: Path, what: str) -> str:
    content = _content(path, what, _LARGEST_BYTES + 1)
    if len(content) > _LARGEST_BYTES:
        raise InputError(what, got=f"{os.path.getsize(path)} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(what, got="bytes that are not UTF-8 text", allowed="text") from error


def _parsed(text: str, what: str) -> dict[str, Any]:
    try:
        given = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(what, got=f"text that is not JSON ({error})"[:200], allowed="JSON") from error
    if not isinstance(given, dict):
        raise InputError(what, got=type(given).__name__, allowed="an object with a truth for every case")
    return given


def _kept(given: Mapping[str, Any], what: str) -> dict[str, KeptTruth]:
    if given.get(FORMAT) != 1 or not isinstance(given.get("cases"), dict):
        allowed = "the file that `sloshlab trial commit` wrote, version 1"
        raise InputError(what, got="something else", allowed=allowed)
    found = {}
    for case, entry in _named(given["cases"], what).items():
        place = f"{what}: {case}"
        if not isinstance(entry, dict) or entry.keys() != {"salt", "truth"}:
            raise InputError(place, got="something else", allowed="salt and truth")
        if not isinstance(entry["salt"], str) or not _SALT.fullmatch(entry["salt"]):
            raise InputError(f"{place}: salt", got=repr(entry["salt"])[:80], allowed="64 hexadecimal digits")
        found[case] = KeptTruth(stated_truth(entry["truth"], place), bytes.fromhex(entry["salt"]))
    return found


def _by_case(given: Mapping[str, Any], what: str) -> dict[str, KeptTruth]:
    return {case: KeptTruth(stated_truth(truth, f"{what}: {case}")) for case, truth in _named(given, what).items()}


def _named(given: Mapping[str, Any], what: str) -> Mapping[str, Any]:
    if not 1 <= len(given) <= MOST_CASES:
        raise InputError(what, got=f"{len(given)} cases", allowed=f"1 … {MOST_CASES}")
    for case in given:
        if not _NAME.fullmatch(case):
            raise InputError(f"{what}: case {ascii(case)[:80]}", got="this name", allowed="the name of a case")
    return given


def _of_table(text: str, what: str) -> dict[str, Any]:
    """Rows of a CSV table as the tables of a TOML file: a row for every parameter, or one for a case without."""
    try:
        reader = csv.DictReader(io.StringIO(text), strict=True)
        head = [name.strip() for name in reader.fieldnames or ()]
        reader.fieldnames = head
        rows = list(reader)
    except csv.Error as error:
        raise InputError(what, got=f"text that is not CSV ({error})", allowed="a table with commas") from error
    strange = [name for name in head if name not in _COLUMNS]
    if strange or not {"case", "hidden"} <= set(head) or len(set(head)) < len(head):
        got = f"the columns {ascii(', '.join(head))[:120]}"
        raise InputError(what, got=got, allowed=f"case, hidden, and once each of {', '.join(_COLUMNS[2:])}")
    cases: dict[str, Any] = {}
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise InputError(f"{what}: row {number}", got="another number of cells", allowed=f"{len(head)}")
        cells = {name: value.strip() for name, value in row.items() if value.strip()}
        _add_row(cases, cells, f"{what}: row {number}")
    return cases


def _add_row(cases: dict[str, Any], cells: dict[str, str], place: str) -> None:
    if not {"case", "hidden"} <= cells.keys():
        raise InputError(place, got="no case or no hidden", allowed="both in every row")
    truth = cases.setdefault(cells["case"], {"hidden": cells["hidden"], "effects": []})
    if truth["hidden"] != cells["hidden"]:
        raise InputError(place, got=f"{cells['case']} {cells['hidden']}", allowed=f"{truth['hidden']}, as above")
    if "note" in cells:
        truth["note"] = cells["note"]
    if "equals" in cells:
        truth["equals"] = [[name.strip() for name in part.split("+")] for part in cells["equals"].split("|")]
    if "block" not in cells:
        strange = sorted(cells.keys() & {"effect", "parameter", "value", "units", "strength"})
        if strange:
            raise InputError(place, got=f"{strange[0]} without a block", allowed="block in the same row")
        return
    named = {"block": cells["block"], **({"name": cells["effect"]} if "effect" in cells else {})}
    effect = next((each for each in truth["effects"] if named.items() <= each.items()), None)
    if effect is None:
        effect = {**named, "parameters": {}}
        truth["effects"].append(effect)
    if "strength" in cells:
        effect["strength"] = _number(cells["strength"], f"{place}: strength")
    if ("parameter" in cells) != ("value" in cells):
        raise InputError(place, got="a parameter without a value, or the other way round", allowed="both")
    if "parameter" in cells:
        number = _number(cells["value"], f"{place}: value")
        effect["parameters"][cells["parameter"]] = f"{number!r} {cells['units']}" if "units" in cells else number


def _number(text: str, what: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(what, got=ascii(text)[:80], allowed="a number") from None
