"""The ready-made cases of `raw_data/cases`: drawn again by running this module on a folder."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Final

from acquisition.virtual_laboratory.campaign import MANIFEST_NAME, file_record
from pipelines.demonstration.sealed_cases import draw
from pipelines.report.progress import progress
from pipelines.report.terminal import say
from sealed_trial.demonstrations import DEMONSTRATIONS
from sloshlab import __version__
from sloshlab.atomic_file import filled_folder

COMMAND: Final = "python -m pipelines.demonstration.ready_made raw_data/cases"


def make_ready_made(folder: Path) -> Path:
    """Draw and seal every demonstration with its own seed; all files appear together.

    Parameters
    ----------
    folder : Path
        Files that are there are replaced.

    Returns
    -------
    Path
        The manifest: command, seeds, version, and SHA-256 and size of every file.
    """
    with filled_folder(folder) as complete, progress("drawing cases", len(DEMONSTRATIONS)) as advance:
        for name, known in DEMONSTRATIONS.items():
            draw(name, known.seed, complete / name)
            advance(name)
        files = sorted(path for path in complete.rglob("*") if path.is_file())
        content = {
            "format": 1,
            "command": COMMAND,
            "seeds": {name: known.seed for name, known in DEMONSTRATIONS.items()},
            "sloshlab_version": __version__,
            "files": {path.relative_to(complete).as_posix(): file_record(path) for path in files},
        }
        manifest = (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
        (complete / MANIFEST_NAME).write_bytes(manifest)
    return folder / MANIFEST_NAME


def main() -> None:
    """Draw them into a folder."""
    parser = argparse.ArgumentParser(prog="python -m pipelines.demonstration.ready_made", description=__doc__)
    parser.add_argument("folder", type=Path)
    say(f"manifest: {make_ready_made(parser.parse_args().folder)}")


if __name__ == "__main__":
    main()
