"""Tables 2.1 and 2.4 through the analysis: runs of the virtual laboratory with exact sensors and frozen liquid."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from pipelines.structure.analysis import analyse_beam, checked_settings
from sloshlab.modal.rig_modes import stated_modes
from sloshlab.rig import Rig

TANK_2_1 = """
[tank]
height_m = 0.060
length_m = 0.100
width_m = 0.060
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58
"""
BEAM_2_4 = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.314
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, 1.0, 1.0]
"""


def test_table_2_1_frequency_of_the_guided_tank() -> None:
    assert round(stated_modes(Rig.from_toml_text(TANK_2_1)).frequency_hz[0], 2) == 6.56


@pytest.mark.parametrize(
    ("text", "experiment", "expected_hz", "expected_damping"),
    [
        (BEAM_2_4, "beam_free", (10.87, 78.31, 226.5), (0.0032, 0.0090, 0.0176)),
        (TANK_2_1, "sdof_free", (6.56,), None),
    ],
    ids=["table_2_4", "table_2_1"],
)
def test_frozen_modes_are_found_again(
    tmp_path: Path,
    text: str,
    experiment: str,
    expected_hz: tuple[float, ...],
    expected_damping: tuple[float, ...] | None,
) -> None:
    """First frozen mode 10.87 Hz with ζ = 0.32 %; f₀ = 6.56 Hz."""
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    recording = virtual_structure_run(
        Rig.from_toml_text(text),
        experiment=experiment,  # type: ignore[arg-type]
        configuration="frozen",
        duration_s=3.0,
        imperfect=False,
    )
    write_virtual_run(recording, tmp_path / "run.nc")
    settings = checked_settings(modes=None, n_cycles=4, segment_s=None)
    found = analyse_beam([tmp_path / "run.nc"], tmp_path / "rig.toml", settings).frozen_modes
    # integration of the laboratory and rounding of the table
    assert [found[mode].frequency_hz for mode in sorted(found)] == pytest.approx(expected_hz, rel=1e-3)
    if expected_damping is not None:
        damping = [found[mode].damping_ratio for mode in sorted(found)]
        assert damping[0] == pytest.approx(expected_damping[0], rel=0.01)
        assert damping[1:] == pytest.approx(expected_damping[1:], rel=0.05)
