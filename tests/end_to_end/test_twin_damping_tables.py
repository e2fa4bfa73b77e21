"""Damping by twins against recordings whose damping is written down: ζ(a) of decays, ζ₁ in random motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from beam_runs import BEAM_RIG, beam_decay, beam_random

from pipelines.structure.analysis import analyse_beam, checked_settings
from pipelines.structure.results import BeamExperiment
from pipelines.structure.twin_damping import decay_comparisons, decay_table, random_table
from sloshlab.recording import write_recording

REPEATS = (4.1e-4, 4.3e-4)
"""ζ₁ = c a of the two releases, and a tenth more than their mean for the twin."""
TWIN = 1.1 * 4.2e-4


def of_twin(recording: xr.Dataset, simulated_from: str, twin: str) -> xr.Dataset:
    recording.attrs |= {
        "simulated_from": simulated_from,
        "simulated_forces": "reduced_order_model (tank)",
        "rig": f"{twin}.toml",
    }
    return recording


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> BeamExperiment:
    folder = tmp_path_factory.mktemp("tables")
    runs: dict[str, xr.Dataset] = {}
    for repeat, coefficient in enumerate(REPEATS, 1):
        runs[f"decay_{repeat}"] = beam_decay(
            f"decay_{repeat}", configuration="sloshing", coefficient=coefficient, seed=repeat
        )
    runs["random"] = beam_random("random", damping_ratio=0.025, rms_g=0.4, configuration="sloshing")
    twins = {
        "decay_1_twin": (beam_decay("a", configuration="sloshing", coefficient=TWIN, seed=8), "decay_1.nc"),
        "random_twin": (beam_random("b", damping_ratio=0.030, rms_g=0.4, configuration="sloshing"), "random.nc"),
    }
    runs |= {name: of_twin(run, source, "small") for name, (run, source) in twins.items()}
    for name, run in runs.items():
        write_recording(run, folder / f"{name}.nc")
    (folder / "rig.toml").write_text(BEAM_RIG, encoding="utf-8")
    settings = checked_settings(modes=1, n_cycles=4, segment_s=None)
    return analyse_beam([folder / f"{name}.nc" for name in runs], folder / "rig.toml", settings)


def test_a_twin_that_damps_a_tenth_more_is_said_to(experiment: BeamExperiment) -> None:
    ((group, found),) = decay_comparisons(experiment).items()
    assert group == "twin small: ROM"
    strong = found.amplitude_m_per_s2 > 7.0  # the decays end in the bin below
    assert strong.sum() == 7
    assert found.is_known[strong].all()
    # ζ is a mean over a bin that reaches from 0.87 to 1.15 of its middle
    np.testing.assert_allclose(found.measured[strong], 4.2e-4 * found.amplitude_m_per_s2[strong], rtol=0.1)
    np.testing.assert_allclose(found.relative[strong], 0.1, atol=0.025)
    # two cycles after a release from 65 m/s² it has lost a twelfth of c a per cycle and 2π
    after = 65.0 / (1 + 2 * np.pi * 2 * min(REPEATS) * 65.0)
    assert found.amplitude_m_per_s2.max() < 1.16 * after  # bins are an eighth of a decade wide


def test_the_tables_say_the_same_for_people(experiment: BeamExperiment) -> None:
    decays = decay_table(experiment)
    assert decays is not None
    assert decays.header == ("a [g]", "measured ζ₁ [%]", "twin small: ROM [%]")
    shares = [float(row[2].split("(")[1].split("%")[0].replace("−", "-")) for row in decays.rows[:5]]
    assert shares == pytest.approx([10.0] * 5, abs=4.0)
    assert [row[0] for row in decays.rows[-2:]] == ["largest deviation", "RMS deviation"]
    random = random_table(experiment)
    assert random is not None
    measured, twin = random.rows
    # one minute says ζ within a fifth; both runs have the same root motion, so that they err alike
    assert float(measured[1]) == pytest.approx(2.5, rel=0.2)
    assert twin[0] == "twin small: ROM"
    assert float(twin[1].split(" ")[0]) == pytest.approx(3.0, rel=0.2)
    assert float(twin[1].split("(")[1].split("%")[0]) == pytest.approx(20.0, abs=8.0)


def test_one_release_is_no_mean(experiment: BeamExperiment) -> None:
    """With one repeat the scatter is not known, and so nothing is compared."""
    single = replace(experiment, runs=tuple(run for run in experiment.runs if run.path.stem != "decay_2"))
    assert decay_comparisons(single) == {}
    assert decay_table(single) is None
