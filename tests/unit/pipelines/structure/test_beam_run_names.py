"""Names of runs of a beam."""

from __future__ import annotations

import pytest

from pipelines.structure.results import group_of
from sloshlab.recording import RunAttributes


@pytest.mark.parametrize(
    ("rig", "forces", "name"),
    [
        ("frozen.toml", "", "twin frozen"),
        ("rig_beam.toml", "coulomb (structure)", "twin rig_beam: frozen"),
        ("c1.toml", "viscous_damping (tank), coulomb (structure)", "twin c1: viscous damping"),
    ],
)
def test_a_twin_is_named_by_its_rig_and_the_forces_of_its_liquid(rig: str, forces: str, name: str) -> None:
    attributes = RunAttributes(
        run_id="one",
        experiment="beam_free",
        configuration="frozen",
        rig=rig,
        sampling_rate_hz=1024.0,
        start_time_utc="2026-01-12T09:00:00Z",
        sloshlab_format="1",
        simulated_from="decay.nc",
        simulated_forces=forces,
    )
    assert group_of(attributes) == name
