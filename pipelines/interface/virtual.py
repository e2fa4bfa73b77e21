"""Runs of the virtual laboratory in Python."""

from __future__ import annotations

import xarray as xr

from pipelines.inputs.rigs import RigLike, rig_source
from pipelines.recording.virtual import VirtualRun, virtual_recording


def virtual_run(
    experiment: str,
    rig: RigLike,
    *,
    configuration: str = "sloshing",
    acceleration_g: float = 3.0,
    direction: str = "up",
    law: str = "octave",
    duration_s: float | None = None,
    sampling_rate_hz: float | None = None,
    initial_displacement_m: float | None = None,
    rms_g: float = 0.2,
    frequency_hz: float = 11.4,
    second_frequency_hz: float = 14.7,
    seed: int = 0,
    laboratory_seed: int | None = None,
    liquid: str = "law",
    layers: int = 16,
    contact_angles: str = "",
) -> xr.Dataset:
    """Make a run of the virtual laboratory; of the options it takes those that the experiment has.

    Parameters
    ----------
    experiment : str
        ``shaker_sweep``, ``shaker_vfa``, ``beam_free`` …, as `sloshlab virtual` takes them.
    rig : path or Rig
    configuration : {"sloshing", "frozen", "empty"}
    acceleration_g : float
        Level of the sweep [g].
    direction : {"up", "down"}
    law : {"octave", "linear", "stepped"}
        How the frequency of a sweep goes.
    duration_s, sampling_rate_hz : float, optional
        [s], [Hz]; by default those of the experiment, on the shaker 240 s and 512 Hz.
    initial_displacement_m : float, optional
        Deflection from which a free run starts [m], upward positive.
    rms_g : float
        Of the random motion of a beam's root [g].
    frequency_hz, second_frequency_hz : float
        Of a sudden start, or of two tones [Hz].
    seed : int
        Of noise, drive and liquid; runs of several seeds are repeats on one rig.
    laboratory_seed : int, optional
        Which laboratory is drawn, with masses, gains and frequencies a little off; by default the rig as told.
    liquid : {"law", "numerical", "two_phase"}
        ``numerical`` and ``two_phase`` are computed, which takes long; on a structure it always is.
    layers : int
        Layers of particles, or cells, over the height of the tank, of a computed liquid.
    contact_angles : str
        Advancing and receding angle [°], such as ``"80,50"``, between which the line of ``two_phase`` sticks.

    Returns
    -------
    xarray.Dataset
        As `open_recording` gives it; the same arguments give the same samples.

    Raises
    ------
    InputError
        If the experiment is unknown or an argument is out of range.
    """
    run = VirtualRun(
        experiment=experiment,
        configuration=configuration,
        seed=seed,
        liquid=liquid,
        layers=layers,
        acceleration_g=acceleration_g,
        direction=direction,
        law=law,
        frequency_hz=frequency_hz,
        duration_s=duration_s,
        sampling_rate_hz=sampling_rate_hz,
        initial_displacement_m=initial_displacement_m,
        rms_g=rms_g,
        second_frequency_hz=second_frequency_hz,
        laboratory_seed=laboratory_seed,
        contact_angles=contact_angles,
    )
    return virtual_recording(run, rig_source(rig))
