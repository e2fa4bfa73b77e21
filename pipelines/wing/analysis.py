"""The pipeline of a wing: from its file, a trained model and measured maps to everything of chapter 3.1."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from pipelines.aircraft.tank_models import load_tank_models
from pipelines.report.progress import progress
from pipelines.wing.gust_stages import damper_case, gust_case, landing_case
from pipelines.wing.results import BETA_HAT, GUSTS, WingExperiment, WingResult, WingSettings
from pipelines.wing.stability_stages import (
    FILL_LEVELS,
    bifurcation,
    energy_balance,
    energy_of,
    fill_curve,
    flutter_with_effective_mass,
    frozen_stability,
    locus_speeds,
    with_smaller_tanks,
)
from sloshlab.aeroelastic.generalised_force_cache import CacheStatus
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.linear_sloshing import DAMPER_CHOICES, dampers_of_map
from sloshlab.aircraft.wing_air import air_on_modes, air_on_nodes
from sloshlab.aircraft.wing_calibration import WingState, calibrated, wing_state
from sloshlab.aircraft.wing_file import WingDescription, load_wing
from sloshlab.errors import AnalysisError, InputError
from sloshlab.maps.map_readings import mean_along_acceleration
from sloshlab.twin.measured_maps import read_maps

Advance = Callable[[str], None]
_TURNS_OF_MATCHING = 6
_MATCHED_WITHIN = 0.01
"""Change of the liquid's share from turn to turn that ends the matching."""
_DAMPER_CASE = 1
"""Of `GUSTS`, in which dampers are compared (Fig. E.8)."""
_SEARCHED_FROM_M_PER_S = 319.3
"""Of files without targets: flutter is looked for around it."""


class _Pipeline:
    """What all stages share."""

    def __init__(
        self, path: Path, rom: Path, maps: Path | None, settings: WingSettings, cache: Path | None
    ) -> None:
        self.described = load_wing(path)
        self.settings, self.rom, self.cache = settings, rom, cache
        targets = self.described.calibration
        if targets is None and (settings.calibrate or settings.match_fold_m_per_s is not None):
            option = "--calibrate" if settings.calibrate else "--match-fold"
            raise InputError(option, got="a wing without [calibration]", remedy="state its two targets")
        if maps is None and settings.match_fold_m_per_s is not None:
            raise InputError("--match-fold", got="no --maps", remedy="give the measured maps, which tell the fold")
        # refused before any work, not after it
        load_tank_models(wing_model(self.described), rom)
        fills = {tank.fill_level for tank in self.described.tanks}
        self.maps = None if maps is None else read_maps(maps, fill_level=float(np.mean(list(fills))))

    @property
    def around_m_per_s(self) -> float:
        """Where flutter is looked for."""
        targets = self.described.calibration
        return _SEARCHED_FROM_M_PER_S if targets is None else targets.flutter_speed_m_per_s

    def air(self, mach: float) -> tuple[GeneralisedForces, CacheStatus]:
        """On the nodes."""
        described = self.described
        with progress(f"doublet lattice, Mach {mach:g}", described.aerodynamics.n_reduced_frequencies) as advance:
            return air_on_nodes(
                described, mach, cache=self.cache, progress=lambda _done, _everything, note: advance(note)
            )

    def state(self, described: WingDescription, nodes: GeneralisedForces, *, calibrate: bool) -> WingState:
        """The wing, with the stiffness of the file or one that meets the targets."""
        if not calibrate or described.calibration is None:
            return wing_state(described, nodes, self.around_m_per_s)
        return calibrated(described, nodes, described.calibration)

    def result(
        self, state: WingState, speeds: np.ndarray, landing_air: GeneralisedForces | None, advance: Advance
    ) -> WingResult:
        """Everything of one wing."""
        settings, described = self.settings, state.described
        tanks = load_tank_models(state.model, self.rom)
        stability = frozen_stability(state, locus_speeds(settings), advance)
        beta = () if self.maps is None else (mean_along_acceleration(self.maps["beta"], 0.25),)
        fractions = tuple(value for value in (BETA_HAT, -BETA_HAT, *beta) if np.isfinite(value))
        effective = flutter_with_effective_mass(state, fractions)
        gusts = tuple(gust_case(state, tanks, settings, gust, advance) for gust in GUSTS)
        damping, notes = self.dampers(state)
        dampers = damper_case(state, gusts[_DAMPER_CASE], damping, settings, advance) if damping else None
        landing = None
        if described.landing is not None and landing_air is not None:
            air = air_on_modes(landing_air, state.model.structure, described.aerodynamics)
            landing = landing_case(state, air, described.landing, tanks, settings, advance)
        return WingResult(
            state=state,
            stability=stability,
            effective_mass=effective,
            fills=fill_curve(described, state.air, advance),
            gusts=gusts,
            bifurcation=bifurcation(state, tanks, settings, speeds, advance),
            energy=None if self.maps is None else energy_balance(state, self.maps, settings),
            dampers=dampers,
            damping_n_s_per_m=damping,
            landing=landing,
            notes=notes,
        )

    def dampers(self, state: WingState) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
        """c of every tank by the choices of (E.8), or why the map does not tell them."""
        if self.maps is None or state.flutter is None:
            return {}, ()
        omega, w_bar = state.flutter.frequency_rad_per_s, self.maps["w_bar"]
        try:
            return {
                choice: dampers_of_map(state.model, w_bar, choice, frequency_rad_per_s=omega)
                for choice in DAMPER_CHOICES
            }, ()
        except AnalysisError as error:
            return {}, (f"no dampers: {error}",)

    def matched(self, start: WingState, nodes: GeneralisedForces, fold_m_per_s: float) -> tuple[WingState, float]:
        """The wing whose tanks take as much in the map as the air gives at a speed, calibrated; and its share.

        The share of the liquid is a fixed point: works of air and liquid at the speed tell by how much the liquid
        is too strong, with less of it the wing is calibrated anew.
        """
        assert self.maps is not None
        state, share = start, 1.0
        beta = mean_along_acceleration(self.maps["beta"], 0.25)
        with progress("matching the fold", _TURNS_OF_MATCHING) as advance:
            for _ in range(_TURNS_OF_MATCHING):
                factor = _balance_at(state, self.maps["w_bar"], beta, fold_m_per_s, self.settings)
                share *= factor
                advance(f"liquid × {share:.4f}")
                if abs(factor - 1) <= _MATCHED_WITHIN:
                    break
                smaller = with_smaller_tanks(start.described, share)
                state = self.state(
                    smaller.model_copy(update={"wing": state.described.wing}), nodes, calibrate=True
                )
        return state, share


