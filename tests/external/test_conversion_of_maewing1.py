"""The structure of mAEWing1 in the repository is what its script makes of the decks of its authors."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from sloshlab.aircraft.structure import load_structure

pytestmark = pytest.mark.external
KEPT = Path(__file__).resolve().parents[2] / "raw_data" / "aircraft" / "maewing1"


def test_converted_again_it_is_the_same(external_data: Path, tmp_path: Path) -> None:
    decks = external_data / "maewing1"
    if not (decks / "sol145_mAEWing1.bdf").is_file():
        pytest.skip("no maewing1 among the recordings of other laboratories")
    spec = importlib.util.spec_from_file_location("convert_maewing1", KEPT / "convert.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main(decks, tmp_path)
    again, kept = load_structure(tmp_path / "maewing1.nc"), load_structure(KEPT / "maewing1.nc")
    assert (again.nodes, again.panels, again.splines) == (kept.nodes, kept.panels, kept.splines)
    # another processor may round otherwise
    assert again.frequencies_hz == pytest.approx(kept.frequencies_hz, rel=1e-9)
    assert again.rigid_mass == pytest.approx(kept.rigid_mass, abs=1e-12)
    assert np.abs(again.shapes) == pytest.approx(np.abs(kept.shapes), abs=1e-6)


def test_its_shapes_are_those_of_its_authors(external_data: Path) -> None:
    """Modes 7 to 12 at all nodes against the file of shapes that came with the decks, by the MAC."""
    from scipy.io import loadmat

    path = external_data / "maewing1" / "mAEWing1_FEMv2p1_ModeInfo_updated_nodecords.mat1"
    if not path.is_file():
        pytest.skip("no shapes of maewing1 among the recordings of other laboratories")
    theirs = loadmat(path, appendmat=False, squeeze_me=True, struct_as_record=False)["ModeShape"].modeshape
    kept = load_structure(KEPT / "maewing1.nc")
    order = [kept.row_of(int(node)) for node in theirs[:, 0, 6]]
    for mode in range(6):
        one, two = theirs[:, 1:4, 6 + mode].ravel(), kept.shapes[mode, order, :3].ravel()
        assert (one @ two) ** 2 / (one @ one) / (two @ two) > 0.999


def test_the_manifest_holds_the_hashes() -> None:
    manifest = json.loads((KEPT / "manifest.json").read_text())
    for name, facts in manifest["files"].items():
        content = (KEPT / name).read_bytes()
        assert (len(content), hashlib.sha256(content).hexdigest()) == (facts["bytes"], facts["sha256"])
