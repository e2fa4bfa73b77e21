"""Maps to begin with: filled in, each is imported to the numbers that the file was built from."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from import_scenarios import ACCELERATION, FORCE_KN, RATE_HZ, SCENARIOS, Scenario
from progress_lines import without_progress

from acquisition.files import import_recording, starter_map
from acquisition.files.channel_map import ChannelMap, channel_map_from_text
from acquisition.files.file_format import format_names
from pipelines.command_line import run
from sloshlab.errors import InputError

RUN = {"experiment": "other", "configuration": "frozen", "start_time_utc": "2026-01-31T12:00:00Z"}
INPUT_IS_BAD, USAGE = 1, 2


def filled(text: str, units: dict[str, str] | None = None) -> str:
    """The map with every gap filled as a person would who knows the bench."""
    for key, value in RUN.items():
        text = text.replace(f'{key} = "?"', f'{key} = "{value}"')
    text = text.replace("sampling_rate_hz = 0", f"sampling_rate_hz = {RATE_HZ}")
    blocks = re.split(r"(?=^\[channels)", text, flags=re.MULTILINE)
    for number, block in enumerate(blocks):
        name = re.match(r'\[channels\."?([^"\]]*)', block)
        if name is None:
            continue
        is_force = any(word in name[1].split("_") for word in ("f", "force", "kraft", "cell"))
        quantity, usual = ("force", "kN") if is_force else ("acceleration", "m s-2")
        blocks[number] = block.replace('"?_', f'"{quantity}_').replace(
            'units = "?"', f'units = "{(units or {}).get(quantity, usual)}"'
        )
    return "".join(blocks)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_the_map_of_every_format_is_imported_once_it_is_filled_in(scenario: Scenario, tmp_path: Path) -> None:
    path, place = scenario.write(tmp_path)
    made = starter_map(path, tmp_path)
    tomllib.loads(made.text)
    assert made.n_gaps == made.text.count("FILL IN") - 1
    place.write_text(filled(made.text), encoding="utf-8")
    recording = import_recording([path], place).recording
    # files write their step with few digits (UFF) and their times with a tenth of a millisecond (TRC)
    assert recording.attrs["sampling_rate_hz"] == pytest.approx(RATE_HZ, rel=5e-4)
    found = [recording[name].values for name in recording.data_vars if name != "quality"]
    for expected in (1000 * FORCE_KN, ACCELERATION):
        assert any(values.size == expected.size and np.allclose(values, expected, atol=1e-9) for values in found)


def test_the_scenarios_are_of_every_format() -> None:
    suffixes = {Path(scenario.file_name).suffix.lstrip(".") for scenario in SCENARIOS}
    assert set(format_names()) - {"netcdf"} <= suffixes
    assert "nc" in suffixes


def test_what_a_map_lacks_is_refused_until_it_is_filled_in(tmp_path: Path) -> None:
    path, place = SCENARIOS[0].write(tmp_path)
    text = starter_map(path, tmp_path).text
    for gap in re.findall(r"^.*FILL IN.*$", text, flags=re.MULTILINE)[1:]:
        place.write_text(filled(text.replace(gap, "\0")).replace("\0", gap), encoding="utf-8")
        with pytest.raises(InputError) as refused:
            import_recording([path], place)
        assert "?" in str(refused.value)
    channel_map_from_text(filled(text))


def test_what_the_file_tells_is_no_gap(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    path.write_text("time [ms],F [kN],T [degC],head (g)\n0,1.5,21,0.5\n2,2.5,21,0.6\n4,3.5,22,0.7\n")
    text = starter_map(path, tmp_path).text
    read = tomllib.loads(text)
    assert read["source"] == {"time": "time", "time_units": "ms"}
    assert read["channels"] == {
        "force_f": {"column": "F"},
        "?_head": {"column": "head", "units": "?", "units_override": True},
    }
    assert "rate 500 Hz" in text
    assert "# left out: units degC are of no channel" in text
    place = tmp_path / "map.toml"
    place.write_text(filled(text, {"acceleration": "gravity"}))
    recording = import_recording([path], place).recording
    assert recording["force_f"].values.tolist() == [1500.0, 2500.0, 3500.0]
    assert recording["acceleration_head"].values == pytest.approx([0.5 * 9.80665, 0.6 * 9.80665, 0.7 * 9.80665])
    assert recording.attrs["sampling_rate_hz"] == 500.0


def test_a_can_log_without_a_database_shows_its_bytes(tmp_path: Path) -> None:
    scenario = next(scenario for scenario in SCENARIOS if scenario.name == "can asc")
    path, _ = scenario.write(tmp_path)
    assert 'database = "../rig.dbc"' in starter_map(path, tmp_path / "maps").text
    (tmp_path / "rig.dbc").unlink()
    text = starter_map(path, tmp_path).text
    assert '# database = "rig.dbc"' in text
    assert text.count("[channels.") == 4


@pytest.mark.parametrize(
    "name", ['a "b" [N]', "back\\slash [N]", "Größe\t[N]", "😀 [N]", "#x [N]", "']]' [N]", "1.2.3 [N]"]
)
def test_any_name_of_a_column_makes_a_valid_map(name: str, tmp_path: Path) -> None:
    path, place = tmp_path / "x.csv", tmp_path / "map.toml"
    quoted = name.replace('"', '""')
    path.write_text(f't [s];"{quoted}"\n0;1\n1;2\n2;4\n', encoding="utf-8")
    place.write_text(filled(starter_map(path, tmp_path).text), encoding="utf-8")
    [channel] = [name for name in import_recording([path], place).recording.data_vars if name != "quality"]
    assert channel.startswith("force_")


def test_the_command_writes_a_map_and_says_so(tmp_path: Path, capsys: Any) -> None:
    path, _ = SCENARIOS[0].write(tmp_path)
    place = tmp_path / "maps" / "bench.toml"
    assert run(["import", "--describe", str(path), "--starter", str(place)]) == 0
    assert f"map to begin with: {place} (7 gaps, marked FILL IN)" in capsys.readouterr().out
    assert place.read_text(encoding="utf-8") == starter_map(path, place.parent).text


def test_bad_input_is_one_line_and_writes_nothing(tmp_path: Path, capsys: Any) -> None:
    path, _ = SCENARIOS[0].write(tmp_path)
    place, unknown = tmp_path / "bench.toml", tmp_path / "picture.png"
    unknown.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR")

    def refused(arguments: list[str], code: int, *words: str) -> None:
        before = sorted(path.name for path in tmp_path.iterdir())
        assert run(["import", *arguments]) == code
        told = capsys.readouterr()
        assert told.out == ""
        assert code == USAGE or len(without_progress(told.err).splitlines()) == 1
        assert all(word in told.err for word in words)
        assert sorted(path.name for path in tmp_path.iterdir()) == before

    refused(["--describe", str(unknown), "--starter", str(place)], INPUT_IS_BAD, "unknown format", "csv, mat")
    refused(["--describe", str(path), str(path), "--starter", str(place)], INPUT_IS_BAD, "2 files", "one")
    refused([str(path), "--starter", str(place)], USAGE, "--starter belongs to --describe")
    place.write_text("somebody's own")
    refused(["--describe", str(path), "--starter", str(place)], INPUT_IS_BAD, "there already", "another name")
    refused(["--describe", str(path), "--starter", str(place), "--overwrite"], INPUT_IS_BAD, "there already")
    assert place.read_text() == "somebody's own"


def test_keys_of_a_map_to_begin_with_are_those_of_maps(tmp_path: Path) -> None:
    path, _ = SCENARIOS[0].write(tmp_path)
    text = starter_map(path, tmp_path).text
    # what is commented out can be used as it stands, too
    for line in re.findall(r"^# (\w+) = ", text, flags=re.MULTILINE):
        assert line in {key for part in ("run", "source") for key in _keys(part)}


def _keys(part: str) -> set[str]:
    annotation: Any = ChannelMap.model_fields[part].annotation
    return set(annotation.model_fields)
