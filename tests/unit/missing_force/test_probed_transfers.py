"""What a pulse tells of a twin that only simulates: receptances in closed form, and the force that it lacks."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from sloshlab.identification.case import CaseRun
from sloshlab.identification.observations import observations
from sloshlab.missing_force.interface_cut import interface_cut
from sloshlab.missing_force.latent_force import STRUCTURE, run_forces
from sloshlab.missing_force.probed_transfers import probed_transfers
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.recording import run_attributes
from sloshlab.twin.structure_forces import CUBIC_STIFFNESS
from sloshlab.user_twin import EquationTwin, UserTwinModel

MASS_KG, STIFFNESS, DAMPING, CUBIC = 2.0, 3000.0, 30.0, 4e5
RATE_HZ, N = 250.0, 2000
TIME = np.arange(N) / RATE_HZ


def cart(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    acceleration = (inputs.force_push + force - DAMPING * state.v - STIFFNESS * state.x) / MASS_KG
    return (state.v, acceleration), (state.x, acceleration)


TWIN = EquationTwin(
    cart,
    {"x": 0.0, "v": 0.0},
    [],
    ["force_push"],
    {"displacement_cart": "m", "acceleration_cart": "m s-2"},
)


def push(t: float) -> float:
    return float(60 * np.sin(2 * np.pi * 4.3 * t) * np.sin(np.pi * t / 8) ** 2 * np.sin(2 * np.pi * 0.7 * t))


@pytest.fixture(scope="module")
def recorded() -> CaseRun:
    """The cart with a cubic spring that the twin does not have, integrated by scipy, with noise."""
    generator = np.random.default_rng(4)
    y = solve_ivp(
        lambda t, y: [y[1], (push(t) - DAMPING * y[1] - STIFFNESS * y[0] - CUBIC * y[0] ** 3) / MASS_KG],
        (0, N / RATE_HZ), [0.0, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-12, max_step=0.005,
    ).y  # fmt: skip
    force = np.array([push(t) for t in TIME])
    acceleration = (force - DAMPING * y[1] - STIFFNESS * y[0] - CUBIC * y[0] ** 3) / MASS_KG
    channels = {
        "force_push": (force, "N", "force", 0.0),
        "displacement_cart": (y[0], "m", "displacement", 2e-6),
        "acceleration_cart": (acceleration, "m s-2", "acceleration", 5e-3),
    }
    variables = {
        name: (
            "time", values + generator.normal(0, noise, N) if noise else values,
            {"units": units, "quantity": quantity, "noise_std": noise},
        )
        for name, (values, units, quantity, noise) in channels.items()
    }  # fmt: skip
    attributes = {
        "sloshlab_format": "1", "run_id": "run", "experiment": "other", "configuration": "frozen", "rig": "own",
        "sampling_rate_hz": RATE_HZ, "start_time_utc": "2026-01-01T00:00:00Z", "repeat": 0,
    }  # fmt: skip
    dataset = xr.Dataset(variables, coords={"time": TIME}, attrs=attributes)
    return CaseRun("run", dataset, run_attributes(dataset))


def test_a_pulse_shows_the_receptance_in_closed_form(recorded: CaseRun) -> None:
    """1/(k − m ω² + i c ω), which has died away within the run."""
    model = UserTwinModel(TWIN, [recorded])
    probed = probed_transfers(model, recorded, {}, NOTHING)
    omega = 2 * np.pi * probed.frequency_hz
    receptance = 1 / (STIFFNESS - MASS_KG * omega**2 + 1j * DAMPING * omega)
    low = probed.frequency_hz < 0.25 * RATE_HZ
    for found, order in (
        (probed.readings["displacement_cart"], 0),
        (probed.readings["acceleration_cart"], 2),
        (probed.motion[1], 1),
    ):
        expected = (1j * omega) ** order * receptance
        # of the acceleration's jump, what aliases from beyond half the sampling rate
        np.testing.assert_allclose(found[low], expected[low], atol=5e-3 * np.abs(expected).max())


def test_the_force_that_a_twin_lacks_is_found(recorded: CaseRun) -> None:
    model = UserTwinModel(TWIN, [recorded])
    found = run_forces(model, observations(recorded, model.compared(recorded), ["force_push"]), {})
    [force] = found.forces
    assert force.place == STRUCTURE
    x = np.interp(force.time_s, TIME, recorded.recording["displacement_cart"].values)
    expected = -CUBIC * x**3
    assert np.abs(expected).max() > 5.0
    assert np.sqrt(np.mean((force.force_n - expected) ** 2)) < 0.05 * expected.std()
    np.testing.assert_allclose(force.motion[:, 0], x, atol=0.02 * np.abs(x).max())


def test_nothing_is_left_once_the_twin_has_it(recorded: CaseRun) -> None:
    model = UserTwinModel(TWIN, [recorded])
    extension = Extension((CUBIC_STIFFNESS(stiffness_n_per_m3=CUBIC),))
    [force] = run_forces(
        model, observations(recorded, model.compared(recorded), ["force_push"]), {}, extension=extension
    ).forces
    [before] = run_forces(model, observations(recorded, model.compared(recorded), ["force_push"]), {}).forces
    assert force.power_n2 < 1e-3 * before.power_n2


def test_the_cut_charges_the_machine_and_not_its_sensors(recorded: CaseRun) -> None:
    model = UserTwinModel(TWIN, [recorded])
    cut = interface_cut(model, [observations(recorded, model.compared(recorded), ["force_push"])], {})
    shares = {block.block: block.share for block in cut.blocks}
    assert shares[STRUCTURE] > 0.95
    assert [block.block for block in cut.blocks] == ["excitation", "structure", "sensor"]
    assert cut.suspect == ""
