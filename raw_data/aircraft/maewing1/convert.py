"""Convert the finite-element decks of mAEWing1: ``python raw_data/aircraft/maewing1/convert.py DECKS [FOLDER]``.

DECKS is a folder with the decks of FEM v2.1 from https://github.com/zhaowei0566/mAEWing1 (``Design/FEM/FEM v2.1``,
MIT licence). FOLDER, this one unless stated, gets the structure, the licence, and a manifest with the hashes of
what was read and written. The same decks give the same bytes on the same kind of processor.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Final

from sloshlab import __version__
from sloshlab.aircraft.deck_reader import read_deck
from sloshlab.aircraft.structure import save_structure, structure_of_deck
from sloshlab.atomic_file import write_bytes

DECK: Final = "sol145_mAEWing1.bdf"
INSTEAD: Final = {
    # the deck names files of a later revision; these are of its own
    "CAERO_mAEWing1_updated.dat": "CAERO_mAEWing1.dat",
    "Spline4_mAEWing1_updated.dat": "Spline4_mAEWing1.dat",
}
INCH_M: Final = 0.0254
POUND_FORCE_S2_PER_INCH_KG: Final = 0.45359237 * 9.80665 / INCH_M
STRUCTURE: Final = "maewing1.nc"


def main(decks: Path, folder: Path) -> None:
    """Write the structure, its licence and the manifest."""
    deck = read_deck(decks / DECK, instead={name: decks / there for name, there in INSTEAD.items()})
    structure = structure_of_deck(
        deck,
        length_m=INCH_M,
        mass_kg=POUND_FORCE_S2_PER_INCH_KG,
        n_modes=20,
        facts={
            "source": "mAEWing1, FEM v2.1, https://github.com/zhaowei0566/mAEWing1",
            "licence": "MIT, (c) 2015 Performance Adaptive Aeroelastic Wing; see LICENSE beside this file",
        },
    )
    save_structure(structure, folder / STRUCTURE)
    write_bytes(folder / "LICENSE", (decks / "LICENSE").read_bytes())
    read = [path for path in sorted(decks.iterdir()) if path.suffix in (".bdf", ".dat")]
    manifest = {
        "format": 1,
        "command": "python raw_data/aircraft/maewing1/convert.py DECKS",
        "sloshlab_version": __version__,
        "read": {path.name: facts_of(path) for path in read if path.name != "sol103_mAEWing1.bdf"},
        "files": {name: facts_of(folder / name) for name in ("LICENSE", STRUCTURE)},
    }
    text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    write_bytes(folder / "manifest.json", text.encode())


def facts_of(path: Path) -> dict[str, object]:
    """Size and hash of a file."""
    content = path.read_bytes()
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(str(__doc__).splitlines()[0])
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) == 3 else Path(__file__).parent)
