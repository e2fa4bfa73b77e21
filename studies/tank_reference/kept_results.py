"""Results of computations with the hashes of what they were computed from: read, checked, added to, written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab import atomic_file
from sloshlab.errors import InputError
from studies.steady_state import MeanOverCycles, mean_over_cycles
from studies.tank_reference.interfoam_case import InterfoamCase, inputs_hash
from studies.tank_reference.interfoam_readings import Reading, waiting_cycles
from studies.tank_reference.points import DrivenPoint

FloatArray = NDArray[np.float64]

KEPT: Final = Path(__file__).with_name("interfoam.json")
"""Of the repository: what nobody without OpenFOAM needs to compute."""
LARGEST_BYTES: Final = 10_000_000
_DIGITS: Final = 5


@dataclass(frozen=True)
class KeptResult:
    """What one case gave.

    Attributes
    ----------
    case : InterfoamCase
    inputs_sha256 : str
        Of the files that were computed from.
    program : str
        Solver and its version.
    w_bar, beta, body_force_w_bar : tuple of float
        Of every cycle.
    viscous_w_bar, stored_w_bar, largest_volume_change, height_over_rest : float
        As in `Reading`.
    """

    case: InterfoamCase
    inputs_sha256: str
    program: str
    w_bar: tuple[float, ...]
    beta: tuple[float, ...]
    body_force_w_bar: tuple[float, ...]
    viscous_w_bar: float
    stored_w_bar: float
    largest_volume_change: float
    height_over_rest: float

    def counted(self, name: str) -> MeanOverCycles:
        """Mean of `w_bar`, `beta` or `body_force_w_bar` over the cycles that count."""
        values = getattr(self, name)
        return mean_over_cycles(values[waiting_cycles(len(values)) :])

    @property
    def scheme_w_bar(self) -> float:
        """What neither resolved viscosity nor the stored energy accounts for: taken by the scheme."""
        return self.counted("w_bar").value - self.viscous_w_bar - self.stored_w_bar


def kept_result(case: InterfoamCase, reading: Reading, program: str) -> KeptResult:
    """What is kept of a case that was computed just now.

    Parameters
    ----------
    case : InterfoamCase
    reading : Reading
    program : str
    """
    per_cycle: dict[str, Any] = {
        name: tuple(round(float(value), _DIGITS) for value in getattr(reading, name))
        for name in ("w_bar", "beta", "body_force_w_bar")
    }
    numbers: dict[str, Any] = {
        name: float(f"{getattr(reading, name):.4g}")
        for name in ("viscous_w_bar", "stored_w_bar", "largest_volume_change", "height_over_rest")
    }
    return KeptResult(case, inputs_hash(case), program, **per_cycle, **numbers)


def written(results: Mapping[InterfoamCase, KeptResult]) -> bytes:
    """Results as JSON.

    Parameters
    ----------
    results : mapping
    """
    return (json.dumps([asdict(result) for result in results.values()], indent=1) + "\n").encode()


def write_results(results: Mapping[InterfoamCase, KeptResult], place: Path) -> None:
    """Write results to a file that is complete or as it was."""
    place.parent.mkdir(parents=True, exist_ok=True)
    atomic_file.write_bytes(place, written(results))


def read_results(place: Path = KEPT) -> dict[InterfoamCase, KeptResult]:
    """Results of a file.

    Parameters
    ----------
    place : Path
        By default that of the repository.

    Raises
    ------
    InputError
        If it cannot be read, or a result was computed from other inputs than its case has today.
    """
    try:
        if place.stat().st_size > LARGEST_BYTES:
            raise InputError(f"{place}", got=f"{place.stat().st_size} bytes", allowed=f"≤ {LARGEST_BYTES}")
        results = [_result(entry) for entry in json.loads(place.read_bytes())]
    except InputError:
        raise
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{place}", got=str(error), allowed="results of make tank-reference") from error
    for result in results:
        if result.inputs_sha256 != inputs_hash(result.case):
            raise InputError(
                f"{place}, {result.case.point.label}",
                got="a hash of other inputs",
                remedy="compute it again: make tank-reference",
            )
    return {result.case: result for result in results}


def _result(entry: Mapping[str, Any]) -> KeptResult:
    stated = dict(entry["case"])
    case = InterfoamCase(DrivenPoint(**stated.pop("point")), **stated)
    values = {field.name: _tupled(entry[field.name]) for field in fields(KeptResult) if field.name != "case"}
    return KeptResult(case, **values)


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
