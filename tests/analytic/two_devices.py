"""Two devices with clocks of their own that watch one tank; for tests only.

A motion is a function of true time, so that each device samples it exactly at its own instants. Nothing
here is shared with the code that aligns the clocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from acquisition.recorder.journal import JournalWriter
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, End
from acquisition.sources.interface import SourceInfo
from sloshlab.recording import write_recording

RATE_HZ = 512.0
BLOCK = 16
ORIGIN_NS = 7_000_000_000_000
UTC_NS = 1_790_000_000_000_000_000
ATTRIBUTES = {
    "sloshlab_format": "1",
    "run_id": "two_devices",
    "experiment": "shaker_sweep",
    "configuration": "sloshing",
    "rig": "rig.toml",
    "sampling_rate_hz": RATE_HZ,
    "start_time_utc": "2026-01-12T09:00:00Z",
    "sweep_start_hz": 5.0,
    "sweep_rate_octave_per_s": 2.0 / 60.0,
}
Truth = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Device:
    """Sample j is taken at true time start_s + j / (RATE_HZ · (1 + drift_ppm · 1e-6))."""

    name: str
    start_s: float
    drift_ppm: float
    n_samples: int
    channels: tuple[Channel, ...]

    def instants_s(self) -> np.ndarray:
        return self.start_s + np.arange(self.n_samples) / (RATE_HZ * (1 + 1e-6 * self.drift_ppm))

    def info(self) -> SourceInfo:
        return SourceInfo(
            self.name, f"sim:{self.name}", RATE_HZ, self.channels, (tuple(range(len(self.channels))),)
        )


def force(name: str) -> Channel:
    return Channel(name, "force", "N", 16, 0.03125, range_min=-20.0, range_max=20.0, noise_std=0.01875)


def accelerometer(name: str, gain: float = 1.0) -> Channel:
    return Channel(name, "acceleration", "m s-2", 16, 50 / 448 * gain, noise_std=0.067 * gain)


def octave_sweep(mass_kg: float, damping_n_s_per_m: float, level_m_per_s2: float = 29.43) -> Truth:
    """F = M ü + c u̇ for u = −A cos φ, φ' = ω = 2π·5·4^(t/60), A = a₀/ω²; every derivative in closed form."""

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        velocity, acceleration = sweep_kinematics(t, level_m_per_s2)
        return mass_kg * acceleration + damping_n_s_per_m * velocity, acceleration

    return at


def sweep_kinematics(t: np.ndarray, level_m_per_s2: float = 29.43) -> tuple[np.ndarray, np.ndarray]:
    """u̇ and ü of the sweep: ω' = kω, A' = −2kA, A'' = 4k²A."""
    k = np.log(4.0) / 60.0
    omega = 2 * np.pi * 5.0 * np.exp(k * t)
    phi = (omega - 2 * np.pi * 5.0) / k
    amplitude = level_m_per_s2 / omega**2
    sin, cos = np.sin(phi), np.cos(phi)
    velocity = amplitude * omega * sin + 2 * k * amplitude * cos
    acceleration = (amplitude * omega**2 - 4 * k**2 * amplitude) * cos - 3 * k * amplitude * omega * sin
    return velocity, acceleration


def laboratory() -> tuple[Device, Device]:
    """Load cells on a serial device; the accelerometers of the roof on CAN, 50 ms later and 100 ppm faster."""
    n = int(60 * RATE_HZ)
    cells = (force("force_cell_1"), force("force_cell_2"), accelerometer("acceleration_control"))
    roof = (accelerometer("acceleration_roof_1"), accelerometer("acceleration_roof_2", 1.003))
    return Device("daq", 0.0, -40.0, n, cells), Device("can", 0.05, 60.0, n, roof)


def counts_of(device: Device, truth: Truth, generator: np.random.Generator, noise_counts: float) -> np.ndarray:
    """Readings of a device, rounded to counts."""
    load, acceleration = truth(device.instants_s())
    shares = {"force": load / 2, "acceleration": acceleration}
    columns = [shares[channel.quantity] / channel.scale_factor for channel in device.channels]
    noise = noise_counts * generator.standard_normal((device.n_samples, len(columns)))
    return np.round(np.stack(columns, axis=1) + noise).astype(np.int32)


def latencies_s(kind: str, taken_s: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """How much later than its last sample a block is read."""
    n = taken_s.size
    if kind == "exponential":
        return 1e-3 + generator.exponential(2e-3, n)
    if kind == "bimodal":
        slow = generator.random(n) < 0.3
        return 5e-4 + generator.exponential(3e-4, n) + np.where(slow, generator.uniform(0.01, 0.03, n), 0.0)
    if kind == "bursts":
        polled = np.ceil(taken_s / 0.016 + 0.37) * 0.016 - 0.37 * 0.016
        return polled - taken_s + generator.exponential(1e-4, n)
    raise ValueError(kind)


def write_journal(
    path: Path,
    devices: tuple[Device, ...],
    truth: Truth,
    *,
    seed: int,
    kinds: tuple[str, ...] = ("exponential", "bursts"),
    noise_counts: float = 0.6,
    speed: float = 1.0,
) -> None:
    """What a recorder writes that listens to the devices; `speed` > 1 plays them faster than real time."""
    generator = np.random.default_rng(seed)
    deliveries = []
    for source, (device, kind) in enumerate(zip(devices, kinds, strict=True)):
        counts = counts_of(device, truth, generator, noise_counts)
        ends = np.arange(BLOCK, device.n_samples + 1, BLOCK)
        taken = device.instants_s()[ends - 1] / speed
        arrivals = np.maximum.accumulate(taken + latencies_s(kind, taken, generator))
        deliveries += [
            (at, source, end - BLOCK, counts[end - BLOCK : end]) for at, end in zip(arrivals, ends, strict=True)
        ]
    with JournalWriter(path, {"attributes": ATTRIBUTES}, [device.info() for device in devices]) as journal:
        for at, source, counter, counts in sorted(deliveries, key=lambda delivery: delivery[:3]):
            ns = round(at * 1e9)
            journal.append(source, Block(0, 40 + source, int(counter), counts, None, ORIGIN_NS + ns, UTC_NS + ns))
        for source, device in enumerate(devices):
            journal.append(source, End(40 + source, device.n_samples))


def write_direct(path: Path, truth: Truth, drift_ppm: float, lost: np.ndarray) -> None:
    """The same motion, all channels sampled at the instants of one device, without noise or rounding."""
    load, acceleration = truth(np.arange(lost.size) / (RATE_HZ * (1 + 1e-6 * drift_ppm)))
    acceleration = np.where(lost, np.nan, acceleration)
    variables = {
        **{
            name: ("time", load / 2, {"units": "N", "quantity": "force"})
            for name in ("force_cell_1", "force_cell_2")
        },
        **{
            name: ("time", acceleration, {"units": "m s-2", "quantity": "acceleration"})
            for name in ("acceleration_roof_1", "acceleration_roof_2")
        },
    }
    variables["quality"] = ("time", lost.astype(np.uint8), {})
    time = np.arange(lost.size) / RATE_HZ
    write_recording(xr.Dataset(variables, coords={"time": time}, attrs=ATTRIBUTES), path)
