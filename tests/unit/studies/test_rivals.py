"""Answers of the rivals: their marks by the rules of the trial, and what they learn from development cases."""

from __future__ import annotations

import json
import math
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hand_made_trials import KEY, effect, truth, written_trial

from sealed_trial.running import Outcome
from sealed_trial.scoring.answer import answer_of
from sealed_trial.scoring.mark import marked
from sloshlab.errors import InputError
from studies.rivals import said
from studies.rivals.__main__ import main
from studies.rivals.learnt_classifiers import LearntClassifier, Neighbours, forest, neighbours, of_signals
from studies.rivals.plain_rules import RemainingError, always_nothing
from studies.rivals.regressed_models import ChosenTerm, RegressedModel
from studies.rivals.seen import Seen, looked_at, seen_cases
from studies.rivals.sparse_regression import SparseRegression
from studies.rivals.training import Known, opened, require_apart

CUBIC = effect("cubic_stiffness")
CROSS_TALK = effect("cross_talk", "sensor")


def _known(kind: str, *effects: dict[str, Any], **seen: Any) -> Known:
    accepted = seen.pop("accepted", None)
    return Known(Seen("case_001", **seen), asdict(truth("case_001", kind, *effects, accepted=accepted)))


@pytest.mark.parametrize(
    ("case", "verdict", "column"),
    [
        (_known("nothing", accepted=[[]]), said.nothing_missing(), "nothing missing"),
        (_known("single", CUBIC), said.named([("structure", "cubic_stiffness")]), "right name"),
        (
            _known("pair", CUBIC, CROSS_TALK),
            said.named([("structure", "cubic_stiffness"), ("sensor", "cross_talk")]),
            "right name",
        ),
        (
            _known("look_alike", effect("mass_error", "tank"), accepted=[["mass_error"], ["effective_mass"]]),
            said.one_of("tank", [["mass_error"], ["effective_mass"]]),
            "set with the truth",
        ),
        (
            _known("outside", effect("unknown", "sensor"), accepted=[["unknown"]]),
            said.unknown("sensor"),
            "unknown, right block",
        ),
    ],
)
def test_every_kind_of_answer_can_be_right(case: Known, verdict: said.Verdict, column: str) -> None:
    mark = marked(case.truth, answer_of(verdict))
    assert (mark.column, mark.right) == (column, True)


def test_the_right_name_in_the_wrong_block_is_not_right() -> None:
    mark = marked(_known("single", CUBIC).truth, answer_of(said.named([("tank", "cubic_stiffness")])))
    assert not mark.right


def test_the_commonest_answer_finds_nothing_and_raises_no_alarm() -> None:
    answer = answer_of(always_nothing(Seen("case_001")))
    assert marked(_known("nothing", accepted=[[]]).truth, answer).right
    mark = marked(_known("single", CUBIC).truth, answer)
    assert (mark.right, mark.wrong_name, mark.detected) == (False, False, False)


def test_the_remaining_error_is_judged_by_the_quantile_of_complete_cases() -> None:
    """Of 1 … 21 the 95 % quantile is 20; effects do not count."""
    complete = [_known("nothing", judged=float(k), accepted=[[]]) for k in range(1, 22)]
    hidden = [_known("single", CUBIC, judged=500.0), _known("pair", CUBIC, CROSS_TALK, judged=500.0)]
    rule = RemainingError.learnt([*complete, *hidden])
    assert rule.largest == pytest.approx(20.0)
    assert rule.say(Seen("case", judged=20.0))["verdict"] == "nothing_missing"
    assert rule.say(Seen("case", judged=20.1)) == said.unknown("structure")


def _model(judged: float, *terms: tuple[str, str]) -> RegressedModel:
    chosen = tuple(ChosenTerm(place, "", term, 1.0, 1.0) for place, term in terms)
    return RegressedModel(0.1, chosen, judged, judged)


RULE = SparseRegression(least_gain=0.1, least_second_gain=0.4, most_left=2.0, as_good=0.05, least_unknown=3.0)
SPRING, TALK = ("structure", "x³"), ("sensor", "dy/dt")


