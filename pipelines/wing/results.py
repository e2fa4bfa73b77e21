"""What the pipeline of a wing is asked for, and what it finds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.aircraft.response_file import RecordedCase, RecordedResponse
from pipelines.flutter.analysis import Stability
from sloshlab.aeroelastic.generalised_force_cache import CacheStatus
from sloshlab.aeroelastic.root_locus import Crossing
from sloshlab.aircraft.limit_cycle import BranchPoint
from sloshlab.aircraft.oscillation_measures import LimitCycle, PeakDamping
from sloshlab.aircraft.vertical_sloshing import LARGEST_ACCELERATION_G, TankDeparture
from sloshlab.aircraft.wing_calibration import WingState
from sloshlab.aircraft.wing_energy import EnergyMap
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]

BETA_HAT: Final = -0.154
"""Effective-mass fraction at 0.25 g that the source prints for (3.14)."""
GUSTS: Final = ((266.0, 6.0), (315.0, 3.0), (321.0, 1.5), (321.0, 0.15), (321.0, 2.5))
"""Speed and w_ga of the source's gusts [m/s] (Figs. 3.7–3.10)."""
FROZEN: Final = "frozen"
SLOSHING: Final = "sloshing"
"""Models: frozen liquids, and trained networks in all tanks."""
LOWEST_LEVEL_G: Final = 0.25
"""Of the sweeps on the shaker; what a tank does that moves less is told in a table, and not flagged."""
SMALL_GUST_M_PER_S: Final = 0.15
"""w_ga of the bifurcation diagram (Fig. 3.11)."""
LOWEST_SPEED_M_PER_S: Final = 250.0
HIGHEST_SPEED_M_PER_S: Final = 360.0
"""Of the root locus (Fig. 3.5)."""


@dataclass(frozen=True)
class WingSettings:
    """What was asked for.

    Attributes
    ----------
    calibrate : bool
        Solve the stiffness for the targets of the file anew.
    match_fold_m_per_s : float, optional
        Of a second wing, whose tanks are as small as needed for its limit cycle to end there.
    duration_s : float
        Of each gust.
    gust_length_m : float, optional
        L_g; 25 semi-chords unless stated.
    first_m_per_s, last_m_per_s, n_bifurcation : float, float, int
        Speeds of the bifurcation.
    longest_s : float
        Waited for a limit cycle at each speed.
    n_speeds : int
        Of the root locus.
    """

    calibrate: bool = False
    match_fold_m_per_s: float | None = None
    duration_s: float = 20.0
    gust_length_m: float | None = None
    first_m_per_s: float = 316.0
    last_m_per_s: float = 340.0
    n_bifurcation: int = 13
    longest_s: float = 60.0
    n_speeds: int = 56

    def __post_init__(self) -> None:
        if not 1 <= self.duration_s <= 1000:
            raise InputError("--duration", got=f"{self.duration_s:g} s", allowed="1 … 1000 s")
        if not LOWEST_SPEED_M_PER_S <= self.first_m_per_s < self.last_m_per_s <= HIGHEST_SPEED_M_PER_S:
            raise InputError(
                "--from and --to",
                got=f"{self.first_m_per_s:g} and {self.last_m_per_s:g}",
                allowed=f"{LOWEST_SPEED_M_PER_S:g} ≤ from < to ≤ {HIGHEST_SPEED_M_PER_S:g}",
            )
        if not 2 <= self.n_bifurcation <= 1000:
            raise InputError("--speeds", got=f"{self.n_bifurcation}", allowed="2 … 1000")
        if not (self.gust_length_m is None or 0 < self.gust_length_m <= 1e5):
            raise InputError("--gust-length", got=f"{self.gust_length_m:g}", allowed="> 0 m")
        if not 10 <= self.longest_s <= 10_000:
            raise InputError("--patience", got=f"{self.longest_s:g} s", allowed="10 … 10000 s")
        fold = self.match_fold_m_per_s
        if fold is not None and not self.first_m_per_s < fold < HIGHEST_SPEED_M_PER_S:
            raise InputError("--match-fold", got=f"{fold:g}", allowed="a speed beyond flutter")

    @property
    def bifurcation_speeds_m_per_s(self) -> FloatArray:
        """From the lowest to the highest, evenly."""
        return np.linspace(self.first_m_per_s, self.last_m_per_s, self.n_bifurcation)


