"""What a search is given of the training records, and what becomes of its answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.field_benchmarks import search
from pipelines.field_benchmarks.catalogue import BENCHMARKS
from pipelines.field_benchmarks.definition import BenchmarkData, Record
from pipelines.field_benchmarks.run import scored
from sloshlab.errors import InputError
from sloshlab.identification.case import read_case

ANSWER = """sloshlab_user_twin = 1
module = "twin silverbox.py"

[parameters]
"stiffness" = 1.0
"natural frequency" = 70.0
"damping ratio" = 0.05
"offset of the output" = 0.0

[[terms]]
name = "cubic_stiffness"
stiffness_n_per_m3 = 4.0
"""


def ramp(n: int, name: str = "training") -> Record:
    number = np.arange(n, dtype=float)
    return Record(name, {"force_input": number, "displacement_output": 1e-6 * number}, 610.0)


def test_stretches_are_equally_far_apart_and_of_training_records_alone() -> None:
    found = search.stretches((ramp(65_062),))
    assert [record.name for record in found] == ["training_1", "training_2", "training_3"]
    # 65 062 samples in three parts of 21 687
    assert [record.channels["force_input"][0] for record in found] == [0, 21_687, 43_374]
    assert {record.n_samples for record in found} == {6_500}


def test_of_several_records_each_gives_a_stretch() -> None:
    found = search.stretches((ramp(900, "period 1"), ramp(800, "period 2"), ramp(700, "period 3")))
    assert [(record.name, record.n_samples) for record in found] == [
        ("period_1_1", 900),
        ("period_2_1", 800),
        ("period_3_1", 700),
    ]


def test_the_extended_twin_is_scored_as_one_model_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """A static force F moves the twin to x + 4 x³ = F."""
    given: dict[str, Any] = {}

    def diagnosed(case: Path, output: Path | None, *, command: str, report: bool, twin: Path) -> dict[str, Any]:
        given.update(case=read_case(case, with_rig=False), twin=twin.name, report=report, command=command)
        (case / "diagnosis").mkdir()
        (case / "diagnosis" / "extended_twin.toml").write_text(ANSWER, encoding="utf-8")
        assert output is None
        effect = {"name": "cubic_stiffness", "parameters": {"stiffness_n_per_m3": {"estimate": 4.0}}}
        return {"verdict": "named", "statement": "cubic", "effects": [effect]}

    monkeypatch.setattr(search, "diagnose_case", diagnosed)
    silverbox = BENCHMARKS["silverbox"]
    fitted, answer = search.searched_model(silverbox, (ramp(3000),))
    assert len(given["case"].runs) == 3
    assert (given["twin"], given["report"]) == ("silverbox.py", False)
    assert answer == {"verdict": "named", "statement": "cubic", "effects": ["cubic_stiffness"]}
    assert fitted.numbers[-1].name == "cubic stiffness: stiffness"
    displacement = 0.3
    force = displacement + 4.0 * displacement**3
    channels = {"force_input": np.full(600, force), "displacement_output": np.full(600, displacement)}
    steady = Record("steady", channels, 610.0, 50)
    result = scored(silverbox, BenchmarkData((steady,), (steady,)), fitted)
    # from rest at the place of equilibrium nothing moves: errors in millivolts
    assert result.errors["steady"] < 1e-3


def test_a_benchmark_whose_physics_is_no_force_is_not_searched() -> None:
    tanks = BENCHMARKS["cascaded_tanks"]
    with pytest.raises(InputError, match="cascaded_tanks"):
        search.searched_model(replace(tanks, twin_file=None), ())
