"""The runs of the numerical tank's campaign: which, on which rig, with which settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from acquisition.virtual_laboratory.campaign import rig_name, rig_text

HALF_FULL: Final = 0.50
OTHER_FILLS: Final = (0.25, 0.75)
HALF_FULL_ACCELERATIONS_G: Final = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
TRANSIENTS: Final = "transients"
SUDDEN_STARTS: Final = (
    (9.0, (2.0, 4.0)),
    (10.0, (1.5, 3.0, 5.0)),
    (11.0, (2.0, 4.0, 6.0)),
    (12.0, (3.0, 5.0, 7.0)),
    (13.0, (4.0, 6.0, 8.0)),
)
"""Frequency in Hz and levels in g, up to what the stroke allows."""
SUDDEN_STARTS_BETWEEN: Final = ((9.5, (3.0,)), (10.5, (2.5, 4.5)), (11.5, (3.5, 6.0)), (12.5, (5.0,)))
"""Between those, for the validation of what was trained on them."""
LONG_STROKE: Final = "long_stroke"
# the other shaker's stroke ends at 6 g there, and sweeps that end at 6 g do not tell the saturation of the liquid
LONG_STROKE_M: Final = 0.025
LONG_STROKE_SWEEPS: Final = ((3.0, 3), (4.0, 1), (5.0, 1), (6.0, 1), (7.0, 1), (8.0, 2))
"""Levels in g, beyond what the other shaker's stroke allows at 9 … 11.5 Hz, and how often each."""
OTHER_ACCELERATIONS_G: Final = (0.5, 1.5, 3.0, 4.0, 6.0)
"""From below the threshold over the rise and the maximum to the decline, within what the source shows."""

_BEAM_TEXT = """\
# The tank at the tip of a clamped aluminium beam.
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.314   # tank, lid and fittings; with the liquid 0.4385 kg at the tip

[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.50

[structure]           # with the liquid frozen
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, 1.0, 1.0]

[twin]
tank_model = "frozen"
"""

_SDOF_TEXT = """\
# A tank on springs, guided vertically.
[tank]
height_m = 0.060
length_m = 0.100
width_m = 0.060
dry_mass_kg = 2.061

[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.50

[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58

[twin]
tank_model = "frozen"
"""

BEAM_RIG: Final = "beam/rig_beam.toml"
SDOF_RIG: Final = "sdof/rig_sdof.toml"
TRANSIENTS_RIG: Final = f"{TRANSIENTS}/{rig_name(HALF_FULL)}"
SMALLER_DECAYS_RIG: Final = f"{TRANSIENTS}/rig_beam.toml"
LONG_STROKE_RIG: Final = f"{LONG_STROKE}/{rig_name(HALF_FULL)}"


def _shaker_rig(fill_level: float) -> str:
    return f"shaker/{rig_name(fill_level)}"


RIG_TEXTS: Final[Mapping[str, str]] = {
    **{_shaker_rig(fill): rig_text(fill) for fill in (OTHER_FILLS[0], HALF_FULL, OTHER_FILLS[1])},
    TRANSIENTS_RIG: rig_text(HALF_FULL),
    SMALLER_DECAYS_RIG: _BEAM_TEXT,
    LONG_STROKE_RIG: rig_text(HALF_FULL).replace("the electrodynamic shaker", "a shaker of twice the stroke"),
    BEAM_RIG: _BEAM_TEXT,
    SDOF_RIG: _SDOF_TEXT,
}
"""File name below the campaign's folder → text."""


@dataclass(frozen=True)
class NumericalRun:
    """One recording of the campaign.

    Attributes
    ----------
    name : str
        File name below the campaign's folder, without suffix.
    rig : str
        Key of `RIG_TEXTS`.
    number : int
        Its place; seed and time of start follow from it.
    settings : mapping
        Arguments of `virtual_shaker_run` or `virtual_structure_run`.
    """

    name: str
    rig: str
    number: int
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_on_shaker(self) -> bool:
        """False if the tank is on a structure."""
        return str(self.settings["experiment"]).startswith(("shaker_", "sudden_"))

    @property
    def is_computed(self) -> bool:
        """False if no liquid moves in the tank."""
        return str(self.settings["configuration"]) == "sloshing"


def numerical_runs() -> list[NumericalRun]:
    """All runs of the campaign."""
    listed = [*_half_full_runs(), *_other_fill_runs(), *_beam_runs(), *_sdof_runs()]
    # new ones at the end: seeds follow from the place
    listed += [*_sudden_starts(), *_smaller_decays(), *_long_stroke_sweeps()]
    return [NumericalRun(name, rig, number, settings) for number, (name, rig, settings) in enumerate(listed)]


_Listed = tuple[str, str, dict[str, Any]]


