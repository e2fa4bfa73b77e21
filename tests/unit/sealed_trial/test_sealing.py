"""Commitments that nobody can change, truths that nobody can read, a key that nobody leaves about."""

from __future__ import annotations

import hashlib
import json

import pytest
from hand_made_trials import KEY, effect, truth, written_trial

from sealed_trial.sealing.commitment import commitment
from sealed_trial.sealing.key import made_or_read_key, read_key
from sealed_trial.sealing.trial_folder import (
    COMMITMENTS,
    LOCKED,
    READABLE,
    check_data,
    entropy,
    opened_truths,
    read_commitments,
    seal,
)
from sloshlab.errors import InputError

TRUTHS = [
    truth("case_001", "nothing", accepted=[[]]),
    truth("case_002", "single", effect("coulomb_friction", force_n=0.37)),
]


def test_a_commitment_is_the_hash_of_salt_and_truth() -> None:
    expected = hashlib.sha256(b"salt" + b'{"force_n":0.37,"name":"coulomb_friction"}').hexdigest()
    assert commitment(b"salt", {"name": "coulomb_friction", "force_n": 0.37}) == expected


def test_sealed_truths_come_back_and_are_not_on_disk_in_plain(tmp_path) -> None:
    pytest.importorskip("cryptography")
    trial = tmp_path / "trial"
    written_trial(trial, TRUTHS, KEY)
    opened = opened_truths(trial, read_commitments(trial), KEY)
    assert opened["case_002"]["effects"][0]["parameters"] == {"force_n": 0.37}
    assert not (trial / READABLE).exists()
    for path in trial.rglob("*"):
        if path.is_file():
            assert b"coulomb" not in path.read_bytes()
            assert KEY not in path.read_bytes()
            assert KEY.hex().encode() not in path.read_bytes()


def test_another_key_or_a_changed_byte_opens_nothing(tmp_path) -> None:
    pytest.importorskip("cryptography")
    trial = tmp_path / "trial"
    written_trial(trial, TRUTHS, KEY)
    with pytest.raises(InputError, match="this key does not open"):
        opened_truths(trial, read_commitments(trial), bytes(32))
    content = bytearray((trial / LOCKED).read_bytes())
    content[-1] ^= 1
    (trial / LOCKED).write_bytes(content)
    with pytest.raises(InputError, match="this key does not open"):
        opened_truths(trial, read_commitments(trial), KEY)
    with pytest.raises(InputError, match="no key"):
        opened_truths(trial, read_commitments(trial), None)


def test_a_truth_changed_after_sealing_is_noticed(tmp_path) -> None:
    written_trial(tmp_path, TRUTHS, None)
    kept = json.loads((tmp_path / READABLE).read_text())
    kept["case_002"]["truth"]["effects"][0]["parameters"]["force_n"] = 0.38
    (tmp_path / READABLE).write_text(json.dumps(kept))
    with pytest.raises(InputError, match=r"case_002: truth: got not the one committed to"):
        opened_truths(tmp_path, read_commitments(tmp_path), None)


def test_truths_of_two_cases_cannot_be_exchanged(tmp_path) -> None:
    written_trial(tmp_path, TRUTHS, None)
    kept = json.loads((tmp_path / READABLE).read_text())
    kept["case_001"], kept["case_002"] = kept["case_002"], kept["case_001"]
    (tmp_path / READABLE).write_text(json.dumps(kept))
    with pytest.raises(InputError, match="not the one committed to"):
        opened_truths(tmp_path, read_commitments(tmp_path), None)


@pytest.mark.parametrize("tampering", ["changed", "added", "removed"])
def test_data_that_are_not_those_published_are_refused(tmp_path, tampering: str) -> None:
    commitments = written_trial(tmp_path, TRUTHS, None)
    recording = tmp_path / "cases" / "case_001" / "recordings" / "run_01.nc"
    check_data(tmp_path, commitments.cases[0])
    if tampering == "changed":
        recording.write_text("other samples")
    elif tampering == "added":
        (recording.parent / "hint.txt").write_text("friction")
    else:
        recording.unlink()
    with pytest.raises(InputError, match="case_001: recordings/"):
        check_data(tmp_path, commitments.cases[0])
    check_data(tmp_path, commitments.cases[1])


def test_a_key_is_made_once_outside_the_trial_for_its_owner_only(tmp_path) -> None:
    trial, place = tmp_path / "trial", tmp_path / "kept" / "key"
    key = made_or_read_key(place, trial)
    assert place.stat().st_mode & 0o777 == 0o600
    assert made_or_read_key(place, trial) == key == read_key(place)
    assert len(key) == 32
    with pytest.raises(InputError, match="outside the trial"):
        made_or_read_key(trial / "deep" / "key", trial)
    assert not trial.exists()
    place.chmod(0o644)
    with pytest.raises(InputError, match="mode 644"):
        read_key(place)


def test_development_and_sealed_trials_share_no_seed() -> None:
    # even if the key were empty: the purpose alone keeps them apart
    sealed = {tuple(entropy("sealed", seed, b"")) for seed in range(200)}
    development = {tuple(entropy("development", seed, b"")) for seed in range(200)}
    assert len(sealed | development) == 400
    # nobody draws a sealed trial again from its published seed
    assert entropy("sealed", 3, KEY) != entropy("sealed", 3, bytes(32))


def test_a_folder_in_use_is_refused(tmp_path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="a folder with files in it"):
        seal(tmp_path, seed=0, n_cases=6, key=None)
    with pytest.raises(InputError, match="--cases"):
        seal(tmp_path / "new", seed=0, n_cases=5, key=None)
    (tmp_path / COMMITMENTS).write_text("{}")
    with pytest.raises(InputError, match="untouched"):
        read_commitments(tmp_path)
