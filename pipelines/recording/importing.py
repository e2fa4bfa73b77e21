"""The commands around foreign files: import one run, or describe what a file holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquisition.files.description import describe_source
from acquisition.files.importing import import_recording
from pipelines.report.free_place import require_free_place
from sloshlab import atomic_file
from sloshlab.recording import write_recording


def import_run(
    sources: Sequence[Path], channel_map: Path, output: Path, rig: Path | None, *, overwrite: bool = False
) -> dict[str, Any]:
    """Import one run and write it; flagged if samples were lost or clipped."""
    require_free_place(output, overwrite=overwrite)
    result = import_recording(sources, channel_map, rig=rig)
    with atomic_file.replaced(output, overwrite=overwrite) as place:
        write_recording(result.recording, place, encoding=result.encoding)
    report = result.report
    flags = [f"{report.n_lost} samples lost"] if report.n_lost else []
    flags += [f"{report.n_clipped} samples clipped"] if report.n_clipped else []
    lines = [*report.lines(), f"recording: {output}"]
    return {"lines": lines, "flags": flags, "output": str(output), "report": report.to_dict()}


def describe_sources(sources: Sequence[Path]) -> dict[str, Any]:
    """List columns, units, rates and traps of files, no map needed."""
    described = [describe_source(source) for source in sources]
    lines = [line for source in described for line in source.lines()]
    return {"lines": lines, "flags": [], "sources": [source.to_dict() for source in described]}
