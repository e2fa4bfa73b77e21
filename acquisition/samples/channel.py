"""A channel as a device describes it: its name, its units and how a count becomes a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

# a device that describes itself wrongly must not make a recorder allocate for a million
MOST_CHANNELS: Final = 256
"""More channels than this in one device are refused."""

HIGHEST_SAMPLING_RATE_HZ: Final = 10e6


@dataclass(frozen=True)
class Channel:
    """One channel of a device; value in `units` = `scale_factor` · count + `add_offset`.

    Attributes
    ----------
    name : str
        Name in the recording, ``<quantity>_<place>``.
    quantity, units : str
        As in the recording format.
    bits : int
        Width of a count: 16, 24 or 32, signed.
    missing_count : int or None
        Count by which the device says that it has no reading.
    range_min, range_max, noise_std, x_m : float or None
        In `units`; as in the recording format.
    block_from, block_to : str or None
        For interface forces.
    sensor_serial : str or None
        Serial number of the sensor, where the device knows it.
    """

    name: str
    quantity: str
    units: str
    bits: int = 16
    scale_factor: float = 1.0
    add_offset: float = 0.0
    missing_count: int | None = None
    range_min: float | None = None
    range_max: float | None = None
    noise_std: float | None = None
    x_m: float | None = None
    block_from: str | None = None
    block_to: str | None = None
    sensor_serial: str | None = None


def attributes_of(channel: Channel) -> dict[str, Any]:
    """Attributes of the channel in a recording, without scaling.

    Examples
    --------
    >>> attributes_of(Channel("force_cell_1", "force", "N", range_min=-20.0))
    {'units': 'N', 'quantity': 'force', 'range_min': -20.0}
    """
    optional = ("range_min", "range_max", "noise_std", "x_m", "block_from", "block_to", "sensor_serial")
    found = {name: getattr(channel, name) for name in optional}
    return {
        "units": channel.units,
        "quantity": channel.quantity,
        **{k: v for k, v in found.items() if v is not None},
    }
