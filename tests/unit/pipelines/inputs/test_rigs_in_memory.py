"""Rigs in memory: names, identity, and files that they name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipelines.inputs.rigs import RigInMemory, folder_of, rig_of, rig_source, rig_sources
from sloshlab.errors import InputError
from sloshlab.rig import Rig

TEXT = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""
RIG = Rig.from_toml_text(TEXT)


def with_model(path: str) -> Rig:
    return Rig.from_toml_text(f'{TEXT}[twin]\ntank_model = "rom"\nparameters = {{rom = "{path}"}}\n')


def test_rigs_are_called_by_their_files_or_keys() -> None:
    assert [rig.name for rig in rig_sources({"half.toml": RIG, "other": "folder/rig_1.toml"})] == [
        "half.toml",
        "rig_1.toml",
    ]
    assert [rig.name for rig in rig_sources([RIG, Path("a.toml")])] == ["rig", "a.toml"]
    assert rig_of(rig_source(RIG)) is RIG


def test_the_hash_is_that_of_the_description() -> None:
    same = RigInMemory("a", Rig.from_toml_text(TEXT))
    assert same.sha256 == RigInMemory("b", RIG).sha256
    fuller = Rig.from_toml_text(TEXT.replace("0.5", "0.51"))
    assert RigInMemory("a", fuller).sha256 != same.sha256


def test_a_rig_that_is_no_file_may_not_name_a_file_of_the_working_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"rig: twin.parameters.rom: got 'ROM.nc'.*allowed: an absolute path"):
        folder_of(rig_source(with_model("ROM.nc")))
    assert folder_of(rig_source(with_model((tmp_path / "ROM.nc").as_posix()))) is None
    assert folder_of(rig_source(tmp_path / "rig.toml")) == tmp_path


@pytest.mark.parametrize(("given", "words"), [([], "rig: got none"), (3, "type int"), ([None], "NoneType")])
def test_what_is_no_rig_is_refused(given: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        rig_sources(given)
