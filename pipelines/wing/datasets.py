"""`stability.nc`, `bifurcation.nc`, `energy.nc` and responses of a wing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import xarray as xr

from pipelines.aircraft.response_file import response_dataset
from pipelines.flutter.outputs import stability_dataset
from pipelines.wing.gust_stages import tip_node
from pipelines.wing.results import Bifurcation, EnergyBalance, GustCase, WingResult
from sloshlab.aircraft.limit_cycle import BranchPoint
from sloshlab.quantities import described

_BRANCHES: Final = ("from rest", "up", "down")


def stability(result: WingResult) -> xr.Dataset:
    """Roots over the speed; flutter over the fill level and with effective masses."""
    effective = result.effective_mass
    found = [effective[beta] for beta in effective]
    variables: dict[str, Any] = {
        "fill_flutter_speed": ("fill_level", result.fills.flutter_speed_m_per_s),
        "fill_flutter_frequency": ("fill_level", result.fills.flutter_frequency_rad_per_s),
        "effective_mass_flutter_speed": (
            "beta", [np.nan if one is None else one.speed_m_per_s for one in found]
        ),
    }  # fmt: skip
    coordinates = {"fill_level": result.fills.fill_level, "beta": np.array(list(effective))}
    more = described(xr.Dataset(variables, coords=coordinates))
    return stability_dataset((result.stability,)).merge(more)


def responses(result: WingResult) -> xr.Dataset:
    """Gusts with frozen and sloshing liquids and with dampers."""
    cases = [*result.gusts, *(() if result.dampers is None else (result.dampers,))]
    return response_dataset([case.case for case in cases], tip_node(result.state.model))


def landing(case: GustCase) -> xr.Dataset:
    """The landing: no gust, but the velocity of the fuselage."""
    node = tip_node(case.case.runs[0].response.flight.model)
    found = response_dataset([case.case], node).drop_vars(["gust_amplitude", "gust_length"])
    found = found.rename(w_gust="fuselage_velocity")
    return described(found)


def bifurcation(found: Bifurcation) -> xr.Dataset:
    """Ends of motions over the speed; NaN where a branch has no such speed."""
    branches: Mapping[str, Sequence[BranchPoint]] = dict(
        zip(_BRANCHES, (found.from_rest, found.up, found.down), strict=True)
    )
    speeds = sorted({point.speed_m_per_s for points in branches.values() for point in points})
    shape = (len(branches), len(speeds))
    values = {name: np.full(shape, np.nan) for name in ("cycle_amplitude", "cycle_frequency", "simulated_time")}
    converged, ending = np.zeros(shape, dtype=np.int8), np.full(shape, "", dtype=object)
    for row, points in enumerate(branches.values()):
        for point in points:
            place = (row, speeds.index(point.speed_m_per_s))
            values["cycle_amplitude"][place] = point.cycle.amplitude
            values["cycle_frequency"][place] = point.cycle.frequency_rad_per_s
            values["simulated_time"][place] = point.duration_s
            converged[place], ending[place] = point.cycle.is_converged, point.ending
    along = ("continuation", "speed")
    variables: dict[str, Any] = {name: (along, array) for name, array in values.items()}
    variables |= {"converged": (along, converged), "ending": (along, ending)}
    variables |= {"fold_speed": ((), found.fold_m_per_s), "onset_speed": ((), found.onset_m_per_s)}
    coordinates = {"continuation": np.array(list(branches), dtype=object), "speed": np.array(speeds)}
    return described(xr.Dataset(variables, coords=coordinates))


def energy(balance: EnergyBalance) -> xr.Dataset:
    """Works in a cycle, without and with the effective mass, and where their sum is zero."""
    both = (balance.frozen, balance.effective)
    mode = balance.frozen.mode
    along = ("beta", "speed", "tip_amplitude")
    variables: dict[str, Any] = {
        name: (along, np.array([getattr(one, name) for one in both]))
        for name in ("aero", "slosh", "damping", "total")
    }
    zeros = [
        (beta, *zero) for beta, one in zip((0.0, balance.beta), both, strict=True) for zero in one.limit_cycles()
    ]
    columns = ("zero_beta", "zero_speed", "zero_amplitude", "zero_is_stable")
    table = np.array([(*zero[:3], float(zero[3])) for zero in zeros]).reshape(-1, len(columns))
    variables |= {name: ("zero", table[:, number]) for number, name in enumerate(columns)}
    variables |= {"fold_speed": ("beta", [one.fold_m_per_s() for one in both])}
    variables |= {"cycle_frequency": (("beta", "speed"), np.array([one.mode.pole_rad_per_s.imag for one in both]))}
    coordinates = {
        "beta": np.array([0.0, balance.beta]),
        "speed": mode.speed_m_per_s,
        "tip_amplitude": balance.frozen.amplitude_m,
    }
    return described(xr.Dataset(variables, coords=coordinates))
