"""The figure of sideways sloshing in the documentation."""

from __future__ import annotations

from pathlib import Path

from studies.lateral_sloshing_figure import main


def test_the_figure_of_sideways_sloshing_is_written_and_small(tmp_path: Path) -> None:
    content = main(tmp_path).read_bytes()
    assert content.startswith(b"\x89PNG")
    assert 20_000 < len(content) < 150_000
