"""Tanks in similarity: closed forms, tanks that differ in units only, and a campaign that goes on."""

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, LiquidColumn, TankSetup
from acquisition.two_phase_tank.setup import Fluids, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.tank_scaling import TankScaling, tank_facts
from studies.tank_scaling import campaign, second_liquid, varied_motion
from studies.tank_scaling.changes import Mean, left_out_shares, measured, size_change
from studies.tank_scaling.harmonic_runs import POINTS, HarmonicRun, Point, cycles_of, shaken
from studies.tank_scaling.networks import model_for, rig_of_size, simulated, steady_state
from studies.tank_scaling.similarity import TRAINING_TANK, SimilarTank
from studies.tank_scaling.uncomputed import Look, seen_in, work_left_out

LAYERS = 8
KEPT = Path(__file__).resolve().parents[3] / "raw_data" / "tank_scaling"
POINT = Point(3.8, 3.0)


def force_in_weights(tank: SimilarTank, n_steps: int) -> np.ndarray:
    """Of 3 g at ω̄ = 3.8 from rest, over the weight of the liquid."""
    setup = tank.setup(LAYERS, seed=0)
    numerical = NumericalTank(setup)
    frequency_hz = 3.8 / tank.time_scale_s / (2 * math.pi)
    motion = HarmonicMotion(3 * GRAVITY_M_PER_S2, frequency_hz)
    force = numerical.advance(motion(numerical.times_s(n_steps))).vertical_n
    return force / (setup.liquid_mass_kg * GRAVITY_M_PER_S2)


def test_numbers_of_a_tank_four_times_as_high() -> None:
    """h × 4 at equal g: times and velocities double (2.33, 2.34), Re × 8, Bo × 16, the mass × 64."""
    small, large = SimilarTank(1.0), SimilarTank(4.0)
    assert small.height_m == 0.0272
    assert small.velocity_scale_m_per_s == pytest.approx(0.5166, abs=5e-5)  # √(gh) of the source
    assert large.time_scale_s == pytest.approx(2 * small.time_scale_s, rel=1e-12)
    assert large.velocity_scale_m_per_s == pytest.approx(2 * small.velocity_scale_m_per_s, rel=1e-12)
    assert large.reynolds_number == pytest.approx(8 * small.reynolds_number, rel=1e-12)
    assert large.bond_number == pytest.approx(16 * small.bond_number, rel=1e-12)
    before, now = small.setup(LAYERS, 0), large.setup(LAYERS, 0)
    assert now.liquid_mass_kg == pytest.approx(64 * before.liquid_mass_kg, rel=1e-12)
    assert now.step_s == pytest.approx(2 * before.step_s, rel=1e-12)
    assert now.n_particles == before.n_particles
    # √(gh)/c₀, the Mach number of the computation, is kept
    assert now.liquid.speed_of_sound_m_per_s == pytest.approx(2 * before.liquid.speed_of_sound_m_per_s, rel=1e-12)
    assert now.liquid.viscosity_m2_per_s == before.liquid.viscosity_m2_per_s
    factors = TankScaling.between(rig_of_size(1.0), rig_of_size(4.0))
    assert (factors.time, factors.velocity, factors.force) == pytest.approx((2, 2, 64))
    assert (factors.reynolds, factors.bond) == pytest.approx((8, 16))


@pytest.mark.parametrize("size", [4.0, 0.25])
def test_a_tank_that_differs_in_units_only_has_the_same_force(size: float) -> None:
    """Viscosity × λ^(3/2), too, and λ a power of four: every number is scaled by a power of two, not rounded."""
    n_steps = 1200
    expected = force_in_weights(SimilarTank(1.0), n_steps)
    assert np.ptp(expected) > 6
    assert np.array_equal(force_in_weights(SimilarTank(size, scales_viscosity=True), n_steps), expected)
    # and the viscosity of the real liquid is felt
    assert np.abs(force_in_weights(SimilarTank(size), n_steps) - expected).max() > 1e-3


def test_other_sizes_agree_to_rounding_until_chaos_has_amplified_it() -> None:
    expected = force_in_weights(SimilarTank(1.0), 600)
    for size in (2.0, 5.0):
        found = force_in_weights(SimilarTank(size, scales_viscosity=True), 600)
        assert np.abs(found - expected).max() < 1e-11


def test_cycles_of_a_viscous_and_a_heavy_liquid() -> None:
    """F_S = −(1+β) m a − c v: W̄ = π c/(m Ω), whatever the step."""
    mass, damping, beta, omega, amplitude = 0.12, 3.0, -0.15, 71.0, 30.0
    step = 2 * math.pi / omega / 211.3
    phase = omega * (np.arange(2000) + 0.5) * step
    force = -(1 + beta) * mass * amplitude * np.cos(phase) - damping * amplitude / omega * np.sin(phase)
    w_bar, of_mass = cycles_of(force, step, omega, amplitude, mass)
    assert w_bar.size == 9
    assert w_bar == pytest.approx(np.full(9, math.pi * damping / (mass * omega)), rel=1e-4)
    assert of_mass == pytest.approx(np.full(9, beta), rel=1e-3)


