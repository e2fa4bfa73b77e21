"""The recordings of the numerical tank as signals of the liquid, by what they are used for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from acquisition.virtual_laboratory.numerical_runs import SUDDEN_STARTS, SUDDEN_STARTS_BETWEEN
from sloshlab.conditioning.calibration import DryMass, identify_dry_mass
from sloshlab.conditioning.combined_channels import acceleration_channels, force_channels
from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from sloshlab.reduced_order_model.liquid_at_rest import from_rest
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals, liquid_signals
from sloshlab.rig import Rig

REST_S: Final = 1.0
FILL: Final = "fill_0.50"


@dataclass(frozen=True)
class Recordings:
    """Recordings below a folder such as raw_data/numerical_tank, at the rate of the models.

    Attributes
    ----------
    folder : Path
    rate_hz : float
    """

    folder: Path
    rate_hz: float

    def vfa(self, duration_s: int) -> LiquidSignals:
        """Return the slow run of a duration over frequency and amplitude."""
        return self._shaken(f"shaker/{FILL}_vfa_{duration_s}s").at_rate(self.rate_hz)

    def sweep(self, level_g: float) -> LiquidSignals:
        """Return the upward sweep at a level."""
        return self._shaken(f"shaker/{FILL}_sweep_{level_g:.2f}g").at_rate(self.rate_hz)

    def sudden_starts(self, *, between: bool) -> list[LiquidSignals]:
        """Return sudden starts, those between the others or the others, with rest before them."""
        chosen = SUDDEN_STARTS_BETWEEN if between else SUDDEN_STARTS
        names = [
            f"transients/{FILL}_sudden_start_{frequency_hz:.1f}hz_{level_g:.2f}g_repeat_{repeat}"
            for frequency_hz, levels_g in chosen
            for level_g in levels_g
            for repeat in (1, 2)
        ]
        return [self._rested(self._shaken(name)) for name in names]

    def decays(self, deflection_mm: float) -> list[LiquidSignals]:
        """Return repeats of a decay of the beam, the release `REST_S` after the first sample."""
        return [self._rested(self._on_beam(name)) for name in _decay_names(deflection_mm)]

    def has_decays(self, deflection_mm: float) -> bool:
        """Return whether the decays from a deflection are there: not every campaign has the smaller ones."""
        return all((self.folder / f"{name}.nc").is_file() for name in _decay_names(deflection_mm))

    def beam_random(self, rms_g: float) -> LiquidSignals:
        """Return motion of the tank on the beam whose root moves at random."""
        return self._on_beam(f"beam/random_{rms_g:.1f}g").at_rate(self.rate_hz)

    @cached_property
    def shaker_rig(self) -> Rig:
        """Rig of the shaker."""
        return Rig.from_toml(self.folder / "shaker" / f"rig_{FILL}.toml")

    @cached_property
    def beam_rig(self) -> Rig:
        """Rig of the beam."""
        return Rig.from_toml(self.folder / "beam" / "rig_beam.toml")

    def _rested(self, signals: LiquidSignals) -> LiquidSignals:
        return from_rest(signals, self.rate_hz, rest_s=REST_S)

    def _shaken(self, name: str) -> LiquidSignals:
        return self._signals(name, self.shaker_rig, self._dry_on_shaker)

    def _on_beam(self, name: str) -> LiquidSignals:
        return self._signals(name, self.beam_rig, self._dry_on_beam)

    def _signals(self, name: str, rig: Rig, dry: DryMass) -> LiquidSignals:
        path = self.folder / f"{name}.nc"
        if not path.is_file():
            raise InputError(f"{path}", got="no such recording", remedy="make it: make tank-campaign")
        signals = liquid_signals(read_recording(path), rig, dry_mass_kg=dry.mass_kg, gain_ratio=dry.gain_ratio)
        return LiquidSignals(
            signals.velocity_m_per_s,
            signals.dynamic_force_n,
            signals.acceleration_m_per_s2,
            signals.sampling_rate_hz,
            path.stem,
        )

    @cached_property
    def _dry_on_shaker(self) -> DryMass:
        return self._dry_mass([f"shaker/{FILL}_{kind}_3.00g" for kind in ("empty", "frozen")], self.shaker_rig)

    @cached_property
    def _dry_on_beam(self) -> DryMass:
        return self._dry_mass(["beam/decay_frozen"], self.beam_rig)

    def _dry_mass(self, names: list[str], rig: Rig) -> DryMass:
        runs = [read_recording(self.folder / f"{name}.nc") for name in names]
        return identify_dry_mass(
            [run for run in runs if run.attrs["configuration"] == "empty"],
            [run for run in runs if run.attrs["configuration"] == "frozen"],
            liquid_mass_kg=rig.liquid_mass_kg,
            force_names=force_channels(runs[0]),
            acceleration_names=acceleration_channels(runs[0]),
        )


def _decay_names(deflection_mm: float) -> list[str]:
    if deflection_mm == 14.6:
        return [f"beam/decay_sloshing_repeat_{repeat}" for repeat in (1, 2, 3)]
    return [f"transients/beam_decay_{deflection_mm:.1f}mm_repeat_{repeat}" for repeat in (1, 2, 3)]


def part(signals: LiquidSignals, start_s: float, stop_s: float) -> LiquidSignals:
    """Return a stretch of a run."""
    chosen = slice(round(start_s * signals.sampling_rate_hz), round(stop_s * signals.sampling_rate_hz))
    return LiquidSignals(
        signals.velocity_m_per_s[chosen],
        signals.dynamic_force_n[chosen],
        signals.acceleration_m_per_s2[chosen],
        signals.sampling_rate_hz,
        f"{signals.name}, {start_s:g} … {stop_s:g} s",
    )