@pytest.mark.parametrize(
    ("judged", "models", "verdict"),
    [
        (1.0, [_model(0.95, SPRING)], said.nothing_missing()),
        (9.0, [_model(8.5, SPRING)], said.unknown("structure")),
        (9.0, [_model(1.0, SPRING)], said.named([("structure", "cubic_stiffness")])),
        (
            9.0,
            [_model(1.5, SPRING), _model(1.0, SPRING, TALK)],
            said.named([("sensor", "sensor_delay"), ("structure", "cubic_stiffness")]),
        ),
        (
            9.0,
            [_model(1.4, SPRING), _model(1.0, SPRING, TALK)],
            said.named([("structure", "cubic_stiffness")]),
        ),
        (9.0, [_model(2.5, SPRING)], said.unknown("structure")),
        (9.0, [_model(1.0, ("sensor", "y³"))], said.unknown("sensor")),
        (9.0, [_model(1.0, ("structure", "x"))], said.unknown("structure")),
        (
            9.0,
            [_model(1.0, SPRING), _model(1.04, ("structure", "x beyond 0.3 x̂"))],
            said.one_of("structure", [["clearance"], ["cubic_stiffness"]]),
        ),
        (9.0, [_model(1.0, ("tank", "a"))], said.one_of("tank", [["effective_mass"], ["mass_error"]])),
        (9.0, [_model(0.5, SPRING, ("structure", "x²"), ("structure", "|v| v"))], said.unknown("structure")),
    ],
)
def test_errors_of_sparse_models_become_answers(
    judged: float, models: list[RegressedModel], verdict: said.Verdict
) -> None:
    """ln(1.5/1.0) = 0.405 is a second effect, ln(1.4/1.0) = 0.336 is none."""
    assert RULE.say(Seen("case", judged=judged, models=tuple(models))) == verdict


def test_the_numbers_of_the_rules_are_those_with_most_right_development_answers() -> None:
    """Complete cases gain e^0.3 by chance and hidden springs e^0.6: the least gain lies between."""
    chance = [_known("nothing", judged=1.35, models=(_model(1.0, SPRING),), accepted=[[]]) for _ in range(5)]
    hidden = [_known("single", CUBIC, judged=1.82, models=(_model(1.0, SPRING),)) for _ in range(5)]
    found = SparseRegression.learnt([*chance, *hidden])
    assert 0.3 < found.least_gain < 0.6


def _drawn(generator: np.random.Generator, kind: str, *effects: dict[str, Any]) -> Known:
    """A case whose features show what is hidden, beside noise."""
    names = {each["name"] for each in effects}
    features = {
        "spring": 5.0 * ("cubic_stiffness" in names) + generator.normal(0, 0.3),
        "delay": 5.0 * ("cross_talk" in names) + generator.normal(0, 0.3),
        "odd": 5.0 * ("unknown" in names) + generator.normal(0, 0.3),
        "noise": float(generator.normal()),
    }
    accepted = [[]] if not effects else None
    return _known(kind, *effects, features=features, accepted=accepted)


@pytest.mark.parametrize("made", [neighbours, forest])
def test_classifiers_learn_what_features_show(made: Any) -> None:
    if made is forest:
        pytest.importorskip("sklearn")
    generator = np.random.default_rng(5)
    hidden = {"nothing": (), "single": (CUBIC,), "pair": (CUBIC, CROSS_TALK), "outside": (effect("unknown"),)}

    def drawn() -> list[Known]:
        return [_drawn(generator, kind, *effects) for kind, effects in hidden.items() for _ in range(12)]

    classifier = LearntClassifier.learnt(drawn(), of_signals, made)
    fresh = drawn()
    verdicts = [classifier.say(case.seen) for case in fresh]
    right = [marked(case.truth, answer_of(v)).right for case, v in zip(fresh, verdicts, strict=True)]
    assert sum(right) >= 46
    for verdict in verdicts:
        # A tree or two of 600 that say 'one effect' where no effect with a name is possible speak for nobody.
        assert sum(verdict["probabilities"].values()) == pytest.approx(1.0, abs=0.01)


def test_neighbours_share_their_labels_by_weight() -> None:
    found = Neighbours(3).fit(
        np.array([[0.0], [1.0], [2.0], [50.0]]), ["a", "b", "b", "c"], np.array([1, 1, 2, 9])
    )
    assert found.predict_proba(np.array([[0.1]]))[0].tolist() == pytest.approx([0.25, 0.75, 0.0])


def test_truths_are_those_that_were_committed_to(tmp_path: Path) -> None:
    written_trial(tmp_path / "trial", [truth("case_001", "nothing", accepted=[[]])], None)
    assert opened(tmp_path / "trial")["case_001"]["kind"] == "nothing"
    kept = json.loads((tmp_path / "trial" / "truths.json").read_bytes())
    kept["case_001"]["truth"]["kind"] = "single"
    (tmp_path / "changed.json").write_text(json.dumps(kept))
    with pytest.raises(InputError, match="not the truth committed to"):
        opened(tmp_path / "trial", tmp_path / "changed.json")