def test_varied_motion_is_one_motion() -> None:
    """The acceleration is the derivative of the velocity; levels and frequencies stay where they are told."""
    times = np.arange(0, varied_motion.DURATION, 1e-3)
    velocity, acceleration = varied_motion.velocity_and_acceleration(times)
    assert np.abs(np.gradient(velocity, times) - acceleration)[2:-2].max() < 1e-4
    assert np.abs(acceleration).max() == pytest.approx(varied_motion.LEVEL_G[1], rel=0.02)
    rises = np.flatnonzero((velocity[1:] > 0) & (velocity[:-1] <= 0))
    omega = 2 * math.pi / np.diff(times[rises])
    assert (omega.min(), omega.max()) == pytest.approx(varied_motion.OMEGA_BAR, rel=0.03)


def test_force_of_the_varied_motion_is_that_beyond_the_frozen_liquid(monkeypatch) -> None:
    """In the same unit for every size, and far smaller than that of the liquid itself where it hardly moves."""
    monkeypatch.setattr(varied_motion, "DURATION", 6.0)
    small, large = (
        varied_motion.dynamic_force(varied_motion.VariedRun(SimilarTank(size, scales_viscosity=True), LAYERS, 0))
        for size in (1.0, 4.0)
    )
    assert small.size == 6 * varied_motion.SAMPLES_PER_TIME_SCALE
    assert large == pytest.approx(small, abs=1e-9)
    # for the first tenths the liquid moves with the tank, at 0.5 g
    assert np.sqrt(np.mean(small[:40] ** 2)) < 0.1


def test_walls_of_a_liquid_that_slides_along() -> None:
    """u along the floor, the front and the back; the upright ends are hit, not wetted along."""
    tank = NumericalTank(SimilarTank(1.0).setup(LAYERS, 0))
    tank.set_velocity(0.3, 0.0)
    setup, box = tank.setup, TRAINING_TANK
    wetted = box.length_m * box.depth_m + 2 * box.length_m * 0.5 * box.height_m
    look = seen_in(tank)
    assert look.wall_m4_per_s2 == pytest.approx(0.3**2 * wetted, rel=0.02)
    omega, unit_j = 70.0, 0.02
    found = work_left_out([look, look], look, setup, omega, unit_j)
    # Stokes' layer: power ρ u² √(νΩ/2) per area, over a cycle
    power = 1000.0 * 0.3**2 * math.sqrt(1e-6 * omega / 2) * wetted
    assert found.wall_layers == pytest.approx(power * 2 * math.pi / omega / unit_j, rel=0.02)
    assert found.surface_tension == 0


def test_surface_of_a_column_that_stands_free() -> None:
    """The free side of a column against the flat surface of a filled tank; 2σ(A − A₀) per cycle."""
    flat = NumericalTank(SimilarTank(1.0).setup(LAYERS * 2, 0))
    box, liquid = TRAINING_TANK, flat.setup.liquid
    column = LiquidColumn(box.length_m / 2, box.height_m)
    standing = NumericalTank(TankSetup(box, column, flat.setup.spacing_m, liquid))
    at_rest, look = seen_in(flat), seen_in(standing)
    # it reaches from the floor to the roof, where there is none
    assert look.surface / at_rest.surface == pytest.approx(box.height_m / box.length_m, rel=0.02)
    twice = Look(0.0, 2 * at_rest.surface)
    found = work_left_out([twice], at_rest, flat.setup, 70.0, 0.02)
    assert found.surface_tension == pytest.approx(2 * 0.0728 * box.length_m * box.depth_m / 0.02, rel=1e-9)


def result(w_bar: float, beta: float, walls: float = 0.03, tension: float = 0.1) -> dict:
    """Cycles that swing by a tenth about a mean, block by block."""
    swing = np.repeat([1.1, 0.9], 6)
    left_out = {"wall_layers": walls, "surface_tension": tension}
    return {"w_bar": w_bar * swing, "beta": beta + swing - 1, "left_out": left_out}


