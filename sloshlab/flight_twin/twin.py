"""The twin of a wing in flight, for a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sloshlab.flight_twin.described_wing import FlightWing, read_flight_wing
from sloshlab.flight_twin.effects import flight_effects
from sloshlab.flight_twin.numbers import BELIEVED, parameters_of
from sloshlab.flight_twin.simulation import DRIVING, FLAP, FlightSimulation
from sloshlab.flight_twin.state_space import numbers_with
from sloshlab.user_twin.description import BlockTwin, Compared, TwinRun

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def flight_twin(path: Path) -> BlockTwin:
    """The twin that a model file describes.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If the file is bad.
    """
    return twin_of(read_flight_wing(path))


def twin_of(described: FlightWing) -> BlockTwin:
    """The twin of a wing.

    Parameters
    ----------
    described : FlightWing
    """
    simulation, gain = FlightSimulation(described), described.wing.tolerances.gain
    compared = {each.name: Compared("m s-2", gain) for each in described.accelerometers}
    compared[FLAP] = Compared("m", gain)
    return BlockTwin(
        parameters_of(described),
        DRIVING,
        compared,
        simulation.simulate,
        lambda run, values, frequencies: block_transfers(simulation, run, values, frequencies),
        flight_effects(len(described.tanks)),
    )


def block_transfers(
    simulation: FlightSimulation, run: TwinRun, values: Mapping[str, float], frequencies_hz: FloatArray
) -> dict[str, ComplexArray]:
    """Readings of accelerometers and of the flap's sensor per unit of what each place lacks.

    A force of the structure bends or twists the wing at its tip, of the air it is lift along the span, as by a
    gust or as by bending, of a tank a vertical force on it or a moment about the axis; of the flap it is an angle
    that its sensor sees or not, of the excitation a gust.

    Parameters
    ----------
    simulation : FlightSimulation
    run : TwinRun
    values : mapping
    frequencies_hz : ndarray, shape (n,)

    Returns
    -------
    dict
        By place, shape (n, n_accelerometers + 1); flight alone has air, and runs with a command a flap.
    """
    described, modal = simulation.described, simulation.modal
    numbers = numbers_with({**dict.fromkeys(BELIEVED, 1.0), **values}, len(described.tanks))
    equations = simulation.equations(run, numbers)
    n, m = equations.n_coordinates, modal.omega_rad_per_s.size
    s = 2j * np.pi * np.maximum(frequencies_hz, 1e-3)
    system = s[:, None, None] * np.eye(equations.system.shape[0]) - equations.system

    def shown(columns: FloatArray, direct: FloatArray) -> ComplexArray:
        """Accelerations by forces on the states; `direct` is what the rates have at once."""
        states = np.linalg.solve(system, np.broadcast_to(columns[:, None], (s.size, columns.size, 1)))[..., 0]
        rates = states @ equations.system[n : 2 * n].T + direct
        return np.concatenate([rates @ equations.sensor_rows.T, np.zeros((s.size, 1))], axis=1)

    def of_force(generalised: FloatArray) -> ComplexArray:
        columns = equations.forces @ np.append(generalised, np.zeros(n - generalised.size))
        return shown(columns, columns[n : 2 * n])

    def of_input(number: int) -> ComplexArray:
        return shown(equations.inputs[:, number], equations.inputs[n : 2 * n, number])

    tip_twist = modal.strips.twist[-1]
    places = {"structure bending": of_force(modal.tip_row[:m]), "structure torsion": of_force(tip_twist)}
    for i in range(len(described.tanks)):
        places[f"tank {i + 1}"] = of_force(modal.tank_rows[i])
        places[f"tank {i + 1} moment"] = of_force(modal.tank_twist_rows[i])
    if run.channels[DRIVING[1]].any():
        places["aerodynamics"] = of_force(modal.strips.lift)
        places["aerodynamics bending"] = of_force(modal.strips.lift_deflection[:, 0])
    if run.channels[DRIVING[0]].any():
        places["excitation"] = of_input(0)
    if run.channels[DRIVING[2]].any():
        angle = of_input(1) + s[:, None] * of_input(2)
        places["control hinge"] = angle.copy()
        angle[:, -1] = described.flap_chord_m
        places["control"] = angle
    return places