def test_nothing_is_learnt_from_what_is_judged(tmp_path: Path) -> None:
    truths = [truth("case_001", "nothing", accepted=[[]])]
    written_trial(tmp_path / "judged", truths, None)
    written_trial(tmp_path / "sealed", truths, KEY)
    with pytest.raises(InputError, match="cases that are judged"):
        require_apart([tmp_path / "judged"], tmp_path / "judged")
    with pytest.raises(InputError, match="a sealed trial"):
        require_apart([tmp_path / "sealed"], tmp_path / "judged")
    with pytest.raises(InputError, match="no trial"):
        require_apart([], tmp_path / "judged")


def test_one_command_marks_all_rivals_and_goes_on_with_what_was_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("sklearn")
    generator = np.random.default_rng(1)
    output = tmp_path / "out"
    for trial, first in (("development", 1), ("judged", 41)):
        truths = []
        for k in range(first, first + 12):
            effects = (CUBIC,) if k % 2 else ()
            case = _drawn(generator, "single" if effects else "nothing", *effects)
            name = f"case_{k:03d}"
            accepted = None if effects else [[]]
            truths.append(truth(name, "single" if effects else "nothing", *effects, accepted=accepted))
            models = [_model(1.0 if effects else 0.98, SPRING).to_document()]
            seen = {**asdict(case.seen), "case": name, "format": 1, "metadata": {"n": 1.0}, "models": models}
            seen |= {"fitted": 4.0, "judged": 4.0 if effects else 1.0}
            (output / "seen" / trial).mkdir(parents=True, exist_ok=True)
            (output / "seen" / trial / f"{name}.json").write_text(json.dumps(seen))
        written_trial(tmp_path / trial, truths, None)
    for k in range(41, 53):
        place = tmp_path / "judged" / "diagnoses" / f"case_{k:03d}"
        place.mkdir(parents=True)
        done = Outcome(place.name, "done", 0, 1.0, 1.0, 1.0, "")
        (place / "outcome.json").write_text(json.dumps(asdict(done)))
        verdict = said.nothing_missing() | {"fit": {"heldout_after": 1.5, "heldout_retuned": 1.5}}
        (place / "verdict.json").write_text(json.dumps(verdict))
    words = ["rivals", str(tmp_path / "judged"), "--training", str(tmp_path / "development"), "-o", str(output)]
    monkeypatch.setattr(sys, "argv", words)
    assert main() == 0
    rows = {row["name"]: row for row in json.loads((output / "rivals.json").read_bytes())}
    assert rows["commonest answer"]["rates"]["right"][:2] == [6, 12]
    assert rows["sloshlab"]["rates"]["right"][:2] == [6, 12]
    assert rows["sparse regression"]["rates"]["right"][:2] == [12, 12]
    assert rows["random forest"]["rates"]["right"][:2] == [12, 12]
    # Held-out errors are roots of mean squares: of the sparse model where it is chosen, of the baseline else.
    assert rows["sparse regression"]["held_out"]["case_041"] == pytest.approx(1.0)
    assert rows["retuned baseline"]["held_out"]["case_041"] == pytest.approx(math.sqrt(4.0))
    kept = json.loads((output / "answers" / "sparse regression" / "case_041" / "verdict.json").read_bytes())
    assert kept["effects"] == [{"name": "cubic_stiffness", "block": "structure"}]
    assert (output / "rivals.png").is_file()
    # Four cases of development, every other with a spring, teach it as well as twelve do.
    page = (output / "rivals.md").read_text()
    assert "| right after | 4 cases | 8 cases | 12 cases |" in page
    assert "| sparse regression | 12 | 12 | 12 |" in page
    assert "| sloshlab | 6 of 12" in capsys.readouterr().out


@pytest.mark.slow
def test_what_is_seen_of_a_case_is_kept_by_a_process_of_its_own(tmp_path: Path, repository: Path) -> None:
    """A case whose rig is damaged is seen as one in a moment; what is kept is not looked at again."""
    cases, kept = tmp_path / "trial" / "cases", tmp_path / "seen"
    for name in ("case_001", "case_002"):
        shutil.copytree(repository / "raw_data" / "cases" / "nothing-hidden" / "case", cases / name)
        rig = (cases / name / "rig.toml").read_text()
        (cases / name / "rig.toml").write_text(rig.replace("height_m = 0.0572", "height_m = -1.0", 1))
    seen = seen_cases(tmp_path / "trial", kept)
    assert seen == [looked_at(cases / name) for name in ("case_001", "case_002")]
    assert all("height_m: got -1" in case.trouble for case in seen)
    written = (kept / "case_001.json").stat().st_mtime_ns
    (kept / "case_002.json").write_text('{"format": 0}')
    assert seen_cases(tmp_path / "trial", kept) == seen
    assert (kept / "case_001.json").stat().st_mtime_ns == written
    (kept / "case_002.json").unlink()
    (kept / "case_002.json").mkdir()
    with pytest.raises(InputError, match="case case_002"):
        seen_cases(tmp_path / "trial", kept, ["case_002"])