def _balance_at(
    state: WingState, w_bar: xr.DataArray, beta: float, speed_m_per_s: float, settings: WingSettings
) -> float:
    """Work of air and structure over the most that the liquid can take, in the mode with effective mass."""
    works = energy_of(state, w_bar, beta if np.isfinite(beta) else 0.0, settings)
    row = int(np.argmin(np.abs(works.mode.speed_m_per_s - speed_m_per_s)))
    square = works.amplitude_m**2
    gained, taken = (works.aero + works.damping)[row] / square, -works.slosh[row] / square
    if not (gained[0] > 0 and np.isfinite(taken).any()):
        raise InputError(
            "--match-fold", got=f"{speed_m_per_s:g} m/s, where the critical mode does not grow",
            allowed="a speed beyond flutter",
        )  # fmt: skip
    return float(gained[0] / np.nanmax(taken))


def analyse_wing(
    path: Path, rom: Path, maps: Path | None, settings: WingSettings, *, cache: Path | None = None
) -> WingExperiment:
    """Stability, gusts, limit cycles, energy, dampers and landing of a wing.

    Parameters
    ----------
    path : Path
        TOML of the wing.
    rom : Path
        Trained model, of `sloshlab train`.
    maps : Path, optional
        `maps.nc` of `sloshlab shaker`, for energy maps and dampers.
    settings : WingSettings
    cache : Path, optional
        Folder that keeps generalised forces.
    """
    pipeline = _Pipeline(path, rom, maps, settings, cache)
    described = pipeline.described
    with threadpool_limits(1):  # matrices of a hundred rows: threads of BLAS only wait for one another
        nodes, status = pipeline.air(described.flow.mach)
        landing_air = None if described.landing is None else pipeline.air(described.landing.mach)[0]
        state = pipeline.state(described, nodes, calibrate=settings.calibrate)
        speeds = settings.bifurcation_speeds_m_per_s
        n_steps = 2 + len(GUSTS) + len(DAMPER_CHOICES) + 2 + len(FILL_LEVELS) + 3 * speeds.size
        with progress("wing", n_steps) as advance:
            wing = pipeline.result(state, speeds, landing_air, advance)
        matched, share = None, float("nan")
        if settings.match_fold_m_per_s is not None:
            other, share = pipeline.matched(state, nodes, settings.match_fold_m_per_s)
            with progress("matched wing", n_steps) as advance:
                near = _speeds_near(settings.match_fold_m_per_s, settings)
                matched = pipeline.result(other, near, landing_air, advance)
    files = (path, rom, *(() if maps is None else (maps,)))
    w_bar = None if pipeline.maps is None else pipeline.maps["w_bar"]
    return WingExperiment(settings, files, wing, status, w_bar, matched, share)


def _speeds_near(fold_m_per_s: float, settings: WingSettings) -> np.ndarray:
    """From the lowest speed to a bit beyond the fold."""
    return np.linspace(settings.first_m_per_s, fold_m_per_s + 2.0, settings.n_bifurcation)