def test_changes_by_hand() -> None:
    others = [Point(2.7, 3.0), POINT]
    runs = {
        HarmonicRun(point, SimilarTank(size), campaign.LAYERS, 0): result(w_bar, beta)
        for point, size, w_bar, beta in (
            (others[0], 1.0, 1.0, -0.1),
            (others[0], 5.0, 1.3, -0.1),
            (others[1], 1.0, 2.0, -0.2),
            (others[1], 5.0, 1.8, -0.1),
        )
    }
    found = size_change(runs, others, 5.0)
    # +30 % and −10 %; two blocks of ± 10 % make a standard error of 10 % of every mean
    assert found.work_mean == pytest.approx(0.1)
    assert found.work_rms == pytest.approx(math.sqrt((0.3**2 + 0.1**2) / 2))
    assert found.work_noise == pytest.approx(math.sqrt(2) * 0.1 * math.sqrt((1.3**2 + 0.9**2) / 2))
    assert (found.beta_mean, found.beta_rms) == pytest.approx((0.05, math.sqrt(0.01 / 2)))
    assert found.beta_noise == pytest.approx(math.sqrt(2) * 0.1)
    # 0.03 and 0.1 at each of two points, of W̄ = 1 and 2
    assert left_out_shares(runs, others) == pytest.approx((0.06 / 3, 0.2 / 3))
    with pytest.raises(InputError, match="make tank-scaling"):
        measured(runs, POINT, 7.0)
    with pytest.raises(InputError, match="blocks"):
        Mean.of([[1.0] * 11])


def test_a_campaign_goes_on_where_it_stopped(tmp_path, monkeypatch) -> None:
    wanted = [HarmonicRun(POINT, SimilarTank(size), 4 * 2, 0, n_cycles=18) for size in (1.0, 4.0)]
    first = campaign.compute(tmp_path, wanted[:1])
    assert len(first[wanted[0]]["w_bar"]) == 2
    assert 0.3 < np.mean(first[wanted[0]]["w_bar"]) < 3
    computed = []
    monkeypatch.setattr(campaign, "shaken", lambda run: computed.append(run) or shaken(run))
    both = campaign.compute(tmp_path, wanted)
    assert computed == wanted[1:]
    assert both[wanted[0]] == first[wanted[0]]
    place = tmp_path / f"{wanted[0].name}.json"
    # a file of another run, and one that is cut, count for nothing
    place.write_text(json.dumps({**first[wanted[0]], "identity": "of another"}))
    (tmp_path / f"{wanted[1].name}.json").write_text("{")
    computed.clear()
    again = campaign.compute(tmp_path, wanted)
    assert computed == wanted
    assert again == both


def test_a_campaign_asks_all_sizes_the_same() -> None:
    found = campaign.runs()
    assert len({run.name for run in found}) == len(found)
    asked = [
        {
            run.point
            for run in found
            if isinstance(run, HarmonicRun) and (run.tank.size, run.layers_per_height) == (size, campaign.LAYERS)
        }
        for size in (*campaign.SMALL_SIZES, *campaign.SIZES)
    ]
    assert len(asked[0]) >= 8
    assert all(points == asked[0] for points in asked)


def test_what_is_kept_gives_the_kept_law() -> None:
    """Cycles of every harmonic run are there, and the changes with size follow from them."""
    kept = campaign.results_of_cycles(json.loads((KEPT / "cycles.json").read_text()))
    assert list(kept) == [run for run in campaign.runs() if isinstance(run, HarmonicRun)]
    law = json.loads((KEPT / "law.json").read_text())
    for entry in law["sizes"]:
        assert asdict(size_change(kept, POINTS, entry["size"])) == pytest.approx(entry, rel=1e-12)
    assert left_out_shares(kept, POINTS) == pytest.approx((law["wall_layers"], law["surface_tension"]), rel=1e-12)
    # by hand: the mean is that of all cycles, its error that of three blocks of 23 cycles
    name = HarmonicRun(POINT, SimilarTank(25.0), campaign.LAYERS, campaign.SEED).name
    cycles = json.loads((KEPT / "cycles.json").read_text())[name]["w_bar"]
    found = measured(kept, POINT, 25.0).w_bar
    assert found.value == pytest.approx(sum(cycles) / len(cycles), rel=1e-12)
    blocks = [sum(cycles[:8]) / 8, sum(cycles[8:16]) / 8, sum(cycles[16:]) / 7]
    mean = sum(blocks) / 3
    assert len(cycles) == 23
    assert found.error == pytest.approx(math.sqrt(sum((block - mean) ** 2 for block in blocks) / 6), rel=1e-9)


@pytest.fixture
def damper() -> ReducedOrderModel:
    """A model of Δf = −c v of one sample before, with one neuron that is linear where it works."""
    network = Multilayer(n_inputs=1, layers=(1,), activation="tanh")
    rng = np.random.default_rng(0)
    theta = rng.normal(size=network.n_parameters)
    facts = tank_facts(rig_of_size(1.0))
    return ReducedOrderModel(network, theta, Delays.tapped(1), Scaling(0, 1.0, 0, 1.0), 512.0, facts)


