"""Stiffness of a beam wing that flutters at a wanted speed and at a wanted multiple of its first dry frequency.

Both wanted numbers are inputs then. With Mach number and density fixed, all stiffness times s and speeds times √s
is the same flutter at √s times the frequency: EI at the root sets the speed in one step, GJ/EI the ratio of
frequencies, and only the extra damping of modes above a frequency breaks the similarity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, log, pi
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.root_locus import Crossing, RootLocus, root_locus
from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.wing_air import WingAir, air_on_modes
from sloshlab.aircraft.wing_file import CalibrationTargets, WingDescription
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]
SPEED_TOLERANCE_M_PER_S: Final = 0.1
RATIO_TOLERANCE: Final = 0.005
"""How near the wanted numbers must be met; bars of the project."""
_SPEED_GOAL, _RATIO_GOAL = 0.02, 5e-4
"""Where turns end."""
_MOST_TURNS: Final = 25
_SEARCH: Final = (0.5, 1.5)
"""Of the wanted speed, where flutter is looked for."""
_N_SPEEDS: Final = 17
_LARGEST_STEP: Final = log(1.5)
"""Of log GJ/EI in a turn."""
_BENDING: Final = "mode 1"
_USUAL_SLOPE: Final = 0.8
"""Of ω_F/ω₁ over log GJ/EI, near the wing of the project; a stiffer torsion raises it."""


@dataclass(frozen=True, eq=False)
class WingState:
    """A wing with the air of its modes, and where it flutters with frozen liquids.

    Attributes
    ----------
    described : WingDescription
    model : AircraftModel
    air : WingAir
    flutter : Crossing or None
        The first of the branch of the first bending mode, as in the source; of any branch if that one has none.
    earlier : Crossing or None
        Flutter of another branch at a lower speed.
    """

    described: WingDescription
    model: AircraftModel
    air: WingAir
    flutter: Crossing | None
    earlier: Crossing | None = None

    @property
    def first_frequency_rad_per_s(self) -> float:
        """ω₁ of the dry wing."""
        return float(2 * pi * self.model.structure.frequencies_hz[0])

    @property
    def frequency_ratio(self) -> float:
        """ω_F/ω₁; NaN without flutter."""
        return (
            float("nan")
            if self.flutter is None
            else self.flutter.frequency_rad_per_s / self.first_frequency_rad_per_s
        )

    def misses(self, targets: CalibrationTargets) -> list[str]:
        """Which wanted numbers are not met, one line each."""
        if self.flutter is None:
            return ["calibration: no flutter in the range that was searched"]
        found = []
        if self.earlier is not None:
            found.append(
                f"calibration: {self.earlier.origin} flutters at {self.earlier.speed_m_per_s:.2f} m/s, before "
                f"{self.flutter.origin}"
            )
        speed, wanted = self.flutter.speed_m_per_s, targets.flutter_speed_m_per_s
        if not abs(speed - wanted) <= SPEED_TOLERANCE_M_PER_S:
            found.append(
                f"calibration: flutter at {speed:.2f} m/s, wanted {wanted:g} ± {SPEED_TOLERANCE_M_PER_S:g}"
            )
        if not abs(self.frequency_ratio - targets.frequency_ratio) <= RATIO_TOLERANCE:
            found.append(
                f"calibration: ω_F/ω₁ = {self.frequency_ratio:.4f}, wanted {targets.frequency_ratio:g} "
                f"± {RATIO_TOLERANCE:g}"
            )
        return found


def frozen_locus(model: AircraftModel, air: WingAir, speeds_m_per_s: FloatArray) -> RootLocus:
    """Root locus of a wing with frozen liquids."""
    density = model.density_kg_per_m3
    system = flight_system(model, air.motion, "frozen", density_kg_per_m3=density)
    return root_locus(system.matrix_at, speeds_m_per_s, system.names)


def wing_state(described: WingDescription, nodes: GeneralisedForces, around_m_per_s: float) -> WingState:
    """Modes, air and flutter of a wing.

    Parameters
    ----------
    described : WingDescription
    nodes : GeneralisedForces
        Air on its nodes.
    around_m_per_s : float
        Flutter is looked for from half to one and a half of it.
    """
    model = wing_model(described)
    air = air_on_modes(nodes, model.structure, described.aerodynamics)
    speeds = around_m_per_s * np.linspace(*_SEARCH, _N_SPEEDS)
    crossings = [one for one in frozen_locus(model, air, speeds).crossings if one.kind == "flutter"]
    chosen = next((one for one in crossings if one.origin == _BENDING), next(iter(crossings), None))
    return WingState(
        described, model, air, chosen, crossings[0] if chosen not in crossings[:1] and chosen else None
    )


def calibrated(
    described: WingDescription,
    nodes: GeneralisedForces,
    targets: CalibrationTargets,
    *,
    advance: Callable[[str], None] | None = None,
) -> WingState:
    """The wing with the stiffness that meets two wanted numbers, in turns: EI for the speed, a secant for GJ/EI.

    Parameters
    ----------
    described : WingDescription
        Whose stiffness is where the search starts.
    nodes : GeneralisedForces
        Air on its nodes.
    targets : CalibrationTargets
    advance : callable, optional
        Told each turn.

    Returns
    -------
    WingState
        The nearest that was found; `WingState.misses` tells whether it is near enough.

    Raises
    ------
    InputError
        If the wing does not flutter where the search starts.
    """
    log_ratio, slope = log(described.wing.torsion_over_bending), _USUAL_SLOPE
    last: tuple[float, float] | None = None
    nearest: WingState | None = None
    bending = described.wing.root_bending_stiffness_n_m2
    for turn in range(_MOST_TURNS):
        state = wing_state(
            _with_stiffness(described, bending, exp(log_ratio)), nodes, targets.flutter_speed_m_per_s
        )
        if state.flutter is None:
            break
        speed_miss = state.flutter.speed_m_per_s - targets.flutter_speed_m_per_s
        ratio_miss = state.frequency_ratio - targets.frequency_ratio
        if advance is not None:
            advance(
                f"turn {turn + 1}: {state.flutter.speed_m_per_s:.2f} m/s, ω_F/ω₁ = {state.frequency_ratio:.4f}"
            )
        if nearest is None or _distance(state, targets) < _distance(nearest, targets):
            nearest = state
        if abs(speed_miss) <= _SPEED_GOAL and abs(ratio_miss) <= _RATIO_GOAL:
            return state
        bending *= (targets.flutter_speed_m_per_s / state.flutter.speed_m_per_s) ** 2
        # the ratio does not depend on EI, so that it counts at whatever speed this turn flutters
        if last is not None and abs(log_ratio - last[0]) > 1e-12:
            # where another mode takes over the flutter, the ratio jumps, and a secant would lead away
            secant = (ratio_miss - last[1]) / (log_ratio - last[0])
            slope = secant if secant > 0.1 * _USUAL_SLOPE else _USUAL_SLOPE
        last = (log_ratio, ratio_miss)
        if abs(ratio_miss) > _RATIO_GOAL:
            log_ratio -= float(np.clip(ratio_miss / slope, -_LARGEST_STEP, _LARGEST_STEP))
    if nearest is None:
        low, high = (share * targets.flutter_speed_m_per_s for share in _SEARCH)
        raise InputError(
            "calibration", got=f"no flutter from {low:.0f} to {high:.0f} m/s at the start",
            remedy="start from another root_bending_stiffness_n_m2 or torsion_over_bending",
        )  # fmt: skip
    return nearest


def _distance(state: WingState, targets: CalibrationTargets) -> float:
    assert state.flutter is not None
    speed = abs(state.flutter.speed_m_per_s - targets.flutter_speed_m_per_s) / SPEED_TOLERANCE_M_PER_S
    return speed + abs(state.frequency_ratio - targets.frequency_ratio) / RATIO_TOLERANCE


def _with_stiffness(
    described: WingDescription, bending_n_m2: float, torsion_over_bending: float
) -> WingDescription:
    changed = {"root_bending_stiffness_n_m2": bending_n_m2, "torsion_over_bending": torsion_over_bending}
    return described.model_copy(update={"wing": described.wing.model_copy(update=changed)})
