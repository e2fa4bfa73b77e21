"""What is tried: transports, faults and their intensities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from matrix_recordings import Motion, Pattern

N_SAMPLES = 2048
N_SAMPLES_MULTICAST = 1024
"""Multicast is sent at 4000 frames per second at most."""

SAMPLES_PER_FRAME = 4
SEED = 3
WRAP = 1 << 32


@dataclass(frozen=True)
class Transport:
    """Where the device appears; `{folder}` and `{port}` are filled in."""

    name: str
    url: str
    kind: str
    n_samples: int = N_SAMPLES


TRANSPORTS = {
    transport.name: transport
    for transport in (
        Transport("serial PTY", "serial:{folder}/tty", "serial"),
        Transport("serial socket", "serial:socket://127.0.0.1:0", "serial"),
        Transport("socketcand", "can:socketcand?port=0&dbc={folder}/d.dbc", "can"),
        Transport("slcan", "can:slcan?channel={folder}/tty&dbc={folder}/d.dbc", "can"),
        Transport("udp_multicast", "can:udp_multicast?port={port}&dbc={folder}/d.dbc", "can", N_SAMPLES_MULTICAST),
        Transport("CAN FD over slcan", "can:slcan?channel={folder}/tty&fd=yes&dbc={folder}/d.dbc", "fd"),
    )
}


@dataclass(frozen=True)
class Intensity:
    """One strength of a fault.

    Attributes
    ----------
    label : str
        For the table.
    toml : str or mapping of str to str
        The faults, by kind of transport if they differ; ``{last}`` is the last sample's number.
    signal : type
        What the device measures.
    ranges : mapping of str to float
        Limits ± of single channels.
    told : str or None
        Words in the summary that are the flag.
    speed : str
        Of the replay.
    not_on : mapping of str to str
        Kinds of transport on which it does not exist, and why.
    unseen : str
        Why nothing can tell, where that is so.
    most_given_up : float
        Share of the readings that may be lost though they were sent, on a classic CAN bus.
    """

    label: str
    toml: str | Mapping[str, str]
    signal: type[Pattern | Motion] = Pattern
    ranges: Mapping[str, float] = field(default_factory=dict)
    told: str | None = None
    speed: str = "max"
    not_on: Mapping[str, str] = field(default_factory=dict)
    unseen: str = ""
    most_given_up: float = 0.0


def _frames(fault: str, more: str = "", *, percent: float) -> str:
    return f"seed = {SEED}\n[{fault}]\nprobability = {percent / 100:g}\nat_counters = [0, {{last}}]\n{more}"


def _overrun(serial: str, can: str, fd: str) -> dict[str, str]:
    return {
        "serial": f"[overrun]\nfifo_bytes = 512\n{serial}",
        "can": f"[overrun]\nqueue_frames = 24\n{can}",
        "fd": f"[overrun]\nqueue_frames = 4\n{fd}",
    }


def _stalled(for_s: float) -> dict[str, str]:
    stall = f"stalls = [{{at_s = 0.5, for_s = {for_s}}}]\n"
    return _overrun(f"baud_rate = 230400\n{stall}", f"bit_rate = 5e5\n{stall}", f"bit_rate = 5e5\n{stall}")


def _unplugged(*times: tuple[float, float], restart: bool) -> str:
    text = f"restart = {str(restart).lower()}\n"
    return "".join(f"[[disconnect]]\nat_s = {at_s}\nfor_s = {for_s}\n{text}" for at_s, for_s in times)


def _sensor(fault: str, more: str) -> str:
    return f"[[{fault}]]\n{more}\n"


_ROOF = 'channel = "acceleration_roof_2"\n'
_CELL = "force_cell_1"
_ONLY_SERIAL = "a CAN device describes itself in its DBC file only, before anything is played"
_AROUND_GAPS = 0.025
"""18 frames per message and gap of more than 128 frames, at most two gaps, of 2048 or 1024 samples."""

_ANY_TIME = 0.1
"""A loss so regular that for a while it strikes each frame with the upper bits of the counter."""

_SWAPPED = "sensor swapped or gain wrong?"

FAULTS: dict[str, tuple[Intensity, ...]] = {
    "none": (Intensity("–", ""),),
    "drop": tuple(
        Intensity(f"{percent:g} % of the frames", _frames("drop", percent=percent)) for percent in (1, 10, 50)
    ),
    "duplicate": tuple(
        Intensity(f"{percent:g} % of the frames", _frames("duplicate", percent=percent)) for percent in (1, 10, 50)
    ),
    "reorder": tuple(
        Intensity(
            f"{percent:g} % of the frames, by {distance}",
            _frames("reorder", f"distance = {distance}\n", percent=percent),
        )
        for percent, distance in ((1, 1), (10, 5), (30, 40))
    ),
    "corrupt": tuple(
        Intensity(
            f"{n_bits} bit{'s' * (n_bits > 1)} in {percent:g} % of the frames",
            _frames("corrupt", f"n_bits = {n_bits}\n", percent=percent),
        )
        for percent, n_bits in ((1, 1), (10, 3), (50, 40))
    ),
    "garbage": tuple(
        Intensity(
            f"{n_bytes} bytes before {percent:g} % of the frames",
            _frames("garbage", f"n_bytes = {n_bytes}\n", percent=percent),
        )
        for percent, n_bytes in ((1, 8), (5, 64), (10, 256))
    ),
    "overrun": (
        Intensity("the host does not read for 0.2 s", _stalled(0.2)),
        Intensity("the host does not read for 1 s", _stalled(1.0), most_given_up=_AROUND_GAPS),
        Intensity(
            "a line at about half the speed needed",
            _overrun("baud_rate = 76800\n", "bit_rate = 1e5\n", "bit_rate = 4e4\n"),
            most_given_up=_ANY_TIME,
        ),
    ),
    "disconnect": (
        Intensity("0.1 s", _unplugged((0.5, 0.1), restart=False)),
        Intensity("0.75 s", _unplugged((0.5, 0.75), restart=False), most_given_up=_AROUND_GAPS),
        Intensity(
            "0.25 s and 0.5 s", _unplugged((0.5, 0.25), (1.25, 0.5), restart=False), most_given_up=_AROUND_GAPS
        ),
    ),
    "restart": (
        Intensity("0.1 s", _unplugged((0.5, 0.1), restart=True), most_given_up=_AROUND_GAPS),
        Intensity(
            "0.25 s and 0.5 s", _unplugged((0.5, 0.25), (1.25, 0.5), restart=True), most_given_up=_AROUND_GAPS
        ),
        Intensity(
            "0.5 s, in real time", _unplugged((0.5, 0.5), restart=True), speed="1", most_given_up=_AROUND_GAPS
        ),
    ),
    "clock offset": tuple(
        Intensity(f"{1e3 * offset_s:g} ms", f"[clock]\noffset_s = {offset_s}\n", Motion)
        for offset_s in (0.005, 0.05, 0.5)
    ),
    "clock drift": tuple(
        Intensity(f"{ppm:+g} ppm", f"[clock]\ndrift_ppm = {ppm}\n", Motion) for ppm in (100.0, -2000.0, 20_000.0)
    ),
    "clock jitter": tuple(
        Intensity(f"{1e6 * jitter_s:g} µs", f"[clock]\njitter_s = {jitter_s}\n", Motion)
        for jitter_s in (1e-5, 1e-4, 1e-3)
    ),
    "counter wrap": (
        Intensity("after 10 samples", f"[clock]\ncounter_start = {WRAP - 10}\n"),
        Intensity("after 777 samples", f"[clock]\ncounter_start = {WRAP - 777}\n"),
        Intensity(
            "after 777 samples, 10 % of the frames dropped",
            f"seed = {SEED}\n[clock]\ncounter_start = {WRAP - 777}\n[drop]\nprobability = 0.1\n",
        ),
    ),
    "stuck sensor": (
        Intensity("0.4 s", _sensor("stuck", _ROOF + "from_s = 0.5\nto_s = 0.9"), Motion),
        Intensity("1 s", _sensor("stuck", _ROOF + "from_s = 0.5\nto_s = 1.5"), Motion),
        Intensity("from the first sample on", _sensor("stuck", _ROOF), Motion),
        Intensity(
            "0.2 s, at the tip",
            _sensor("stuck", 'channel = "acceleration_tip"\nfrom_s = 0.5\nto_s = 0.7'),
            Motion,
            unseen="a count that stays for less than 0.25 s or 64 samples is no sign of anything",
        ),
    ),
    "clipped sensor": (
        *(
            Intensity(
                f"range ±{limit:g} N, force 30 N",
                _sensor("clipped", f'channel = "{_CELL}"\nlimit = {limit}'),
                Motion,
                {_CELL: limit},
            )
            for limit in (27.0, 18.0, 6.0)
        ),
        Intensity(
            "at ±18 N, range ±27 N",
            _sensor("clipped", f'channel = "{_CELL}"\nlimit = 18.0'),
            Motion,
            {_CELL: 27.0},
            unseen="the sensor ends before the range that it declares",
        ),
    ),
    "swapped sensors": (
        Intensity(
            "roof and tip, from the start",
            _sensor("swapped", 'channels = ["acceleration_roof_2", "acceleration_tip"]'),
            Motion,
            told=_SWAPPED,
        ),
        Intensity(
            "two cells, announced",
            _sensor(
                "swapped",
                'channels = ["force_cell_1", "force_cell_2"]\nfrom_s = 0.5\nannounced = true',
            ),
            Motion,
            told="the device describes its channels differently than before",
            not_on={"can": _ONLY_SERIAL, "fd": _ONLY_SERIAL},
        ),
        Intensity(
            "two cells, unannounced",
            _sensor("swapped", 'channels = ["force_cell_1", "force_cell_2"]\nfrom_s = 0.5'),
            Motion,
            unseen="nothing measures the same as a single cell; their sum, the total force, stays right",
        ),
    ),
}


@dataclass(frozen=True)
class Case:
    """One cell of the matrix."""

    fault: str
    intensity: Intensity
    transport: Transport

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.fault}, {self.intensity.label}, {self.transport.name}"

    @property
    def exists(self) -> bool:
        """Whether the fault can happen there."""
        return self.transport.kind not in self.intensity.not_on


def cases() -> Iterator[Case]:
    """All of them."""
    for fault, intensities in FAULTS.items():
        for intensity in intensities:
            for transport in TRANSPORTS.values():
                yield Case(fault, intensity, transport)