def test_a_scaled_model_says_the_same_of_every_size(damper) -> None:
    """W̄, β and Δf/(m_l g) without dimension are the law: the scaled model cannot see the size."""
    expected = steady_state(damper, SimilarTank(1.0), POINT)
    times = np.arange(800) / varied_motion.SAMPLES_PER_TIME_SCALE
    force = simulated(damper, SimilarTank(1.0), times)
    assert np.isfinite(force[20:]).all()
    for size in (2.0, 5.0):
        scaled = model_for(damper, size)
        assert scaled.sampling_rate_hz == pytest.approx(512 / math.sqrt(size))
        assert steady_state(scaled, SimilarTank(size), POINT) == pytest.approx(expected, rel=1e-9)
        assert simulated(scaled, SimilarTank(size), times)[20:] == pytest.approx(force[20:], rel=1e-9, abs=1e-9)


def test_steady_state_of_a_delayed_damper(damper) -> None:
    """Δf = −c v(t − τ) has W̄ = π c cos(Ωτ)/(mΩ) and β = −c sin(Ωτ)/(mΩ)."""

    class Delayed:
        delays, sampling_rate_hz = damper.delays, 512.0

        def simulate(self, velocity):
            force = np.full(velocity.size, np.nan)
            force[1:] = -2.0 * velocity[:-1]
            return force

    tank = SimilarTank(1.0)
    omega, mass = 3.8 / tank.time_scale_s, rig_of_size(1.0).liquid_mass_kg
    angle = omega / 512.0
    w_bar, beta = steady_state(Delayed(), tank, POINT)
    assert w_bar == pytest.approx(math.pi * 2 * math.cos(angle) / (mass * omega), rel=2e-3)
    assert beta == pytest.approx(-2 * math.sin(angle) / (mass * omega), rel=2e-2)


def test_other_fluids_in_the_training_tank_are_water_and_air_in_another() -> None:
    """λ = 4: Re × 8 and Bo × 16 of the smaller tank give the same force over weight at times twice as long."""
    small = second_liquid.ScaledShaking(3.8, 3.0, reynolds=8.0, bond=16.0).setup()
    water = Fluids(density_kg_per_m3=1000.0)
    large = filled_two_phase_tank(Box(4 * 0.1172, 4 * 0.0272, 0.078), 0.5, second_liquid.CELLS, fluids=water)
    assert large.step_s == pytest.approx(2 * small.step_s, rel=1e-12)
    motion = 3.0 * 9.81 * np.cos(0.05 * np.arange(60))
    forces = [TwoPhaseTank(each).advance(motion).vertical_n / each.fluid_mass_kg for each in (small, large)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-8, abs=1e-8)
    still_water = second_liquid.ScaledShaking(3.8, 3.0).setup()
    assert still_water.fluids == water
    assert second_liquid.ScaledShaking(3.8, 3.0, proportion=2.0).setup().box.length_m == 2 * 0.1172


def test_changes_of_the_second_liquid_by_hand() -> None:
    """W̄ of 1, twice as much where changed; three starts of 0.9, 1 and 1.1 have an error of 0.1/√3."""
    results = {}
    for change, work in ((second_liquid.UNCHANGED, 1.0), (second_liquid.CHANGES[0], 2.0)):
        for point in second_liquid.POINTS:
            for run in change.runs(point):
                shift = {0: -0.1, 1: 0.0, 2: 0.1}[run.seed] if change is second_liquid.UNCHANGED else 0.0
                results[run.name] = {"w_bar": [work + shift] * 24, "beta": [-0.1 * work] * 24}
    mean, rms, chance = second_liquid.summary(results, second_liquid.CHANGES[0], "w_bar")
    assert (mean, rms, chance) == pytest.approx((1.0, 1.0, 2 * 0.1 / math.sqrt(3)))
    assert second_liquid.summary(results, second_liquid.CHANGES[0], "beta")[0] == pytest.approx(-0.1)
    assert any(
        line.startswith("| λ = 0.2 | +100 % | 100 % | 12 % | −0.100 |") for line in second_liquid.rows(results)
    )


def test_kept_runs_of_the_second_liquid_are_those_of_its_changes() -> None:
    kept = json.loads(Path(second_liquid.__file__).with_suffix(".json").read_text())
    wanted = second_liquid.all_runs()
    assert list(kept) == [run.name for run in wanted]
    assert all(second_liquid.ScaledShaking(**kept[run.name]["case"]) == run for run in wanted)
    # W̄ of one run by hand
    cycles = kept[wanted[12].name]["w_bar"]
    found = second_liquid.mean_of(kept, second_liquid.CHANGES[0], second_liquid.POINTS[0], "w_bar")
    assert found.value == pytest.approx(sum(cycles) / len(cycles), rel=1e-12)
