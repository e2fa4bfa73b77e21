"""Truths that cannot be changed after the answers, and answers that cannot be changed after the truths."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import pytest
from hand_made_challenges import TRUTHS, verdict, written_challenge

from sealed_trial.challenge.challenge_commitments import (
    commitment_defects,
    commitment_of,
    committed,
    matches,
    read_challenge_commitments,
)
from sealed_trial.challenge.challenge_folder import require_cases
from sealed_trial.challenge.frozen_answers import freeze, require_frozen
from sealed_trial.challenge.stated_truth import StatedTruth
from sealed_trial.challenge.truths_file import KeptTruth, read_truths
from sealed_trial.running import Outcome
from sloshlab.errors import InputError


@pytest.fixture
def challenge(tmp_path) -> Path:
    return written_challenge(tmp_path / "c")


def truths(folder: Path) -> dict[str, StatedTruth]:
    (folder / "t.toml").write_text(TRUTHS)
    return {case: kept.truth for case, kept in read_truths(folder / "t.toml").items()}


def test_a_commitment_can_be_computed_by_anybody_from_salt_and_truth() -> None:
    kept = KeptTruth(StatedTruth(hidden="nothing"), b"s" * 32)
    text = '{"case":"quiet","effects":[],"equals":[],"hidden":"nothing","note":""}'
    assert commitment_of("quiet", kept) == hashlib.sha256(b"s" * 32 + text.encode()).hexdigest()


def test_truths_are_committed_to_with_salts_and_files_of_their_own(challenge, tmp_path) -> None:
    cases = require_cases(challenge)
    commitments, kept = committed(cases, truths(tmp_path))
    again, other = committed(cases, truths(tmp_path))
    # the truth is in no file that is published, and equal truths have unequal commitments
    assert "cubic" not in commitments.model_dump_json()
    assert kept["quiet"].salt != kept["cart"].salt != other["cart"].salt
    assert commitments.cases[0].commitment != again.cases[0].commitment
    (challenge / "commitments.json").write_text(commitments.model_dump_json())
    read = read_challenge_commitments(challenge)
    assert read == commitments
    assert commitment_defects(cases, read) == ()
    assert all(matches(case, each, commitments) for case, each in kept.items())
    assert not matches("quiet", KeptTruth(kept["cart"].truth, kept["quiet"].salt), commitments)
    assert not matches("quiet", other["quiet"], commitments)
    assert not matches("cart", kept["quiet"], commitments)
    assert not matches("none", kept["quiet"], commitments)


def test_every_case_has_a_truth_and_every_truth_a_case(challenge, tmp_path) -> None:
    cases, known = require_cases(challenge), truths(tmp_path)
    with pytest.raises(InputError, match="case quiet: got no truth"):
        committed(cases, {"cart": known["cart"]})
    with pytest.raises(InputError, match="truth of third: got no such case"):
        committed(cases, {**known, "third": known["cart"]})


def test_files_that_are_not_those_committed_to_are_told(challenge, tmp_path) -> None:
    commitments, _ = committed(require_cases(challenge), truths(tmp_path))
    (challenge / "cases" / "quiet" / "rig.toml").write_text("[tank]\n")
    (challenge / "cases" / "cart" / "more.nc").write_text("more")
    defects = commitment_defects(require_cases(challenge), commitments)
    assert [str(defect).partition(";")[0] for defect in defects] == [
        "case cart: more.nc: got a file that was changed, added or taken away",
        "case quiet: rig.toml: got a file that was changed, added or taken away",
    ]
    (challenge / "cases" / "quiet").rename(challenge / "cases" / "loud")
    said = [str(defect) for defect in commitment_defects(require_cases(challenge), commitments)]
    assert said[0].startswith("case loud: got no commitment")
    assert said[1].startswith("case quiet: got no such case")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.update(format=2), "format"),
        (lambda d: d.update(cases=[]), "cases"),
        (lambda d: d["cases"][0].update(case="../../etc"), "cases.0.case"),
        (lambda d: d["cases"][0].update(commitment="0"), "cases.0.commitment"),
        (lambda d: d["cases"].append(d["cases"][0]), "cases: got a case twice"),
        (lambda d: d.update(extra=1), "extra"),
    ],
)
def test_commitments_that_are_none_are_refused(challenge, tmp_path, change, said: str) -> None:
    commitments, _ = committed(require_cases(challenge), truths(tmp_path))
    document = json.loads(commitments.model_dump_json())
    change(document)
    (challenge / "commitments.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="trial commit") as caught:
        read_challenge_commitments(challenge)
    assert f"commitments.json: {said}" in str(caught.value)


def answered(folder: Path) -> None:
    for case in ("quiet", "cart"):
        place = folder / "diagnoses" / case
        place.mkdir(parents=True)
        (place / "verdict.json").write_text(json.dumps(verdict("nothing_missing")))
        (place / "outcome.json").write_text(json.dumps(asdict(Outcome(case, "done", 0, 1.0, 1.0, 10.0, ""))))


def test_answers_are_frozen_once_and_their_digest_is_that_of_the_file(challenge) -> None:
    cases = require_cases(challenge)
    with pytest.raises(InputError, match="not diagnosed"):
        freeze(challenge, cases, "p")
    answered(challenge)
    with pytest.raises(InputError, match="no frozen answers"):
        require_frozen(challenge, cases)
    answers = freeze(challenge, cases, "p")
    document = json.loads((challenge / "answers.json").read_text())
    digest = document.pop("digest")
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    assert digest == hashlib.sha256(text.encode()).hexdigest() == answers.digest
    content = (challenge / "diagnoses" / "quiet" / "verdict.json").read_bytes()
    assert document["cases"]["quiet"]["verdict"] == hashlib.sha256(content).hexdigest()
    # by another program the same answers are the same answers
    assert freeze(challenge, cases, "another") == answers


@pytest.mark.parametrize(
    ("file", "content", "said"),
    [
        ("diagnoses/quiet/verdict.json", "{}", "case quiet: got a case or an answer that was changed"),
        ("diagnoses/cart/outcome.json", "{}", "case cart: got a case or an answer that was changed"),
        ("cases/quiet/rig.toml", "[tank]\n", "case quiet: got a case or an answer that was changed"),
        ("commitments.json", "{}", "commitments.json: got another file than when the answers were given"),
        ("answers.json", "[]", "answers.json: got something else"),
        ("answers.json", "[" * 100_000, "answers.json: got something else"),
    ],
)
def test_nothing_can_be_changed_after_the_freeze(challenge, file: str, content: str, said: str) -> None:
    answered(challenge)
    freeze(challenge, require_cases(challenge), "p")
    (challenge / file).write_text(content)
    for refused in (require_frozen, lambda folder, cases: freeze(folder, cases, "p")):
        with pytest.raises(InputError) as caught:
            refused(challenge, require_cases(challenge))
        assert said in str(caught.value)


def test_a_digest_of_other_answers_is_noticed(challenge) -> None:
    answered(challenge)
    freeze(challenge, require_cases(challenge), "p")
    document = json.loads((challenge / "answers.json").read_text())
    document["program"] = "another"
    (challenge / "answers.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="digest: got that of other answers"):
        require_frozen(challenge, require_cases(challenge))
