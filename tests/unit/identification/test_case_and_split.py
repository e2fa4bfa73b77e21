"""Which runs are repeats of one test, and which of them choose nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, rig, run_of

from sloshlab.errors import InputError, SloshlabError
from sloshlab.identification.case import Case, CaseRun, level, read_case
from sloshlab.identification.split import split


def run(name: str, size: float, n: int = 500, **attributes: Any) -> CaseRun:
    tone = size * np.cos(2 * np.pi * 6.0 * np.arange(n) / RATE_HZ)
    return run_of(name, {"acceleration_tip": tone}, {}, 1, **attributes)


def case(folder: Path, *runs: CaseRun) -> Case:
    return Case("case", folder, rig(folder), runs)


def names(groups: Any) -> list[list[str]]:
    return [[run.name for run in group] for group in groups]


def test_the_level_of_a_run_is_the_rms_of_its_acceleration() -> None:
    assert level(run("a", 3.0, 2500)) == pytest.approx(3.0 / np.sqrt(2), rel=1e-3)


def test_repeats_share_everything_but_their_number(tmp_path: Path) -> None:
    runs = (
        run("a", 1.0, initial_displacement_m=0.01, repeat=1),
        run("b", 1.0, initial_displacement_m=0.02, repeat=1),
        run("c", 1.02, initial_displacement_m=0.01, repeat=2),
        run("d", 1.3, initial_displacement_m=0.01, repeat=3),
        run("e", 1.0, 600, initial_displacement_m=0.01, repeat=4),
        run("f", 1.0, initial_displacement_m=0.01, configuration="frozen", repeat=5),
    )
    assert names(case(tmp_path, *runs).tests()) == [["a", "c"], ["b"], ["d"], ["e"], ["f"]]


def test_the_middle_levels_judge_and_the_outer_ones_choose(tmp_path: Path) -> None:
    runs = [run(f"{size}_{n}", size, repeat=n) for size in (4.0, 1.0, 2.0, 8.0) for n in (1, 2)]
    found = split(case(tmp_path, *runs))
    assert {run.name for run in found.held_out} == {"2.0_1", "2.0_2"}
    assert {run.name for run in found.fitting} == {run.name for run in runs} - {"2.0_1", "2.0_2"}
    assert found.limits == ()


def test_two_levels_leave_the_last_repeat_of_each_to_judge_and_say_so(tmp_path: Path) -> None:
    runs = [run(f"{size}_{n}", size, repeat=n) for size in (1.0, 2.0) for n in (1, 2)]
    found = split(case(tmp_path, *runs))
    assert sorted(run.name for run in found.held_out) == ["1.0_2", "2.0_2"]
    assert sorted(run.name for run in found.fitting) == ["1.0_1", "2.0_1"]
    assert any("nothing is judged at another level" in limit for limit in found.limits)


def test_levels_of_different_experiments_are_not_mixed(tmp_path: Path) -> None:
    runs = [run(f"decay_{size}", size) for size in (1.0, 2.0, 3.0)]
    runs += [run(f"random_{size}", size, experiment="other") for size in (0.1, 0.2, 0.3)]
    found = split(case(tmp_path, *runs))
    assert {run.name for run in found.held_out} == {"decay_2.0", "random_0.2"}
    assert any("no repeats" in limit for limit in found.limits)


def test_two_runs_without_repeats_leave_one_to_judge(tmp_path: Path) -> None:
    found = split(case(tmp_path, run("a", 1.0), run("b", 2.0)))
    assert len(found.fitting) == 1
    assert len(found.held_out) == 1
    assert not set(found.fitting) & set(found.held_out)
    assert any("few tests" in limit for limit in found.limits)
    assert any("no repeats" in limit for limit in found.limits)


def test_one_run_alone_fits_and_judges_itself_and_says_so(tmp_path: Path) -> None:
    [alone] = [run("a", 1.0)]
    found = split(case(tmp_path, alone))
    assert found.fitting == found.held_out == (alone,)
    assert any("nothing can be named for sure" in limit for limit in found.limits)


def written(folder: Path, *runs: CaseRun) -> Path:
    rig(folder)
    (folder / "recordings").mkdir()
    for run in runs:
        run.recording.to_netcdf(folder / "recordings" / f"{run.name}.nc")
    return folder


def test_a_case_is_read_in_the_order_of_its_names(tmp_path: Path) -> None:
    found = read_case(written(tmp_path, run("b", 1.0), run("a", 2.0)))
    assert [run.name for run in found.runs] == ["a", "b"]
    assert found.rig is not None
    assert found.rig.tank.height_m == 0.0272
    assert found.name == tmp_path.name


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda folder: (folder / "rig.toml").unlink(), r"no rig\.toml.*name a case folder"),
        (lambda folder: (folder / "recordings" / "a.nc").unlink(), r"0 recordings.*1 … 200"),
        (lambda folder: (folder / "recordings" / "a.nc").write_bytes(b"CDF but no more"), r"a\.nc"),
        (lambda folder: (folder / "rig.toml").write_text("tank = 3", "utf-8"), r"rig\.toml|tank"),
    ],
)
def test_what_is_no_case_is_one_clear_line(tmp_path: Path, spoil: Any, message: str) -> None:
    folder = written(tmp_path, run("a", 1.0))
    spoil(folder)
    with pytest.raises(SloshlabError, match=message) as error:
        read_case(folder)
    assert "\n" not in str(error.value)


def test_a_case_of_too_many_runs_is_refused_before_they_are_read(tmp_path: Path) -> None:
    folder = written(tmp_path)
    for i in range(201):
        (folder / "recordings" / f"{i}.nc").touch()
    with pytest.raises(InputError, match="201 recordings"):
        read_case(folder)
