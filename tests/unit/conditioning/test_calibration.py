import math

import numpy as np
import pytest
from swept_tank import swept_tank

from sloshlab.conditioning.calibration import (
    apparent_mass,
    check_signs,
    identify_dry_mass,
)
from sloshlab.errors import AnalysisError
from sloshlab.rig import Liquid, Rig, Tank

M_DRY, M_LIQUID = 0.73, 0.12433
FROZEN = (0.37 + M_LIQUID / 2, 0.36 + M_LIQUID / 2)
CELLS = ("force_cell_1", "force_cell_2")
ROOF = ("acceleration_roof_1", "acceleration_roof_2")
RIG = Rig(
    tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.0780, dry_mass_kg=M_DRY),
    liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
)


def test_empty_alone_without_noise():
    found = identify_dry_mass([swept_tank()], [], liquid_mass_kg=M_LIQUID)
    assert found.mass_kg == pytest.approx(M_DRY, rel=1e-9)
    assert found.apparent_mass_kg == found.mass_kg
    assert found.delay_s == pytest.approx(0.0, abs=1e-12)
    assert (found.gain_ratio, found.gain_is_identified, found.source_runs) == (1.0, False, ("empty_1",))


def test_frozen_alone_takes_the_liquid_off():
    found = identify_dry_mass([], [swept_tank(masses_kg=FROZEN, configuration="frozen")], liquid_mass_kg=M_LIQUID)
    assert found.mass_kg == pytest.approx(M_DRY, rel=1e-9)


@pytest.mark.parametrize("delay_s", [2e-4, -5e-5])
def test_delay_of_the_force_is_found_and_does_not_bias_the_mass(delay_s):
    run = swept_tank(delays_s=dict.fromkeys(CELLS, delay_s))
    found = apparent_mass(run)
    assert found.delay_s == pytest.approx(delay_s, rel=1e-3)
    assert found.mass_kg == pytest.approx(M_DRY, rel=1e-5)


def test_noise_does_not_bias_the_mass():
    """20 records with 5 % noise on every channel: the mean is within 1e-4 and within its own scatter."""
    runs = [swept_tank(noise=0.05, seed=seed, duration_s=20.0) for seed in range(20)]
    found = identify_dry_mass(runs, [], liquid_mass_kg=M_LIQUID)
    assert found.mass_kg == pytest.approx(M_DRY, rel=1e-4)
    assert abs(found.mass_kg - M_DRY) < 4 * found.mass_std_kg
    each = np.array([apparent_mass(run).mass_kg for run in runs])
    stated = np.mean([apparent_mass(run).mass_std_kg for run in runs])
    assert stated == pytest.approx(each.std(ddof=1), rel=0.5)
    delays = np.array([apparent_mass(run).delay_s for run in runs])
    assert found.delay_s == pytest.approx(0.0, abs=4 * delays.std(ddof=1) / math.sqrt(20))
    stated = np.mean([apparent_mass(run).delay_std_s for run in runs])
    assert stated == pytest.approx(delays.std(ddof=1), rel=0.5)


def test_empty_and_frozen_tell_the_gain_from_the_mass():
    """Cells read 1.2 % too much, accelerometers 0.7 % too little: g = 1.012/0.993."""
    gains = {**dict.fromkeys(CELLS, 1.012), **dict.fromkeys(ROOF, 0.993)}
    empty = [swept_tank(gains=gains, noise=0.01, seed=seed) for seed in (1, 2)]
    frozen = [
        swept_tank(gains=gains, noise=0.01, seed=seed, masses_kg=FROZEN, configuration="frozen") for seed in (3, 4)
    ]
    found = identify_dry_mass(empty, frozen, liquid_mass_kg=M_LIQUID)
    gain = 1.012 / 0.993
    assert found.gain_is_identified
    assert found.gain_ratio == pytest.approx(gain, abs=4 * found.gain_ratio_std)
    assert found.gain_ratio_std < 1e-3
    assert found.mass_kg == pytest.approx(M_DRY, abs=4 * found.mass_std_kg)
    assert found.apparent_mass_kg == pytest.approx(gain * M_DRY, rel=1e-4)
    assert found.source_runs == ("empty_1", "empty_2", "frozen_3", "frozen_4")


