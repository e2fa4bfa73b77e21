"""From numbers in a file to a channel in SI: units, calibration, sign, delay, clipping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.files.channel_map import ChannelSection, quantity_of
from acquisition.files.table import Column, FloatArray
from sloshlab.errors import ChannelMapError, UnitsError
from sloshlab.units import SI_UNITS, factor_to_si

# a reading at the limit may miss it by the last digit of the conversion
_LIMIT_TOLERANCE = 1e-9
_IN_UNITS = ("range_min", "range_max", "noise_std")
# names of UDUNITS; its "g" is the gram
_GRAVITY_NAMES = ("gravity", "standard_free_fall", "gn")


@dataclass(frozen=True)
class Scaling:
    """value in SI = `factor` · value in the file + `offset`; the sign is in both.

    `to_range_units`, `range_offset` give the number that the sensor's range is stated in, unsigned;
    `range_to_si` goes on to SI, sign included.
    """

    units_read: str
    factor: float
    offset: float
    to_range_units: float
    range_offset: float
    range_to_si: float
    traps: tuple[str, ...]


def scaling_of(channel: str, section: ChannelSection, column: Column) -> Scaling:
    """How numbers of a column become SI.

    Raises
    ------
    ChannelMapError
        If units are missing, or file and map contradict each other.
    UnitsError
        If units are unknown or of another quantity.
    """
    quantity = quantity_of(channel)
    place = f"channels.{channel}"
    traps: list[str] = []
    calibration = section.calibration
    units = _agreed_units(place, section, column, quantity, traps)
    gain, zero, final_units = 1.0, 0.0, units
    if calibration is not None:
        gain = calibration.factor * _converted(units, calibration.from_units, f"{place}.calibration.from")
        zero, final_units = calibration.offset, calibration.to_units
    try:
        to_si = factor_to_si(final_units, quantity)
    except UnitsError as error:
        raise UnitsError(
            f"{place}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
        ) from error
    signed = to_si * section.sign
    return Scaling(final_units, gain * signed, zero * signed, gain, zero, signed, tuple(traps))


def with_declared(section: ChannelSection, column: Column) -> ChannelSection:
    """The section of the map, with what the file says about the sensor where the map says nothing.

    Ranges and noise of the file are in its units: they are left out where the map reads other units or calibrates.
    """
    declared = dict(column.declared)
    is_same = column.units is not None and (section.units is None or same_units(section.units, column.units))
    # a range in volts is none in newtons
    if section.calibration is not None or not is_same:
        declared = {key: value for key, value in declared.items() if key not in _IN_UNITS}
    # one end of the map and one of the file would be a range that nobody stated
    if section.range_min is not None or section.range_max is not None:
        declared = {key: value for key, value in declared.items() if not key.startswith("range_")}
    known = {key: value for key, value in declared.items() if key in ChannelSection.model_fields}
    missing = {key: value for key, value in known.items() if getattr(section, key) is None}
    free = {key: value for key, value in declared.items() if key not in known}
    return section.model_copy(update={**missing, "attributes": {**free, **section.attributes}})


def _agreed_units(place: str, section: ChannelSection, column: Column, quantity: str, traps: list[str]) -> str:
    """Units of the numbers in the file: what the map states, where it states any."""
    calibration = section.calibration
    stated, in_file = section.units or (calibration.from_units if calibration else None), column.units
    if stated is None and in_file is None:
        raise ChannelMapError(
            f"{place}.units",
            got="nothing, neither in the map nor in the file",
            allowed=f"units of column {column.name!r}, for example {SI_UNITS[quantity]!r}",
            remedy="state units",
        )
    if stated is None:
        assert in_file is not None
        return in_file
    if in_file is None or same_units(stated, in_file):
        return stated
    if in_file == "g" and stated in _GRAVITY_NAMES and quantity == "acceleration":
        traps.append(f"{place}: the file writes 'g' (the gram in UDUNITS); read as gravity, as the map says")
        return stated
    if not section.units_override:
        calibrated_hint = " (units before calibration)" if calibration is not None else ""
        raise ChannelMapError(
            f"{place}.units",
            got=f"{stated!r}{calibrated_hint}, but the file labels column {column.name!r} {in_file!r}",
            allowed="the file's units, or units_override = true",
            remedy="find out which is right; with units_override = true the map wins and the report says so",
        )
    traps.append(
        f"{place}: a {quantity} labelled {in_file!r} in the file is read as {stated!r}, as the map overrides"
    )
    return stated


def same_units(first: str, second: str) -> bool:
    """Whether two texts mean the same units.

    Examples
    --------
    >>> same_units("m/s^2", "m s-2"), same_units("N", "kN"), same_units("N", "g")
    (True, False, False)
    """
    if first == second:
        return True
    try:
        return _converted(first, second, "units") == 1.0
    except UnitsError:
        return False


def _converted(units: str, other: str, place: str) -> float:
    import cf_units

    if units == other:
        return 1.0
    try:
        source, target = cf_units.Unit(units), cf_units.Unit(other)
        usable = source.is_convertible(target) and not source.is_time_reference() and not source.is_unknown()
        # units with an offset, as degrees, are refused: a factor alone would be wrong
        if usable and source.convert(0.0, target) == 0.0:
            return float(source.convert(1.0, target))
    except (ValueError, TypeError) as error:
        raise UnitsError(place, got=f"{units!r} and {other!r}", allowed="UDUNITS text") from error
    raise UnitsError(
        place,
        got=f"{other!r} for a column in {units!r}",
        allowed=f"units convertible to {units!r}, without an offset",
    )


def clipped_samples(values: FloatArray, scaling: Scaling, section: ChannelSection) -> NDArray[np.bool_]:
    """Which samples of a column lie at or beyond the range stated for the sensor."""
    clipped = np.zeros(values.size, dtype=bool)
    if section.range_min is None and section.range_max is None:
        return clipped
    measured = values * scaling.to_range_units + scaling.range_offset
    if section.range_max is not None:
        clipped |= measured >= section.range_max - _LIMIT_TOLERANCE * abs(section.range_max)
    if section.range_min is not None:
        clipped |= measured <= section.range_min + _LIMIT_TOLERANCE * abs(section.range_min)
    return clipped


def converted_values(values: FloatArray, scaling: Scaling) -> FloatArray:
    """A copy of the values in SI, upward positive."""
    converted: FloatArray = values * scaling.factor
    if scaling.offset:
        converted += scaling.offset
    return converted


def channel_attributes(channel: str, section: ChannelSection, column: Column, scaling: Scaling) -> dict[str, Any]:
    """Attributes of the channel in the recording; ranges and noise in SI."""
    quantity = quantity_of(channel)
    attributes: dict[str, Any] = {"units": SI_UNITS[quantity], "quantity": quantity, "source_column": column.name}
    if column.units is not None:
        attributes["source_units"] = column.units
    limits = {
        key: value * scaling.range_to_si
        for key, value in (("range_min", section.range_min), ("range_max", section.range_max))
        if value is not None
    }
    if section.sign < 0:
        # turned round, upward positive: the lowest reading is the largest value
        limits = {("range_max" if key == "range_min" else "range_min"): value for key, value in limits.items()}
    attributes.update(limits)
    if section.noise_std is not None:
        attributes["noise_std"] = section.noise_std * abs(scaling.range_to_si)
    for key in ("block_from", "block_to", "x_m"):
        value = getattr(section, key)
        if value is not None:
            attributes[key] = value
    if section.delay_s:
        key = "delay_compensated_s" if section.delay == "compensate" else "delay_s"
        attributes[key] = section.delay_s
    attributes.update(section.attributes)
    return attributes
