"""Pictures of the numerical tank: ``python -m studies.numerical_tank_figures [PICTURE ...] [options]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sloshlab.errors import SloshlabError
from studies.numerical_tank_figures.writing import FILE_NAMES, PictureSettings, write_pictures

INPUT_IS_BAD, INTERRUPTED = 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures that are asked for; returns the exit code."""
    given = _parser().parse_args(arguments)
    names = given.pictures or [name for name in FILE_NAMES if name != "maps" or given.maps]
    settings = PictureSettings(given.rig, given.maps, given.layers, given.seed)
    try:
        for path in write_pictures(list(dict.fromkeys(names)), settings, given.output):
            print(f"{path} ({path.stat().st_size / 1e3:.0f} kB)")
    except SloshlabError as error:
        print(f"numerical_tank_figures: {error}", file=sys.stderr)
        return INPUT_IS_BAD
    except OSError as error:
        print(f"numerical_tank_figures: {error.filename}: got {error.strerror}", file=sys.stderr)
        return INPUT_IS_BAD
    except KeyboardInterrupt:
        print("numerical_tank_figures: interrupted; nothing half-written", file=sys.stderr)
        return INTERRUPTED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m studies.numerical_tank_figures",
        description="Pictures of the numerical tank; all of them by default, the maps only with --maps.",
    )
    parser.add_argument("pictures", nargs="*", metavar="PICTURE", help=", ".join(FILE_NAMES))
    parser.add_argument("--rig", type=Path, required=True, metavar="RIG.toml", help="the half-filled tank")
    parser.add_argument("--maps", type=Path, metavar="maps.nc", help="of `sloshlab shaker` on the campaign")
    parser.add_argument("--output", type=Path, default=Path("docs/images"), metavar="FOLDER")
    parser.add_argument("--layers", type=int, default=24, help="height of the tank over the distance of particles")
    parser.add_argument("--seed", type=int, default=0, help="of the disturbance at the start")
    return parser


if __name__ == "__main__":
    sys.exit(main())