def test_stated_deviations_are_those_of_repeated_identifications():
    found = []
    for seed in range(12):
        settings = {"noise": 0.05, "duration_s": 15.0}
        empty = [swept_tank(seed=seed, **settings)]
        frozen = [swept_tank(seed=seed + 100, masses_kg=FROZEN, configuration="frozen", **settings)]
        found.append(identify_dry_mass(empty, frozen, liquid_mass_kg=M_LIQUID))
    gains, masses = (
        np.array([getattr(dry_mass, name) for dry_mass in found]) for name in ("gain_ratio", "mass_kg")
    )
    assert np.mean([dry_mass.gain_ratio_std for dry_mass in found]) == pytest.approx(gains.std(ddof=1), rel=0.6)
    assert np.mean([dry_mass.mass_std_kg for dry_mass in found]) == pytest.approx(masses.std(ddof=1), rel=0.6)
    assert abs(gains.mean() - 1) < 4 * gains.std(ddof=1) / math.sqrt(12)


def test_static_weight_and_lost_samples_do_not_matter():
    run = swept_tank()
    run["force_cell_1"] += 50.0
    run["acceleration_roof_2"][20000:20050] = np.nan
    assert apparent_mass(run).mass_kg == pytest.approx(M_DRY, rel=1e-8)


def test_static_weight_does_not_matter_in_blocks_of_one_cycle_either():
    """Two seconds give blocks of a quarter of a second, whose lowest line lies beside the zeroth."""
    run = swept_tank(duration_s=2.0)
    without = apparent_mass(run).mass_kg
    run["force_cell_1"] += 50.0
    run["acceleration_roof_1"] += 9.81
    assert apparent_mass(run).mass_kg == pytest.approx(without, rel=1e-9)
    assert without == pytest.approx(M_DRY, rel=1e-9)


@pytest.mark.parametrize("damping_kg_per_s", [0.0, 1.0])
def test_right_signs_pass_with_and_without_damping(damping_kg_per_s):
    check_signs(swept_tank(noise=0.01, damping_kg_per_s=damping_kg_per_s), RIG)


def test_a_wrong_cell_is_named_with_its_apparent_mass():
    run = swept_tank(gains={"force_cell_2": -1.0}, noise=0.01, damping_kg_per_s=1.0)
    message = r"^force_cell_2: sign: got .*\+0\.37 kg on force_cell_1.*−0\.36 kg on force_cell_2"
    with pytest.raises(
        AnalysisError, match=message + r".*0\.854 kg in all; remedy: set sign = -1 for force_cell_2 "
    ):
        check_signs(run, RIG)


def test_all_cells_against_the_acceleration_blames_the_accelerometers_first():
    run = swept_tank(gains=dict.fromkeys((*ROOF, "acceleration_control"), -1.0))
    names = "acceleration_control, acceleration_roof_1, acceleration_roof_2"
    with pytest.raises(AnalysisError, match=rf"^{names} \(or force_cell_1, force_cell_2\): sign"):
        check_signs(run)


def test_one_wrong_accelerometer_is_named_before_the_cells():
    with pytest.raises(AnalysisError, match=r"^acceleration_roof_2: sign"):
        check_signs(swept_tank(gains={"acceleration_roof_2": -1.0}))


def test_a_force_stated_as_that_of_the_tank_is_not_a_wrong_sign():
    run = swept_tank(gains={"force_cell_2": -1.0})
    run["force_cell_2"].attrs["block_from"] = "tank"
    check_signs(run)


def test_what_cannot_be_identified_is_refused():
    run = swept_tank(duration_s=5.0)
    with pytest.raises(AnalysisError, match="neither an empty nor a frozen run"):
        identify_dry_mass([], [], liquid_mass_kg=M_LIQUID)
    with pytest.raises(AnalysisError, match="run empty_1: configuration: got 'empty'; allowed: 'frozen'"):
        identify_dry_mass([], [run], liquid_mass_kg=M_LIQUID)
    with pytest.raises(AnalysisError, match="liquid_mass_kg"):
        identify_dry_mass([run], [], liquid_mass_kg=0.0)
    with pytest.raises(AnalysisError, match=r"dry mass: got -0\.73"):
        identify_dry_mass(
            [swept_tank(gains=dict.fromkeys(CELLS, -1.0), duration_s=5.0)], [], liquid_mass_kg=M_LIQUID
        )
    with pytest.raises(AnalysisError, match="gain of force over acceleration: got 0"):
        identify_dry_mass([run], [run.assign_attrs(configuration="frozen")], liquid_mass_kg=M_LIQUID)
    run["acceleration_roof_1"][:] = 0.0
    run["acceleration_roof_2"][:] = 0.0
    with pytest.raises(AnalysisError, match="no motion"):
        apparent_mass(run)