@dataclass(frozen=True, eq=False)
class Reading:
    """One model in one gust, read at the tip.

    Attributes
    ----------
    record : RecordedResponse
    displacement_m, acceleration_m_per_s2 : ndarray, shape (n_times,)
    damping : PeakDamping
        Of the acceleration after the gust, from a peak to the third one.
    end : LimitCycle
        Of the displacement.
    """

    record: RecordedResponse
    displacement_m: FloatArray
    acceleration_m_per_s2: FloatArray
    damping: PeakDamping
    end: LimitCycle

    @property
    def first_damping_ratio(self) -> float:
        """Mean over the first three cycles after the gust; NaN where there are none."""
        first = self.damping.damping_ratio[:6]
        return float(first.mean()) if first.size else float("nan")


@dataclass(frozen=True, eq=False)
class GustCase:
    """A gust, and what all models made of it.

    Attributes
    ----------
    case : RecordedCase
    readings : mapping of str to Reading
        By the name of the model.
    printed_m_per_s : float
        w_ga of the source; the case has less where tanks would leave 6 g, as the source chose its own.
    """

    case: RecordedCase
    readings: Mapping[str, Reading]
    printed_m_per_s: float = float("nan")


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """Limit cycles over the speed.

    Attributes
    ----------
    from_rest, up, down : tuple of BranchPoint
        Each after the small gust from rest; continued from the one before with rising and with falling speed.
    """

    from_rest: tuple[BranchPoint, ...]
    up: tuple[BranchPoint, ...]
    down: tuple[BranchPoint, ...]

    @property
    def fold_m_per_s(self) -> float:
        """Middle between the last speed with a limit cycle and the first where motion diverges; NaN if none."""
        lost = [point.speed_m_per_s for point in self.up if point.ending]
        kept = [point.speed_m_per_s for point in self.up if not point.ending]
        return 0.5 * (min(lost) + max(kept)) if lost and kept else float("nan")

    @property
    def onset_m_per_s(self) -> float:
        """Middle between the last speed where the motion dies and the first with a limit cycle, going down."""
        living = [point.speed_m_per_s for point in self.down if point.is_alive]
        dead = [p.speed_m_per_s for p in self.down if not p.is_alive and living and p.speed_m_per_s < min(living)]
        return 0.5 * (min(living) + max(dead)) if living and dead else float("nan")

    @property
    def flags(self) -> list[str]:
        """Limit cycles at which a tank leaves 6 g."""
        points = (*self.from_rest, *self.up, *self.down)
        largest = LARGEST_ACCELERATION_G * GRAVITY_M_PER_S2
        beyond = [p.speed_m_per_s for p in points if p.is_alive and p.largest_tank_acceleration_m_per_s2 > largest]
        return [f"limit cycles have tanks beyond 6 g from {min(beyond):g} m/s on"] if beyond else []


@dataclass(frozen=True, eq=False)
class EnergyBalance:
    """Energy maps of the critical mode.

    Attributes
    ----------
    frozen, effective : EnergyMap
        In the mode of the wing with frozen liquids, and with the effective mass of the map at low level.
    beta : float
        That effective-mass fraction.
    """

    frozen: EnergyMap
    effective: EnergyMap
    beta: float


@dataclass(frozen=True, eq=False)
class FillCurve:
    """Flutter speed over the fill level, frozen; NaN where none was found."""

    fill_level: FloatArray
    flutter_speed_m_per_s: FloatArray
    flutter_frequency_rad_per_s: FloatArray


