"""The trained model as the tank of the twin: its own steps, no lag, closed loop, scaling, storage, bad input."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sloshlab.errors import InputError, RigError
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.fill_input import FillInput
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import Network
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.scaling_error import scaling_error
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free, harmonic, recorded
from sloshlab.twin.reduced_order_model_force import description_of, term_of
from sloshlab.twin.status import Status
from sloshlab.twin.storage import load_twin, save_twin
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION
from sloshlab.twin.twin import Twin

HEIGHT_M, LIQUID_KG, FILL = 0.0272, 0.12433, 0.5
FACTS = {"fill_level": FILL, "tank_height_m": HEIGHT_M, "liquid_mass_kg": LIQUID_KG}
RATE_HZ = 170.0
WEIGHTS = np.array([-6.0, 2.5, 0.7, -0.4])
"""Of a linear network: Δf(k) = Σ b_i v(k − i), i from 1 on."""


def rig(*, height_m: float = HEIGHT_M, density: float = 1000.0, twin: str = "", fill: float = FILL) -> Rig:
    base = LIQUID_KG / (1000.0 * FILL * HEIGHT_M)
    return Rig.from_toml_text(
        f"[tank]\nheight_m = {height_m}\nlength_m = {base}\nwidth_m = 1.0\ndry_mass_kg = 0.3\n"
        f"[liquid]\ndensity_kg_per_m3 = {density}\nfill_level = {fill}\n{twin}"
    )


def linear(weights: np.ndarray = WEIGHTS, rate_hz: float = RATE_HZ) -> ReducedOrderModel:
    """Two neurons at ±c with weights ±w are w tanh(2 c·φ), which is linear to 10⁻⁹ for small c."""
    small = 1e-5
    theta = np.concatenate([small * weights / 2, -small * weights / 2, [1 / small, -1 / small]])
    return ReducedOrderModel(
        NormalisedRadialBasis(weights.size, 2), theta, Delays.tapped(weights.size), Scaling(), rate_hz, FACTS
    )


def transfer(weights: np.ndarray, s: complex, rate_hz: float = RATE_HZ) -> complex:
    """Force over velocity at e^{st}."""
    return complex(sum(b * np.exp(-s * (i + 1) / rate_hz) for i, b in enumerate(weights)))


def strange(network: Network, delays: Delays, rate_hz: float = RATE_HZ) -> ReducedOrderModel:
    """A network with random parameters and scales that are nowhere one or zero."""
    theta = 0.5 * np.random.default_rng(4).normal(size=network.n_parameters)
    return ReducedOrderModel(network, theta, delays, Scaling(0.03, 0.7, -0.2, 1.3), rate_hz, FACTS)


SHAPES = {
    "normalised": strange(NormalisedRadialBasis(6, 5), Delays.tapped(6)),
    "plain": strange(RadialBasis(6, 5), Delays.tapped(6)),
    "noe": strange(NormalisedRadialBasis(5, 4), Delays((1, 3, 4), (1, 2))),
    "plain_noe": strange(RadialBasis(5, 4), Delays((2, 3, 7), (1, 5))),
    "tanh": strange(Multilayer(6, (9, 3), "tanh"), Delays.tapped(6)),
    "radial": strange(Multilayer(6, (2, 7, 4), "radial"), Delays.tapped(6)),
    "break_up": replace(
        strange(NormalisedRadialBasis(6, 5), Delays.tapped(6)),
        scaling=Scaling(0.03, 0.7, 0.0, 1.3),
        break_up=BreakUp(20.0, 0.7, 0.8, 0.02),
    ),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("n_substeps", [1, 2])
def test_open_loop_is_the_free_run_of_the_model(name: str, n_substeps: int) -> None:
    model = SHAPES[name]
    n_rest = model.delays.longest + 499  # 500 steps at rest before it
    velocity = np.random.default_rng(1).normal(size=600).cumsum() * 0.05
    run = recorded(3 * RATE_HZ, velocity=velocity, acceleration=0 * velocity)
    result = Twin(None, (term_of(model, rig()),)).simulate(run, n_substeps=n_substeps).require_done()
    expected = model.simulate(np.concatenate([np.zeros(n_rest), velocity[::3]]))[n_rest:]
    assert expected.std() > 0.01
    np.testing.assert_allclose(result.tank_force_n[::3], expected, atol=1e-11)


OF_FILLS = {
    "normalised": NormalisedRadialBasis(7, 5),
    "plain": RadialBasis(7, 5),
    "tanh": Multilayer(7, (9, 3), "tanh"),
}


def of_fills(network: Network) -> ReducedOrderModel:
    """Six past velocities and the fill, trained from 0.25 to 0.75 in the tank of these tests."""
    facts = {"tank_height_m": HEIGHT_M, "full_liquid_mass_kg": LIQUID_KG / FILL}
    theta = 0.5 * np.random.default_rng(4).normal(size=network.n_parameters)
    inputs, scaling = Delays(tuple(range(1, 7)), n_states=1), Scaling(0.03, 0.7, -0.2, 1.3)
    return ReducedOrderModel(network, theta, inputs, scaling, RATE_HZ, facts, fill=FillInput(0.25, 0.75, 0.5, 0.2))


@pytest.mark.parametrize("fill", [0.3, 0.6])
@pytest.mark.parametrize("name", OF_FILLS)
def test_the_fill_of_the_rig_is_what_the_network_sees(name: str, fill: float, tmp_path: Path) -> None:
    model = of_fills(OF_FILLS[name])
    velocity = np.random.default_rng(1).normal(size=400).cumsum() * 0.05
    twin = Twin(None, (term_of(model, rig(fill=fill)),))
    save_twin(twin, tmp_path / "twin.toml")
    run = recorded(RATE_HZ, velocity=velocity, acceleration=0 * velocity)
    force = load_twin(tmp_path / "twin.toml").simulate(run).require_done().tank_force_n
    # φ written out: velocities, latest first, then the fill; the output is on the mass of a full tank
    v = (np.concatenate([np.zeros(6), velocity]) - 0.03) / 0.7
    phi = np.stack([*(v[6 - d : v.size - d] for d in range(1, 7)), np.full(velocity.size, (fill - 0.5) / 0.2)])
    expected = fill * (1.3 * model.network.output(np, model.theta, phi) - 0.2)
    assert expected.std() > 0.003
    np.testing.assert_allclose(force, expected, atol=1e-11)
    assert "the fill level among its inputs" in description_of(twin.terms[0])[0]


def test_a_fill_beyond_the_training_is_refused() -> None:
    with pytest.raises(InputError, match=r"allowed: 0\.25 … 0\.75"):
        term_of(of_fills(OF_FILLS["plain"]), rig(fill=0.8))


@pytest.mark.parametrize(("rate_hz", "n_substeps"), [(1000.0, 1), (20_000.0, 1), (997.0, 3), (60.0, 20)])
def test_no_lag_whatever_the_step_of_the_engine(rate_hz: float, n_substeps: int) -> None:
    """A zero-order hold would turn the phase by ωT/2 = 0.2 rad; a linear one would take 1.3 % of the amplitude."""
    frequency, speed, turns = 10.87, 0.8, 40
    omega = 2 * math.pi * frequency
    tank = Twin(None, (term_of(linear(), rig()),))
    run = harmonic(speed / omega, frequency, turns / frequency, rate_hz)
    result = tank.simulate(run, n_substeps=n_substeps).require_done()
    steady = result.time_s > 0.1
    time = result.time_s[steady]
    basis = np.stack([np.sin(omega * time), np.cos(omega * time)], axis=1)
    (in_phase, ahead), *_ = np.linalg.lstsq(basis, result.tank_force_n[steady], rcond=None)
    ratio = complex(in_phase, ahead) / speed / transfer(WEIGHTS, 1j * omega)
    assert abs(ratio) == pytest.approx(1.0, abs=1e-3)
    assert np.angle(ratio) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("rate_hz", [1000.0, 4001.3])
def test_closed_loop_decays_as_the_characteristic_equation_says(rate_hz: float) -> None:
    """m s² + c s + k = s H(s)."""
    m, c, k = 0.9, 0.4, 0.9 * (2 * math.pi * 10.87) ** 2
    s = complex(-1.0, math.sqrt(k / m))
    for _ in range(50):
        wrong = m * s * s + c * s + k - s * transfer(WEIGHTS, s)
        near = s + 1e-6
        slope = (m * near * near + c * near + k - near * transfer(WEIGHTS, near) - wrong) / 1e-6
        s -= wrong / slope
    twin = Twin(single_degree_of_freedom(m, k, c), (term_of(linear(), rig()),))
    run = free(3.0, rate_hz)
    result = twin.simulate(run, initial_displacement_m=0.01, n_substeps=8).require_done()
    rises = np.flatnonzero((result.velocity_m_per_s[:-1] < 0) & (result.velocity_m_per_s[1:] >= 0))
    v = result.velocity_m_per_s
    times = (rises + v[rises] / (v[rises] - v[rises + 1])) / rate_hz
    frequency = 1 / np.diff(times[3:]).mean()
    assert frequency == pytest.approx(abs(s.imag) / (2 * math.pi), rel=1e-4)
    energy = result.mechanical_energy_j
    per_second = np.log(np.interp(times[3], result.time_s, energy) / np.interp(times[23], result.time_s, energy))
    assert per_second / (times[23] - times[3]) == pytest.approx(-2 * s.real, rel=2e-3)
    assert abs(result.energy_residual_j).max() < 1e-8 * energy[0]


def test_its_own_steps_survive_events_of_other_forces() -> None:
    """Friction ends steps at its own instants; the solution is the limit of small steps all the same."""
    structure = single_degree_of_freedom(0.9, 4000.0)
    twin = Twin(structure, (COULOMB_FRICTION(force_n=0.5), term_of(linear(rate_hz=171.3), rig())))
    coarse, fine = (
        twin.simulate(free(0.6, 1000.0), initial_displacement_m=0.01, n_substeps=n).require_done() for n in (4, 64)
    )
    assert coarse.n_events > 5
    np.testing.assert_allclose(coarse.displacement_m, fine.displacement_m, atol=1e-7)


@pytest.mark.parametrize("name", ["normalised", "break_up"])
def test_another_tank_and_liquid_answer_in_similarity(name: str) -> None:
    """Height × 4 and density × 0.8: times × 2, velocities × 2, forces by the masses (2.33–2.35)."""
    model = SHAPES[name]
    other = rig(height_m=4 * HEIGHT_M, density=800.0)
    velocity = 0.5 * np.sin(np.arange(900) / 20) + 0.1
    results = [
        Twin(None, (term_of(model, tank),)).simulate(recorded(rate, velocity=factor * velocity)).require_done()
        for tank, rate, factor in ((rig(), 600.0, 1.0), (other, 300.0, 2.0))
    ]
    ratio = 4 * 0.8  # of the masses: the base area is the same
    np.testing.assert_allclose(results[1].tank_force_n, ratio * results[0].tank_force_n, atol=1e-9)
    memory = ", memory of whether the liquid is broken up" if name == "break_up" else ""
    assert description_of(term_of(model, rig())) == [
        f"model: 6 past velocities and 0 past forces, 5 neurons{memory}, its own steps at 170 Hz"
    ]
    stated = description_of(term_of(model, other))[1]
    assert "times × 2, velocities × 2, forces × 3.2" in stated
    assert "both tanks are filled to the same level" in stated
    # of the same liquid in a tank four times as high: Re × 8, Bo × 16
    assert description_of(term_of(model, other))[2] == f"{scaling_error(8.0, 16.0)}, for the same liquid"
    assert len(description_of(term_of(model, rig(density=800.0)))) == 2


def test_a_saved_twin_needs_no_model_file_and_gives_the_same_bytes(tmp_path: Path) -> None:
    save_model(SHAPES["noe"], tmp_path / "ROM.nc")
    described = rig(twin='[twin]\ntank_model = "rom"\nparameters = {rom = "ROM.nc"}\n')
    twin = replace(Twin.from_rig(described, folder=tmp_path), structure=single_degree_of_freedom(0.9, 4000.0))
    save_twin(twin, tmp_path / "twin.toml")
    (tmp_path / "ROM.nc").unlink()
    loaded = load_twin(tmp_path / "twin.toml")
    save_twin(loaded, tmp_path / "again.toml")
    for suffix in (".toml", ".nc"):
        assert (tmp_path / "twin").with_suffix(suffix).read_bytes() == (tmp_path / "again").with_suffix(
            suffix
        ).read_bytes()
    once, twice, again = (
        each_twin.simulate(free(0.5, 1000.0), initial_displacement_m=0.01).require_done().places.tobytes()
        for each_twin in (twin, loaded, loaded)
    )
    assert once == twice == again


def test_a_damaged_saved_twin_is_refused_in_one_line(tmp_path: Path) -> None:
    term = term_of(SHAPES["tanh"], rig())
    for at, value in (
        (0, 3.0),
        (2, 5.0),
        (2, 1e300),
        (3, -1.0),
        (1, 7.0),
        (8, 1e6),
        (15, np.nan),
        (15, 2.5),
        (6, 6.0),
    ):
        table = term.table.copy()
        table[at] = value
        save_twin(Twin(None, (replace(term, table=table),)), tmp_path / "bad.toml")
        with pytest.raises(InputError, match=r"reduced_order_model: .*save the twin again") as error:
            load_twin(tmp_path / "bad.toml").simulate(free(0.1, 1000.0))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"CDF\x02", b"no netCDF at all" * 50])
def test_a_corrupted_model_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    save_model(linear(), tmp_path / "ROM.nc")
    whole = (tmp_path / "ROM.nc").read_bytes()
    described = rig(twin='[twin]\ntank_model = "rom"\nparameters = {rom = "ROM.nc"}\n')
    for damaged in (content, whole[: len(whole) // 2]):
        (tmp_path / "ROM.nc").write_bytes(damaged)
        with pytest.raises(RigError, match=r"twin.parameters: model .*ROM.nc") as error:
            Twin.from_rig(described, folder=tmp_path)
        assert "\n" not in str(error.value)


def test_models_that_cannot_run_in_a_loop_are_refused(tmp_path: Path) -> None:
    present = strange(RadialBasis(3, 2), Delays((0, 1, 2)))
    for model, tank, message in (
        (present, rig(), "input delays: got 0, 1, 2"),
        (linear(), rig(fill=0.75), "fill level"),
        (replace(linear(), facts={}), rig(), "fill_level of its training: got None"),
        (replace(linear(), facts={**FACTS, "domain": [1, 2]}), rig(), "domain of validity"),
    ):
        with pytest.raises(InputError, match=message):
            term_of(model, tank)
    for parameters, message in (
        ("{}", "no file"),
        ('{rom = "a.nc", model = "b.nc"}', "got model"),
        ("{rom = 3}", "no file"),
    ):
        described = rig(twin=f'[twin]\ntank_model = "rom"\nparameters = {parameters}\n')
        with pytest.raises(RigError, match=message):
            Twin.from_rig(described, folder=tmp_path)


def test_a_model_that_runs_away_ends_the_simulation_and_says_so() -> None:
    """Its own force enters with gain 2.5, so that it grows by this much at every step of 1/170 s."""
    small = 1e-3
    theta = np.array([small * 0.5, small * 1.25, -small * 0.5, -small * 1.25, 1 / small, -1 / small])
    model = ReducedOrderModel(NormalisedRadialBasis(2, 2), theta, Delays((1,), (1,)), Scaling(), RATE_HZ, FACTS)
    twin = Twin(single_degree_of_freedom(0.9, 4000.0), (term_of(model, rig()),))
    ending = twin.simulate(free(1.0, 1000.0), initial_displacement_m=0.01).ending
    assert ending.status is Status.FAULT
    assert "the output of the model runs away" in str(ending)
    assert 0.02 < ending.time_s < 0.1
