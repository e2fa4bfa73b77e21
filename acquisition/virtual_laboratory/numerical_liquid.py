"""The liquid of the numerical tank in the rigs of the virtual laboratory.

Everything that the tank needs comes from the rig description. No law tells it what to do.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.computed_force import PARTICLES, ComputedForce, TankMethod, computed_force
from acquisition.numerical_tank.instability import STOPPED
from acquisition.numerical_tank.tank import Box, Liquid, TankSetup, filled_tank
from acquisition.two_phase_tank.method import LIQUID_AND_GAS
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.virtual_laboratory.tone_motion import TankMotion
from sloshlab._version import __version__
from sloshlab.errors import InputError
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]


def numerical_setup(rig: Rig, *, layers_per_height: int, seed: int, sampling_rate_hz: float) -> TankSetup:
    """The numerical tank of a rig.

    Parameters
    ----------
    rig : Rig
        Inside of the tank, density, fill level and, where it tells one, viscosity.
    layers_per_height : int
        Height of the tank over the distance of the particles.
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float
        A whole number of steps makes a sample.

    Raises
    ------
    InputError
        If such a tank cannot be computed.
    """
    water = Liquid()
    viscosity = rig.liquid.kinematic_viscosity_m2_per_s
    return filled_tank(
        Box(rig.tank.length_m, rig.tank.height_m, rig.tank.width_m),
        rig.liquid.fill_level,
        layers_per_height,
        liquid=Liquid(
            rig.liquid.density_kg_per_m3,
            water.viscosity_m2_per_s if viscosity is None else viscosity,
            water.speed_of_sound_m_per_s,
        ),
        seed=seed,
        sampling_rate_hz=sampling_rate_hz,
    )


def two_phase_setup(
    rig: Rig,
    *,
    cells_per_height: int,
    seed: int,
    sampling_rate_hz: float,
    longest_step_s: float = GridNumerics().longest_step_s,
    walls: Walls | None = None,
) -> TwoPhaseSetup:
    """The tank of liquid and gas of a rig.

    Parameters
    ----------
    rig : Rig
        Inside of the tank, density, fill level and, where it tells them, viscosity and surface tension; what it
        does not tell is that of water. The gas is air.
    cells_per_height : int
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float
        A whole number of steps makes a sample.
    longest_step_s : float
        Time step that is not exceeded.
    walls : Walls, optional
        By default they hold the fluids, and the contact angle is 90°.

    Raises
    ------
    InputError
        If such a tank cannot be computed.
    """
    water, liquid = Fluids(), rig.liquid
    viscosity, tension = liquid.kinematic_viscosity_m2_per_s, liquid.surface_tension_n_per_m
    fluids = Fluids(
        liquid.density_kg_per_m3,
        water.viscosity_m2_per_s if viscosity is None else viscosity,
        surface_tension_n_per_m=water.surface_tension_n_per_m if tension is None else tension,
    )
    return filled_two_phase_tank(
        Box(rig.tank.length_m, rig.tank.height_m, rig.tank.width_m),
        liquid.fill_level,
        cells_per_height,
        fluids=fluids,
        walls=walls,
        numerics=GridNumerics(longest_step_s=longest_step_s),
        seed=seed,
        sampling_rate_hz=sampling_rate_hz,
    )


def two_phase_attributes(setup: TwoPhaseSetup) -> dict[str, Any]:
    """Global attributes of a recording whose liquid was computed with its gas."""
    walls = setup.walls
    angles = {
        "advancing_angle_deg": walls.advancing_angle_deg,
        "receding_angle_deg": walls.receding_angle_deg,
    }
    return {
        "liquid": "two_phase_tank",
        "cells_per_height": setup.cells_per_height,
        "step_s": setup.step_s,
        "viscosity_m2_per_s": setup.fluids.viscosity_m2_per_s,
        "surface_tension_n_per_m": setup.fluids.surface_tension_n_per_m,
        "gas_density_kg_per_m3": setup.fluids.gas_density_kg_per_m3,
        **(angles if walls.line_sticks else {}),
        "seed": setup.seed,
        "sloshlab_version": __version__,
    }


def method_attributes(setup: TankSetup) -> dict[str, Any]:
    """Global attributes of a recording that tell how its liquid was computed."""
    return {
        "liquid": "numerical_tank",
        "layers_per_height": round(setup.box.height_m / setup.spacing_m),
        "n_particles": setup.n_particles,
        "step_s": setup.step_s,
        "speed_of_sound_m_per_s": setup.liquid.speed_of_sound_m_per_s,
        "viscosity_m2_per_s": setup.effective_viscosity_m2_per_s,
        "seed": setup.seed,
        "sloshlab_version": __version__,
    }


@dataclass(frozen=True)
class NumericalLiquid:
    """How the liquid of a run is computed.

    Attributes
    ----------
    layers_per_height : int
        Height of the tank over the distance of the particles, or over the side of a cell.
    checkpoint : path-like, optional
        Where the state is saved from time to time, and taken up if it is there.
    progress : callable, optional
        Called with the share of the work done.
    finished : callable, optional
        Called with what was computed, the time that it took included.
    with_gas : bool
        Whether liquid and gas are computed on a grid; else the liquid alone as particles.
    walls : Walls, optional
        Of liquid and gas.
    """

    layers_per_height: int = 16
    checkpoint: str | os.PathLike[str] | None = None
    progress: Callable[[float], None] | None = None
    finished: Callable[[ComputedForce], None] | None = None
    with_gas: bool = False
    walls: Walls | None = None

    def force_n(
        self, rig: Rig, motion: TankMotion, configuration: str, *, sampling_rate_hz: float, seed: int
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Force of the liquid on the shaken tank, and what the recording says about it.

        Parameters
        ----------
        rig : Rig
        motion : TankMotion
            Of the tank.
        configuration : {'sloshing', 'frozen', 'empty'}
            Only a sloshing liquid is computed; a frozen one moves with the tank, F_S = −m_l ü.
        sampling_rate_hz : float
            Sample k is at k over it.
        seed : int
            Of the disturbance at the start.

        Returns
        -------
        ndarray, dict
            F_S [N], upward positive, without the weight, shorter than the motion if the computation became
            unstable; and global attributes, then with `numerical_tank_stopped`.
        """
        if configuration != "sloshing":
            # exact and made in a second: a frozen liquid is a rigid mass, an empty tank has none
            mass_kg = rig.liquid_mass_kg if configuration == "frozen" else 0.0
            time_s = np.arange(round(motion.duration_s * sampling_rate_hz)) / sampling_rate_hz
            force_n = -mass_kg * motion.at(time_s).acceleration
            return force_n, {"liquid": configuration, "seed": seed, "sloshlab_version": __version__}
        # the same seed as for the shaker's imperfections: repeats differ in both
        setup, method, told = self._described(rig, seed, sampling_rate_hz)
        computed = computed_force(
            setup,
            lambda time_s: motion.at(time_s).acceleration,
            motion.duration_s,
            method=method,
            checkpoint=self.checkpoint,
            progress=self.progress,
        )
        if self.finished is not None:
            self.finished(computed)
        if not computed.vertical_n.size:
            raise InputError("numerical tank: not one sample", got=computed.stopped)
        stopped = {STOPPED: computed.stopped} if computed.stopped else {}
        return computed.vertical_n, {**told, **stopped}

    def _described(self, rig: Rig, seed: int, rate_hz: float) -> tuple[Any, TankMethod, dict[str, Any]]:
        """What is computed, how, and what the recording says of it."""
        if self.with_gas:
            both = two_phase_setup(
                rig,
                cells_per_height=self.layers_per_height,
                seed=seed,
                sampling_rate_hz=rate_hz,
                walls=self.walls,
            )
            return both, LIQUID_AND_GAS, two_phase_attributes(both)
        setup = numerical_setup(rig, layers_per_height=self.layers_per_height, seed=seed, sampling_rate_hz=rate_hz)
        return setup, PARTICLES, method_attributes(setup)