def _matters(departure: TankDeparture) -> bool:
    """Whether a departure is flagged: not where the tank moved less than at the lowest level of any training."""
    reason = departure.reason
    return isinstance(reason, str) or reason.acceleration_g >= LOWEST_LEVEL_G


@dataclass(frozen=True, eq=False)
class WingResult:
    """One wing.

    Attributes
    ----------
    state : WingState
    stability : Stability
        With frozen liquids.
    effective_mass : mapping of float to Crossing or None
        Flutter with an effective mass in all tanks, by its fraction.
    fills : FillCurve
    gusts : tuple of GustCase
    bifurcation : Bifurcation
    energy : EnergyBalance or None
        Without maps there is none.
    dampers : GustCase or None
        Dampers of (E.8) beside the trained model.
    damping_n_s_per_m : mapping
        c of each tank by the choice, as of (E.8).
    landing : GustCase or None
    notes : tuple of str
        What could not be computed, and why.
    """

    state: WingState
    stability: Stability
    effective_mass: Mapping[float, Crossing | None]
    fills: FillCurve
    gusts: tuple[GustCase, ...]
    bifurcation: Bifurcation
    energy: EnergyBalance | None = None
    dampers: GustCase | None = None
    damping_n_s_per_m: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    landing: GustCase | None = None
    notes: tuple[str, ...] = ()

    @property
    def cases(self) -> tuple[GustCase, ...]:
        """Gusts, dampers in a gust, landing."""
        more = (self.dampers, self.landing)
        return (*self.gusts, *(case for case in more if case is not None))

    @property
    def departures(self) -> list[tuple[str, TankDeparture]]:
        """Tanks that left what their model knows, with the name of the case, each once."""
        runs = [(case.case.name, run) for case in self.gusts for run in case.case.runs]
        if self.landing is not None:
            runs += [("landing", run) for run in self.landing.case.runs]
        return [(name, departure) for name, run in runs for departure in run.departures]

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the results; that tanks move less than any training is told in a table."""
        targets = self.state.described.calibration
        found = [] if targets is None else self.state.misses(targets)
        found += [*self.stability.flags, *self.notes]
        found += [f"{name}: {one}" for name, one in self.departures if _matters(one)]
        found += self.bifurcation.flags
        found += [
            f"{case.case.name}, {run.model}: {run.response.ending}"
            for case in self.cases
            for run in case.case.runs
            if run.response.ending and run.model != FROZEN
        ]
        return tuple(found)


@dataclass(frozen=True, eq=False)
class WingExperiment:
    """Everything of chapter 3.1 and of the wing of appendix E that could be computed.

    Attributes
    ----------
    settings : WingSettings
    inputs : tuple of Path
    wing : WingResult
    cache : CacheStatus
        Of the forces of the air.
    w_bar : xarray.DataArray or None
        The measured map.
    matched : WingResult or None
        The wing of ``--match-fold``.
    matched_share : float
        Of its liquid over that of the wing.
    provenance : dict
    """

    settings: WingSettings
    inputs: tuple[Path, ...]
    wing: WingResult
    cache: CacheStatus
    w_bar: xr.DataArray | None = None
    matched: WingResult | None = None
    matched_share: float = float("nan")
    provenance: dict[str, object] = field(default_factory=dict)

    @property
    def wings(self) -> tuple[tuple[str, WingResult], ...]:
        """The wing, and the one of ``--match-fold``, with what they are called."""
        return (("wing", self.wing), *((("matched wing", self.matched),) if self.matched is not None else ()))

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the results."""
        several = len(self.wings) > 1
        found = [f"{name}: {flag}" if several else flag for name, wing in self.wings for flag in wing.flags]
        if self.cache is CacheStatus.DAMAGED:
            found.append(f"generalised forces were {self.cache.value}")
        return tuple(found)
