"""One run as it is recorded: the wing that flies, its sensors, a file of the recording format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.signal import lfilter

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.flap_chain import flap_motion
from acquisition.virtual_flight.flight_test import OVERSAMPLING, RATE_HZ, FlightPoint, signals_of
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.motion import Drive, accelerations
from acquisition.virtual_flight.true_wing import true_wing
from sloshlab.recording import write_recording

FloatArray = npt.NDArray[np.float64]
GUST, AIRSPEED, COMMAND, FLAP, ROOT = (
    "velocity_gust",
    "velocity_airspeed",
    "displacement_flap_command",
    "displacement_flap",
    "acceleration_root",
)
NOISE: Final = {GUST: 0.0015, AIRSPEED: 0.0, COMMAND: 0.0, FLAP: 2e-5, ROOT: 0.001}
"""Standard deviation of each sensor, in its unit; accelerometers of the wing have `ACCELEROMETER_NOISE`."""
ACCELEROMETER_NOISE: Final = 0.05
AIR_DENSITY: Final = 1.2
_RESOLUTION: Final = 0.05
_UNITS: Final = {"velocity": "m s-1", "displacement": "m", "acceleration": "m s-2"}


@dataclass(frozen=True)
class Laboratory:
    """By what the laboratory is off without anything being missing.

    Attributes
    ----------
    factors : dict of str to float
        ``bending``, ``torsion``, ``damping``, ``actuator``; gains by channel.
    """

    factors: dict[str, float] = field(default_factory=dict)

    def of(self, name: str) -> float:
        """A factor; one where none was drawn."""
        return self.factors.get(name, 1.0)


def drawn_laboratory(wing: DescribedWing, generator: np.random.Generator) -> Laboratory:
    """Stiffnesses ±2 %, damping ±15 %, actuator ±1 %, gains ±0.5 %.

    Parameters
    ----------
    wing : DescribedWing
    generator : numpy.random.Generator
    """
    spread = {"bending": 0.02, "torsion": 0.02, "damping": 0.15, "actuator": 0.01}
    spread |= {name: 0.005 for name, _, _ in wing.accelerometers} | {FLAP: 0.005}
    return Laboratory({name: 1 + size * float(generator.uniform(-1, 1)) for name, size in spread.items()})


def perfect_run(
    wing: DescribedWing, hidden: HiddenFlight, laboratory: Laboratory, point: FlightPoint, seed: list[int]
) -> dict[str, FloatArray]:
    """What sensors without noise read, by channel.

    Parameters
    ----------
    wing : DescribedWing
    hidden : HiddenFlight
    laboratory : Laboratory
    point : FlightPoint
    seed : list of int
        Of what is done.
    """
    done = signals_of(point, np.random.default_rng(seed))
    fine = RATE_HZ * OVERSAMPLING
    factors = {name: laboratory.of(name) for name in ("bending", "torsion", "damping")}
    # a flight computer gives a number at every sample, and the actuator a line between them
    commanded = _at(done.command_rad[::OVERSAMPLING], np.arange(done.command_rad.size) / OVERSAMPLING)
    actuator, flap = flap_motion(wing, hidden, commanded, fine, laboratory.of("actuator"))
    acting = _at(done.gust_m_per_s, np.arange(done.gust_m_per_s.size) - hidden.gust_delay_s * fine)
    if hidden.gust_time_constant_s > 0:
        share = 1 / (1 + hidden.gust_time_constant_s * fine)
        acting = lfilter([share], [1.0, share - 1.0], acting)
    true_airspeed = point.airspeed_m_per_s * (1 + hidden.airspeed_ratio)
    drive = Drive(
        fine, true_airspeed, AIR_DENSITY, np.asarray(acting), flap, np.gradient(flap) * fine, done.root_m_per_s2
    )
    moved = accelerations(wing, true_wing(wing, hidden, factors), hidden, drive)
    every = OVERSAMPLING // 2
    readings = {
        name: laboratory.of(name) * moved[::every, k] for k, (name, _, _) in enumerate(wing.accelerometers)
    }
    chord, n = wing.flap_chord_m, moved[::every].shape[0]
    readings[FLAP] = laboratory.of(FLAP) * chord * actuator[::OVERSAMPLING][:n]
    readings[COMMAND] = chord * done.command_rad[::OVERSAMPLING][:n]
    readings[GUST] = done.gust_m_per_s[::OVERSAMPLING][:n]
    # an air data computer tells steps of 0.05 m/s
    readings[AIRSPEED] = np.full(n, _RESOLUTION * round(point.airspeed_m_per_s / _RESOLUTION))
    readings[ROOT] = done.root_m_per_s2[::OVERSAMPLING][:n]
    for channel, kind, number in hidden.sensor:
        readings[channel] = _faulty(readings[channel], kind, number)
    return readings


def _at(values: FloatArray, place: npt.NDArray[np.floating[Any]]) -> FloatArray:
    """Values at other samples, linear between them."""
    return np.asarray(np.interp(place, np.arange(values.size), values))


def _faulty(values: FloatArray, kind: str, number: float) -> FloatArray:
    if kind == "gain":
        return values * (1 + number)
    if kind == "clipping":
        return np.clip(values, -number, number)
    if kind == "delay":
        spectrum = np.fft.rfft(values, 2 * values.size)
        shift = np.exp(-2j * np.pi * np.fft.rfftfreq(2 * values.size, 1 / RATE_HZ) * number)
        return np.fft.irfft(spectrum * shift, 2 * values.size)[: values.size]
    constant = 2 * number * RATE_HZ
    return np.asarray(
        lfilter(np.array([constant, -constant]) / (1 + constant), [1, (1 - constant) / (1 + constant)], values)
    )


def write_run(
    path: Path, readings: dict[str, FloatArray], point: FlightPoint, number: int, generator: np.random.Generator
) -> None:
    """Add noise and write a recording.

    Parameters
    ----------
    path : Path
    readings : dict of str to ndarray
    point : FlightPoint
    number : int
        Of the run in its case.
    generator : numpy.random.Generator
        Of the noise.
    """
    variables = {}
    for name, values in sorted(readings.items()):
        noise = NOISE.get(name, ACCELEROMETER_NOISE)
        # where no gust is made the vane is not read, and neither is the root where nothing shakes it
        is_still = name in (GUST, ROOT) and not values.any()
        read = values + (0.0 if is_still else noise) * generator.standard_normal(values.size)
        attributes = {"units": _UNITS[name.partition("_")[0]], "quantity": name.partition("_")[0]}
        variables[name] = ("time", read, {**attributes, **({"noise_std": noise} if noise else {})})
    time = ("time", np.arange(next(iter(readings.values())).size) / RATE_HZ, {"units": "s"})
    write_recording(xr.Dataset(variables, coords={"time": time}, attrs=_attributes(point, number)), path)


def _attributes(point: FlightPoint, number: int) -> dict[str, Any]:
    return {
        "sloshlab_format": "1",
        "run_id": f"run_{number:02d}",
        "experiment": {"gust": "flight_gust", "pulse": "flight_pulse", "taxi": "taxi"}[point.kind],
        "configuration": "sloshing",
        "rig": "model.toml",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": f"2026-05-04T{9 + number // 6:02d}:{10 * (number % 6):02d}:00Z",
        "air_density_kg_per_m3": AIR_DENSITY,
        "test": f"{point.kind} {point.airspeed_m_per_s:g} m/s {point.level:g}",
        "repeat": point.repeat,
    }
