"""Every fault of the simulated devices, on every transport, in three intensities, and what becomes of the samples.

``python -m tests.devices.fault_matrix`` in the root of the repository plays and records all cases and
writes the tables of ``docs/fault_matrix.md``.
"""

from __future__ import annotations

import contextlib
import io
import json
import socket
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cantools
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # where the modules beside this one are looked for

from independent_host import playing
from matrix_cases import FAULTS, SAMPLES_PER_FRAME, SEED, TRANSPORTS, Case, Intensity, Transport, cases
from matrix_recordings import NAMES, RATE_HZ, RIG, Motion, Pattern, write_truth
from matrix_verdict import Recorded, Verdict, verdict

from pipelines.command_line import run as sloshlab


@dataclass(frozen=True)
class Outcome:
    """A case that was played and recorded."""

    case: Case
    verdict: Verdict
    recorded: Recorded
    exit_code: int


def played_and_recorded(case: Case, folder: Path) -> Outcome:
    """Play a device with the fault, record it with the command line, judge the file."""
    n_samples = case.transport.n_samples
    truth = case.intensity.signal(n_samples)
    write_truth(folder / "truth.nc", truth, case.intensity.ranges)
    (folder / "rig.toml").write_text(RIG)
    toml = case.intensity.toml
    toml = (toml if isinstance(toml, str) else toml[case.transport.kind]).replace("{last}", str(n_samples - 1))
    (folder / "faults.toml").write_text(toml)
    url = case.transport.url.format(folder=folder, port=_free_port())
    settings = {"samples_per_frame": SAMPLES_PER_FRAME} if case.transport.kind == "serial" else {}
    with playing(
        folder / "truth.nc",
        url,
        faults=[folder / "faults.toml"],
        truth=folder / "device.json",
        speed=case.intensity.speed,
        seed=SEED,
        **settings,
    ) as ((ready,), _):
        exit_code, summary = _recorded(ready, folder, "shaker_sweep" if isinstance(truth, Motion) else "other")
    (device,) = json.loads((folder / "device.json").read_text()).values()
    expected, tolerance = _expected(truth, toml)
    recorded = Recorded(
        folder / "run.nc",
        summary,
        device,
        _bases(toml),
        _groups(case.transport, folder),
        expected,
        tolerance,
        case.intensity.told,
    )
    return Outcome(case, verdict(recorded), recorded, exit_code)


def _recorded(url: str, folder: Path, experiment: str) -> tuple[int, dict]:
    said, complained = io.StringIO(), io.StringIO()
    arguments = [
        "record",
        "--source",
        url,
        "--rig",
        str(folder / "rig.toml"),
        "-o",
        str(folder / "run.nc"),
        "--json",
    ]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        exit_code = sloshlab([*arguments, "--attribute", f"experiment={experiment}"])
    if exit_code not in (0, 3):
        raise AssertionError(f"exit code {exit_code}: {complained.getvalue()}")
    return exit_code, json.loads(said.getvalue().splitlines()[-1])


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def _groups(transport: Transport, folder: Path) -> list[list[str]]:
    """Channels by frame, as another reader of DBC files has them."""
    if transport.kind == "serial":
        return [list(NAMES)]
    database = cantools.database.load_file(folder / "d.dbc", strict=False)
    messages = sorted(database.messages, key=lambda message: message.frame_id)
    groups = [{signal.name.partition("__")[0] for signal in message.signals} & set(NAMES) for message in messages]
    return [sorted(group) for group in groups if group]


def _bases(toml: str) -> list[int]:
    """Counter of the truth's sample 0 in each stream that the device counts."""
    table = tomllib.loads(toml)
    bases = [table.get("clock", {}).get("counter_start", 0)]
    for fault in table.get("disconnect", []):
        if fault["restart"]:
            bases.append(-int(np.ceil((fault["at_s"] + fault["for_s"]) * RATE_HZ - 1e-6)))
    return bases


def _expected(truth: Pattern | Motion, toml: str) -> tuple[np.ndarray, np.ndarray]:
    """Counts and how far off they may be, for a clock that is offset by o, drifts by d and jitters by σ.

    Sample k is taken at o + k/(f (1 + d)), give or take 6 σ.
    """
    clock = tomllib.loads(toml).get("clock", {})
    rate_hz = RATE_HZ * (1 + 1e-6 * clock.get("drift_ppm", 0.0))
    offset_s, jitter_s = clock.get("offset_s", 0.0), clock.get("jitter_s", 0.0)
    n_taken = int(np.floor(((truth.n_samples - 1) / RATE_HZ - offset_s) * rate_hz + 1e-6)) + 1
    places = (offset_s + np.arange(n_taken) / rate_hz) * RATE_HZ
    expected = truth.counts(places if isinstance(truth, Motion) else np.arange(truth.n_samples))
    tolerance = np.zeros(expected.shape)
    if isinstance(truth, Motion) and clock:
        tolerance += truth.tolerance() + 6 * jitter_s * truth.steepest()
    return expected, tolerance


LOSSES = ("drop", "corrupt", "overrun", "disconnect", "restart")
STRUCK = {
    "restart": "disconnect",
    "stuck sensor": "stuck",
    "clipped sensor": "clipped",
    "swapped sensors": "swapped",
}


