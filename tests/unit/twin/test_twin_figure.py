"""The twin's figure in the documentation."""

from __future__ import annotations

from pathlib import Path

from studies.twin_figure import main


def test_the_figure_of_the_twin_is_written_and_small(tmp_path: Path) -> None:
    written = main(tmp_path)
    content = written.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert 20_000 < len(content) < 150_000
