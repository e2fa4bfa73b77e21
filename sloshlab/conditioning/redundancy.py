"""Do sensors that measure the same motion agree?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.channel_names import ACCELERATION_CONTROL, ACCELERATION_ROOF
from sloshlab.conditioning.block_spectra import block_spectra, delay_s
from sloshlab.conditioning.gaps import require_channels
from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import blocks
from sloshlab.recording import channels

PHASE_ERROR_AT_HZ = 20.0
"""Delays are also stated as phase at this frequency, the upper end of the source's sweeps."""

_SMALLEST_COMMON_SHARE = 0.3
"""Sensors that have less than this in common move apart, not against each other: one may be silent."""


@dataclass(frozen=True)
class PairAgreement:
    """One sensor compared with the reference sensor.

    Attributes
    ----------
    name, reference : str
        The two channels.
    gain_ratio : float
        |y/x| around the dominant frequency; 1 when they agree.
    delay_s : float
        Positive: `name` comes later than `reference`.
    phase_error_at_20_hz_rad : float
        −2π·20 Hz·delay.
    sign : int
        −1 when the two move against each other.
    rms_disagreement : float
        RMS(y − x)/RMS(x), static means removed: gain, delay, noise and everything else together.
    """

    name: str
    reference: str
    gain_ratio: float
    delay_s: float
    phase_error_at_20_hz_rad: float
    sign: int
    rms_disagreement: float


@dataclass(frozen=True)
class SensorAgreement:
    """All redundant sensors of a recording compared with one of them.

    Attributes
    ----------
    reference : str
        The sensor compared with.
    pairs : tuple of PairAgreement
        One for each of the others.
    wrong_sign : tuple of str
        Sensors that move against the majority; both of two that move against each other.
    """

    reference: str
    pairs: tuple[PairAgreement, ...]
    wrong_sign: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """The same as plain dictionaries and numbers."""
        return asdict(self)

    def to_dataset(self) -> xr.Dataset:
        """The pairs as variables over `sensor`."""
        rows = [asdict(pair) for pair in self.pairs]
        units = {"delay_s": "s", "phase_error_at_20_hz_rad": "rad"}
        variables = {
            key: ("sensor", [row[key] for row in rows], {"units": units.get(key, "1")})
            for key in (
                "gain_ratio",
                "delay_s",
                "phase_error_at_20_hz_rad",
                "sign",
                "rms_disagreement",
            )
        }
        names = [pair.name for pair in self.pairs]
        return xr.Dataset(variables, coords={"sensor": names}, attrs={"reference": self.reference})


def redundant_accelerometers(recording: xr.Dataset) -> list[str]:
    """Accelerometers of a rigid tank that must read the same: on the roof, and the control."""
    accelerations = channels(recording, "acceleration")
    # a tip of a beam or a root moves otherwise: only what is fixed to the rigid tank must agree
    return [name for name in accelerations if name.startswith((ACCELERATION_ROOF, ACCELERATION_CONTROL))]


def agreement(recording: xr.Dataset, names: Sequence[str], reference: str | None = None) -> SensorAgreement:
    """Compare sensors that measure the same quantity at the same place.

    Parameters
    ----------
    recording : xarray.Dataset
        A recording in SI units.
    names : sequence of str
        Two channels or more, of one quantity.
    reference : str, optional
        The one to compare with; the first if not given.

    Returns
    -------
    SensorAgreement
        Gains, delays and signs around the dominant frequency of each second; samples lost in either
        channel of a pair are left out.

    Raises
    ------
    AnalysisError
        If channels are missing, fewer than two, of different quantities, or have no common second
        without lost samples.
    """
    compared_with = _checked_reference(recording, names, reference)
    others = [name for name in names if name != compared_with]
    pairs = tuple(_compared(recording, name, compared_with) for name in others)
    return SensorAgreement(compared_with, pairs, _wrong_signs(compared_with, pairs))


