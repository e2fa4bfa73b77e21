"""The commands around foreign files: import one run, or describe what a file holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquisition.files.description import describe_source
from acquisition.files.importing import import_recording
from acquisition.files.starter_map import GAP, starter_map
from pipelines.report.free_place import require_free_place
from sloshlab import atomic_file
from sloshlab.errors import InputError
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


def describe_sources(sources: Sequence[Path], starter: Path | None = None) -> dict[str, Any]:
    """List columns, units, rates and traps of files, no map needed; write one to begin with.

    Parameters
    ----------
    sources : sequence of Path
    starter : Path, optional
        The map to write, of one file; never replaces anything.

    Raises
    ------
    InputError
        If a file cannot be read, or the map has no place of its own.
    """
    if starter is not None:
        require_free_place(starter, overwrite=False, described="--starter", remedy="another name")
        if len(sources) != 1:
            raise InputError("--starter", got=f"{len(sources)} files", allowed="one", remedy="describe one by one")
    described = [describe_source(source) for source in sources]
    lines = [line for source in described for line in source.lines()]
    told: dict[str, Any] = {"sources": [source.to_dict() for source in described]}
    if starter is not None:
        made = starter_map(sources[0], starter.parent)
        with atomic_file.replaced(starter, overwrite=False) as place:
            place.write_text(made.text, encoding="utf-8")
        lines.append(f"map to begin with: {starter} ({made.n_gaps} gaps, marked {GAP})")
        told |= {"starter": str(starter), "gaps": made.n_gaps}
    return {"lines": lines, "flags": [], **told}
