"""The worked example of the documentation does what its text says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from acquisition.files import import_recording
from acquisition.files.channel_map import (
    Calibration,
    ChannelSection,
    RunSection,
    SourceSection,
    read_channel_map,
)


def _block(text: str, language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)
    assert found is not None
    return found[1]


def test_worked_example(repository: Path, tmp_path: Path) -> None:
    text = (repository / "docs" / "import.md").read_text(encoding="utf-8")
    (tmp_path / "bench.csv").write_text(_block(text, "csv"), encoding="utf-8")
    (tmp_path / "bench.toml").write_text(_block(text, "toml"), encoding="utf-8")
    result = import_recording([tmp_path / "bench.csv"], tmp_path / "bench.toml")
    force = result.recording["force_cell_1"].values
    np.testing.assert_allclose(force, [123.45, 246.9, 493.8, np.nan, 370.35, 123.45], rtol=1e-14)
    roof = result.recording["acceleration_roof_1"].values
    np.testing.assert_allclose(roof, -9.80665 * np.array([0.5, 0.4, 0.1, np.nan, -0.4, -0.5]), rtol=1e-14)
    np.testing.assert_array_equal(result.recording["quality"].values, [0, 0, 2, 1, 0, 0])
    assert result.recording.attrs["sampling_rate_hz"] == 500.0
    assert any(line.startswith("Temperatur") for line in result.report.left_out)
    assert any("read as gravity" in trap for trap in result.report.traps)


def test_every_key_is_documented(repository: Path) -> None:
    text = (repository / "docs" / "import.md").read_text(encoding="utf-8")
    for section in (RunSection, SourceSection, ChannelSection, Calibration):
        for key, field in section.model_fields.items():
            name = field.alias or key
            assert re.search(rf"[`.]{name}\b|\b{name} = ", text), name


def test_example_maps_are_valid(repository: Path) -> None:
    maps = sorted((repository / "docs" / "examples").glob("f16*.toml"))
    assert maps
    for path in maps:
        assert read_channel_map(path).channels