def require_equal_signs(agreed: SensorAgreement) -> None:
    """Refuse to go on when a sensor moves against the others.

    Raises
    ------
    AnalysisError
        Naming the sensor; with only two that disagree, both.
    """
    if not agreed.wrong_sign:
        return
    names = " or ".join(agreed.wrong_sign)
    everybody = [agreed.reference, *(pair.name for pair in agreed.pairs)]
    both = len(agreed.wrong_sign) == len(everybody)
    raise AnalysisError(
        f"{names}: sign",
        got=f"moves against {'each other' if both else 'the other sensors'}",
        allowed=f"the same sign for {', '.join(everybody)}, upward positive",
        remedy=f"set sign = -1 for {names} in the channel map",
    )


def _checked_reference(recording: xr.Dataset, names: Sequence[str], reference: str | None) -> str:
    require_channels(recording, names)
    quantities = {str(recording[name].attrs.get("quantity")) for name in names}
    if len(set(names)) < 2 or len(quantities) != 1:
        raise AnalysisError(
            "redundant sensors",
            got=f"{', '.join(names) or 'none'} ({', '.join(sorted(quantities))})",
            allowed="two or more different channels of one quantity",
        )
    chosen = names[0] if reference is None else reference
    if chosen not in names:
        raise AnalysisError("reference sensor", got=repr(chosen), allowed=", ".join(names))
    return chosen


def _compared(recording: xr.Dataset, name: str, reference: str) -> PairAgreement:
    x, y = recording[reference].values, recording[name].values
    spectra = block_spectra(recording, [name], x)
    delay, _ = delay_s(spectra, 0)
    ratio = spectra.ratio(0, delay)
    return PairAgreement(
        name=name,
        reference=reference,
        gain_ratio=abs(ratio),
        delay_s=delay,
        # e^{+jωt}: what comes later has the smaller phase
        phase_error_at_20_hz_rad=-2 * math.pi * PHASE_ERROR_AT_HZ * delay,
        # noise of a silent sensor has either sign: it must move against the other one to be called wrong
        sign=-1 if ratio < -_SMALLEST_COMMON_SHARE else 1,
        rms_disagreement=_rms_disagreement(x, y),
    )


def _wrong_signs(reference: str, pairs: Sequence[PairAgreement]) -> tuple[str, ...]:
    """The minority; everybody when it is a tie."""
    with_reference = [reference, *(pair.name for pair in pairs if pair.sign > 0)]
    against = [pair.name for pair in pairs if pair.sign < 0]
    if not against:
        return ()
    # of two that disagree neither is known to be right
    if len(against) == len(with_reference):
        return (*with_reference, *against)
    return tuple(against if len(against) < len(with_reference) else with_reference)


def _rms_disagreement(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> float:
    sums = _Sums(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for part in blocks(x.size, x, y):
        sums = _added(x[part], y[part], sums)
    n, _, _, sum_x, sum_xx, sum_d, sum_dd = sums
    if n == 0:
        return float("nan")
    # about the mean: static offsets of accelerometers are no disagreement about the motion
    variance_x = sum_xx / n - (sum_x / n) ** 2
    variance_d = max(sum_dd / n - (sum_d / n) ** 2, 0.0)
    return math.sqrt(variance_d / variance_x) if variance_x > 0 else float("nan")


class _Sums(NamedTuple):
    """Running sums where x and d = y − x are there, both taken from their first values to save digits."""

    n: int
    x_origin: float
    d_origin: float
    sum_x: float
    sum_xx: float
    sum_d: float
    sum_dd: float


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _added(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], before: _Sums) -> _Sums:
    """The sums with more samples."""
    n, x_origin, d_origin, sum_x, sum_xx, sum_d, sum_dd = before
    for i in range(x.size):
        d = float(y[i]) - float(x[i])
        if d != d:
            continue
        if n == 0:
            x_origin, d_origin = float(x[i]), d
        n += 1
        x_here = x[i] - x_origin
        d -= d_origin
        sum_x += x_here
        sum_xx += x_here * x_here
        sum_d += d
        sum_dd += d * d
    return _Sums(n, x_origin, d_origin, sum_x, sum_xx, sum_d, sum_dd)
