"""Cases run in processes of their own: crashes and time-outs are outcomes, what is done stays done."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hand_made_trials import KEY, stand_in, truth, written_trial

from sealed_trial.running import DIAGNOSES, OUTCOME, require_no_key, run_trial
from sealed_trial.sealing.key import made_or_read_key
from sealed_trial.sealing.selection import Selection
from sealed_trial.sealing.trial_folder import READABLE
from sloshlab.errors import InputError

pytestmark = pytest.mark.usefixtures("programs_are_forks")

FOUR = [truth(f"case_00{k}", "nothing", accepted=[[]]) for k in (1, 2, 3, 4)]


@pytest.mark.slow
def test_every_end_of_a_case_is_an_outcome_and_nothing_is_done_twice(tmp_path) -> None:
    trial = tmp_path / "trial"
    written_trial(trial, FOUR, None)
    told = []
    command = stand_in(tmp_path)
    # long enough for a start of Python on a busy machine, shorter than the minute of case 3
    outcomes = run_trial(trial, n_workers=2, time_limit_s=20.0, command=command, finished=told.append)
    assert [outcome.status for outcome in outcomes] == ["done", "crashed", "timed_out", "done"]
    assert outcomes[1].exit_code == 1
    assert outcomes[1].last_words == "no way through"
    assert outcomes[2].exit_code == -9
    assert sorted(outcome.case for outcome in told) == [its_truth.case for its_truth in FOUR]
    (trial / DIAGNOSES / "case_004" / OUTCOME).unlink()  # as if it had been stopped before its end
    told.clear()
    again = run_trial(trial, n_workers=1, time_limit_s=20.0, command=command, finished=told.append)
    assert [outcome.case for outcome in told] == ["case_004"]
    assert again[:3] == outcomes[:3]
    calls = [(trial / DIAGNOSES / its_truth.case / "calls.txt").read_text().count("called") for its_truth in FOUR]
    assert calls == [1, 1, 1, 2]


def test_data_that_were_touched_are_not_diagnosed(tmp_path) -> None:
    written_trial(tmp_path, FOUR, None)
    (tmp_path / "cases" / "case_003" / "rig.toml").write_text("[tank]\nhint = 1\n")
    with pytest.raises(InputError, match=r"case_003: rig\.toml"):
        run_trial(tmp_path, n_workers=1, time_limit_s=1.0, command=("false",))
    assert not (tmp_path / DIAGNOSES).exists()


def test_a_sealed_trial_with_readable_truths_is_refused(tmp_path) -> None:
    pytest.importorskip("cryptography")
    written_trial(tmp_path, FOUR, KEY)
    (tmp_path / READABLE).write_text(json.dumps({}))
    with pytest.raises(InputError, match="readable truths"):
        run_trial(tmp_path, n_workers=1, time_limit_s=1.0, command=("false",))


@pytest.mark.parametrize("place", ["argument", "environment", "named by environment", "beside", "within"])
def test_a_key_in_reach_is_refused(tmp_path, monkeypatch, place: str) -> None:
    trial, elsewhere = tmp_path / "trials" / "trial", tmp_path / "elsewhere"
    trial.mkdir(parents=True)
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    made = made_or_read_key(tmp_path / "safe" / "key", trial)
    require_no_key(trial, ["sloshlab", "trial", "run", str(trial)], {"HOME": str(tmp_path)})
    line = (tmp_path / "safe" / "key").read_text()
    arguments, environment = ["sloshlab"], {}
    if place == "argument":
        arguments.append(str(tmp_path / "safe" / "key"))
    elif place == "environment":
        environment["SECRET"] = line.strip()
    elif place == "named by environment":
        environment["KEYS"] = f"nothing:{tmp_path / 'safe' / 'key'}"
    else:
        folder = trial if place == "within" else trial.parent
        (folder / "forgotten.txt").write_text(line)
    with pytest.raises(InputError, match="no key in reach"):
        require_no_key(trial, arguments, environment)
    assert made.hex() in line


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="the system does not tell")
def test_memory_is_that_of_a_process_and_its_copy_with_what_they_share_once(tmp_path) -> None:
    """100 MiB in both, 150 MiB more in the copy; Python itself takes less than 40."""
    trial, script = tmp_path / "trial", tmp_path / "forks.py"
    written_trial(trial, FOUR[:1], None)
    script.write_text(
        "import os, sys, time, pathlib\n"
        "shared = bytearray(os.urandom(1)) * (100 * 2**20)\n"
        "copy = os.fork()\n"
        "if not copy:\n"
        "    own = bytearray(os.urandom(1)) * (150 * 2**20)\n"
        "    time.sleep(1.5)\n"
        "    os._exit(0)\n"
        "os.waitpid(copy, 0)\n"
        "pathlib.Path(sys.argv[-1], 'verdict.json').write_text('{}')\n"
    )
    [outcome] = run_trial(trial, n_workers=1, time_limit_s=60.0, command=(sys.executable, str(script)))
    assert outcome.status == "done"
    assert 250.0 < outcome.memory_mib < 330.0


def test_a_half_is_run_and_moved_recordings_are_answered_elsewhere(tmp_path) -> None:
    """The stand-in copies what it is given: odd cases as they are, the third a millionth away."""
    trial, script = tmp_path / "trial", tmp_path / "copies.py"
    written_trial(trial, FOUR, None)
    script.write_text(
        "import pathlib, shutil, sys\n"
        "case, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])\n"
        "shutil.copytree(case, output / 'seen')\n"
        "(output / 'verdict.json').write_text('{}')\n"
    )
    command = (sys.executable, str(script))
    outcomes = run_trial(trial, n_workers=2, time_limit_s=60.0, command=command, chosen=Selection("odd"))
    assert [outcome.case for outcome in outcomes] == ["case_001", "case_003"]
    assert sorted(path.name for path in (trial / DIAGNOSES).iterdir()) == ["case_001", "case_003"]
    run_trial(
        trial,
        n_workers=1,
        time_limit_s=60.0,
        command=command,
        chosen=Selection("odd", ("case_003",)),
        diagnoses="diagnoses_again",
        perturbation=7,
    )
    assert [path.name for path in (trial / "diagnoses_again").iterdir()] == ["case_003"]
    recording = Path("case_003", "seen", "recordings", "run_01.nc")
    plain, moved = (
        xr.open_dataset(trial / place / recording).load().force_tank for place in (DIAGNOSES, "diagnoses_again")
    )
    distance = np.sqrt(np.mean((moved - plain) ** 2) / np.mean(plain**2))
    assert 5e-7 < distance < 2e-6
    # the published recordings are what they were
    run_trial(trial, n_workers=1, time_limit_s=60.0, command=("false",), chosen=Selection("odd"))