def _half_full_runs() -> list[_Listed]:
    runs = [*_still_runs(HALF_FULL), *(_sweep(HALF_FULL, level_g) for level_g in HALF_FULL_ACCELERATIONS_G)]
    runs += [_sweep(HALF_FULL, 3.0, suffix=f"_repeat_{repeat}", repeat=repeat) for repeat in (2, 3)]
    runs.append(_sweep(HALF_FULL, 3.0, prefix="sweep_down", direction="down"))
    vfa = {"experiment": "shaker_vfa", "configuration": "sloshing", "acceleration_g": 6.0}
    return runs + [
        (f"shaker/fill_0.50_vfa_{duration_s}s", _shaker_rig(HALF_FULL), {**vfa, "duration_s": float(duration_s)})
        for duration_s in (480, 240)
    ]


def _other_fill_runs() -> list[_Listed]:
    runs: list[_Listed] = []
    for fill_level in OTHER_FILLS:
        runs += [*_still_runs(fill_level), *(_sweep(fill_level, level_g) for level_g in OTHER_ACCELERATIONS_G)]
    return runs


def _still_runs(fill_level: float) -> list[_Listed]:
    """Without liquid and with it frozen: what rests on the cells."""
    return [
        (
            f"shaker/fill_{fill_level:.2f}_{configuration}_3.00g",
            _shaker_rig(fill_level),
            {
                "experiment": "shaker_sweep",
                "configuration": configuration,
                "acceleration_g": 3.0,
                "duration_s": 60.0,
            },
        )
        for configuration in ("empty", "frozen")
    ]


def _sweep(fill_level: float, level_g: float, prefix: str = "sweep", suffix: str = "", **more: Any) -> _Listed:
    settings = {
        "experiment": "shaker_sweep",
        "configuration": "sloshing",
        "acceleration_g": level_g,
        "duration_s": 240.0,
        **more,
    }
    return f"shaker/fill_{fill_level:.2f}_{prefix}_{level_g:.2f}g{suffix}", _shaker_rig(fill_level), settings


def _beam_runs() -> list[_Listed]:
    decay = {"experiment": "beam_free", "initial_displacement_m": -0.0146, "duration_s": 10.0}
    runs: list[_Listed] = [("beam/decay_frozen", BEAM_RIG, {**decay, "configuration": "frozen"})]
    for repeat in (1, 2, 3):
        settings = {**decay, "configuration": "sloshing", "repeat": repeat}
        runs.append((f"beam/decay_sloshing_repeat_{repeat}", BEAM_RIG, settings))
    for rms_g in (0.1, 0.2, 0.4):
        settings = {"experiment": "beam_random", "configuration": "sloshing", "rms_g": rms_g, "duration_s": 90.0}
        runs.append((f"beam/random_{rms_g:.1f}g", BEAM_RIG, settings))
    return runs


def _sdof_runs() -> list[_Listed]:
    decay = {"experiment": "sdof_free", "initial_displacement_m": 0.064, "duration_s": 6.0}
    return [
        (f"sdof/decay_{configuration}", SDOF_RIG, {**decay, "configuration": configuration})
        for configuration in ("frozen", "sloshing")
    ]


def _sudden_starts() -> list[_Listed]:
    """From rest at once to one frequency and level, each twice."""
    return [
        _transient(
            f"sudden_start_{frequency_hz:.1f}hz_{level_g:.2f}g_repeat_{repeat}",
            experiment="sudden_start",
            acceleration_g=level_g,
            start_hz=frequency_hz,
            duration_s=5.0,
            repeat=repeat,
        )
        for frequency_hz, levels_g in (*SUDDEN_STARTS, *SUDDEN_STARTS_BETWEEN)
        for level_g in levels_g
        for repeat in (1, 2)
    ]


def _smaller_decays() -> list[_Listed]:
    """Decays of the beam from smaller deflections than those of `_beam_runs`."""
    decay = {"experiment": "beam_free", "configuration": "sloshing", "duration_s": 5.0}
    return [
        (
            f"{TRANSIENTS}/beam_decay_{1e3 * deflection_m:.1f}mm_repeat_{repeat}",
            SMALLER_DECAYS_RIG,
            {**decay, "initial_displacement_m": -deflection_m, "repeat": repeat},
        )
        for deflection_m in (0.0065, 0.0100)
        for repeat in (1, 2, 3)
    ]


def _long_stroke_sweeps() -> list[_Listed]:
    """Slow sweeps over the beam's frequency on a shaker of twice the stroke, as fast as the others."""
    settings = {
        "experiment": "shaker_sweep",
        "configuration": "sloshing",
        "start_hz": 9.0,
        "stop_hz": 11.5,
        "duration_s": 45.0,
        "stroke_limit_m": LONG_STROKE_M,
    }
    return [
        (
            f"{LONG_STROKE}/fill_{HALF_FULL:.2f}_{LONG_STROKE}_sweep_{level_g:.2f}g"
            + f"_repeat_{repeat}" * (n_repeats > 1),
            LONG_STROKE_RIG,
            {**settings, "acceleration_g": level_g, "repeat": repeat},
        )
        for level_g, n_repeats in LONG_STROKE_SWEEPS
        for repeat in range(1, n_repeats + 1)
    ]


def _transient(name: str, **settings: Any) -> _Listed:
    return f"{TRANSIENTS}/fill_{HALF_FULL:.2f}_{name}", TRANSIENTS_RIG, {**settings, "configuration": "sloshing"}