def problems(outcome: Outcome) -> list[str]:
    """What is not as it must be, whatever the fault; empty if all is well."""
    case, found, device = outcome.case, outcome.verdict, outcome.recorded.device
    is_seen = not case.intensity.unseen
    may_lose = case.fault in LOSSES or "drop" in device
    is_flagged = bool(found.n_lost or found.n_flagged or _has_error_frames(case))
    most_given_up = found.n_readings * (case.intensity.most_given_up if case.transport.kind == "can" else 0)
    struck = STRUCK.get(case.fault, case.fault)
    wrong = {
        "some readings are silently wrong": is_seen and found.n_wrong > 0,
        "nothing can tell, it was said": not is_seen and found.n_wrong == 0,
        "some readings are invented": found.n_invented > 0,
        "some readings have no verdict": found.n_readings
        != found.n_right + found.n_lost + found.n_flagged + found.n_wrong,
        "some readings are lost without cause": found.n_lost > 0 and not may_lose,
        "too many readings that were sent are lost": found.n_given_up > most_given_up,
        "the fault did not strike": not struck.startswith(("none", "clock", "counter")) and not device.get(struck),
        f"exit code {outcome.exit_code}": outcome.exit_code != (3 if found.flags else 0),
        f"flags {found.flags}": bool(found.flags) != is_flagged,
    }
    return [*(text for text, is_so in wrong.items() if is_so), *found.complaints]


def _has_error_frames(case: Case) -> bool:
    """Whether garbage is also an error of the bus; slcan has no frames for those."""
    return case.fault == "garbage" and case.transport.name in ("socketcand", "udp_multicast")


PAGE = Path("docs/fault_matrix.md")
BEGIN, END = "<!-- tables of python -m tests.devices.fault_matrix -->\n", "<!-- end of the tables -->\n"
PARTS = {
    "Frames": ("none", "drop", "duplicate", "reorder", "corrupt", "garbage"),
    "Lines": ("overrun", "disconnect", "restart"),
    "Clocks and counters": ("clock offset", "clock drift", "clock jitter", "counter wrap"),
    "Sensors": ("stuck sensor", "clipped sensor", "swapped sensors"),
}


COLUMNS = ("fault", "transports", "readings", "right", "flagged", "given up", "silently wrong")


def tables(outcomes: Mapping[str, Outcome | None]) -> str:
    """The matrix in Markdown; None is a case that does not exist. Transports with the same outcome share a row."""
    text = ""
    for part, faults in PARTS.items():
        notes: list[str] = []
        text += f"\n## {part}\n\n| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|\n"
        for fault in faults:
            text += f"| **{fault}** {'| ' * (len(COLUMNS) - 1)}|\n" if fault != "none" else ""
            for intensity in FAULTS[fault]:
                title = _title(fault, intensity, notes)
                for numbers, names in _alike(fault, intensity, outcomes).items():
                    text += f"| {title} | {_together(names)} | {numbers} |\n"
                    title = ""
        text += "".join(f"\n({number}) {note}.\n" for number, note in enumerate(notes, start=1))
    return text + "\n"


def _alike(fault: str, intensity: Intensity, outcomes: Mapping[str, Outcome | None]) -> dict[str, list[str]]:
    """Names of the transports by what became of the readings."""
    alike: dict[str, list[str]] = {}
    for transport in TRANSPORTS.values():
        numbers = _numbers(outcomes[Case(fault, intensity, transport).name])
        alike.setdefault(numbers, []).append(transport.name)
    return alike


def _together(names: Sequence[str]) -> str:
    others = TRANSPORTS.keys() - set(names)
    if len(others) < 2:
        return "all" + "".join(f" but {name}" for name in others)
    return ", ".join(name.removesuffix(" over slcan") for name in names)


def _title(fault: str, intensity: Intensity, notes: list[str]) -> str:
    title = intensity.label if intensity.label != "–" else f"**{fault}**"
    why = [f"Cannot be seen: {intensity.unseen}"] if intensity.unseen else []
    why += [f"Not on CAN: {reason}" for reason in dict.fromkeys(intensity.not_on.values())]
    for note in why:
        if note not in notes:
            notes.append(note)
        title += f" ({notes.index(note) + 1})"
    return title


def _numbers(outcome: Outcome | None) -> str:
    if outcome is None:
        return " | ".join("–" * (len(COLUMNS) - 2))
    found = outcome.verdict
    wrong = f"**{found.n_wrong}**" if found.n_wrong else "0"
    fates = (found.n_readings, found.n_right, found.n_lost + found.n_flagged, found.n_given_up, wrong)
    return " | ".join(str(number) for number in fates)


def main() -> int:
    """Play and record everything, say what is wrong, write the page."""
    outcomes: dict[str, Outcome | None] = {}
    bad = 0
    for case in cases():
        outcomes[case.name] = None
        if case.exists:
            with tempfile.TemporaryDirectory() as folder:
                outcome = outcomes[case.name] = played_and_recorded(case, Path(folder))
            wrong = problems(outcome)
            bad += bool(wrong)
            print(f"{case.name}: {'; '.join(wrong) or 'ok'}", flush=True)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(before + BEGIN + tables(outcomes) + END + after, encoding="utf-8")
    n_played = sum(outcome is not None for outcome in outcomes.values())
    print(f"{n_played} cases, {bad} with problems")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
