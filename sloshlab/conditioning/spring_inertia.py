"""Force cells at the far end of the springs that carry a tank also hold the springs (2.8–2.10).

A spring of mass m whose far end stands still moves along its length in proportion to the distance from there, so
that the force at the tank is that of the cell less m ü/2, whatever the stiffness. With springs above and below,
and all their forces counted at the cells, that is half the mass of all of them.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from sloshlab.conditioning.combined_channels import derived_channel, mean_acceleration
from sloshlab.recording import channels
from sloshlab.rig import Rig

MOVING_SHARE = 0.5
"""Of the mass of a spring, as the force at its still end shows it: ∫ (x/L) dx/L."""


def at_the_tank(recording: xr.Dataset, rig: Rig) -> xr.Dataset:
    """The recording with forces on the tank in place of those at the far end of its springs.

    Parameters
    ----------
    recording : xarray.Dataset
        In SI units, force and acceleration of the tank upward positive.
    rig : Rig
        Its structure's `spring_mass_kg` is the mass of all springs between the force cells and the tank; without
        it the forces are those on the tank, and the recording comes back as it is.

    Returns
    -------
    xarray.Dataset
        Forces F − ½ m_springs ü (2.9), shared equally among several cells.

    Raises
    ------
    AnalysisError
        If there are forces and springs, but no acceleration of the tank.
    """
    mass = None if rig.structure is None else rig.structure.spring_mass_kg
    names = channels(recording, "force")
    if not mass or not names:
        return recording
    inertia = MOVING_SHARE * mass * np.asarray(mean_acceleration(recording).values, np.float64) / len(names)
    changed = {}
    for name in names:
        channel = recording[name]
        more = {"spring_inertia_removed_kg": MOVING_SHARE * mass / len(names)}
        changed[name] = derived_channel(channel, channel.values - inertia, name, {**channel.attrs, **more})
    return recording.assign(changed)
