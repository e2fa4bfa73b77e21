"""The command `replay`: a recording, the virtual rig or a test pattern played as devices."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import signal as signals
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.devices.appearance import Appearance, appearance
from acquisition.devices.connection import MOST_CONNECTIONS
from acquisition.devices.endpoint import Awaited
from acquisition.devices.faults import Faults
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.played_signal import played_signal
from acquisition.devices.player import Player
from acquisition.devices.signal import LoopedSignal
from acquisition.devices.simulated_device import simulated_device
from acquisition.sources.urls import parse_url
from pipelines.report.free_place import require_free_place
from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import InputError

_STEP_S = 0.1
"""Between two looks at the devices."""
_PATIENCE_S = 5.0
"""Before a host that has not come is missed; a device that nobody has started yet is no news."""
_SLOWEST, _FASTEST = 1e-3, 1e4


@dataclass(frozen=True)
class ReplaySettings:
    """What `sloshlab replay` is asked to do.

    Attributes
    ----------
    source : str
        ``RUN.nc``, ``virtual:shaker_sweep?rig=RIG.toml&…`` or ``pattern:channels=8&…``.
    urls : sequence of str
        Where each device appears.
    channels : sequence of str
        Names joined by commas, once per device; all channels on every device if empty.
    speed : str
        A factor of real time, or ``max``.
    faults : sequence of Path or None
        TOML files, once per device; None is a device without faults.
    samples_per_frame : int or None
        Of serial devices.
    expose : str or None
        Address to listen on instead of the loopback interface.
    free_run : bool
        Do not wait to be started.
    wait_clients : int
        Clients that a socketcand device waits for.
    seed : int
    loop_duration_s : float or None
        Repeat the recording until it is so long.
    truth : Path or None
        JSON file for what each device did.
    overwrite : bool
        Whether a truth that is there may be replaced.
    """

    source: str
    urls: Sequence[str]
    channels: Sequence[str] = ()
    speed: str = "1"
    faults: Sequence[Path | None] = ()
    samples_per_frame: int | None = None
    expose: str | None = None
    free_run: bool = False
    wait_clients: int = 1
    seed: int = 0
    loop_duration_s: float | None = None
    truth: Path | None = None
    overwrite: bool = False


def replay(
    settings: ReplaySettings,
    *,
    announce: Callable[[str], None] | None = None,
    remind: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Play until every device has said everything and its hosts have read it.

    Parameters
    ----------
    settings : ReplaySettings
    announce : callable, optional
        Called with ``ready URL`` for each device as soon as a host can open that URL, in the order of
        `urls`, and with a line for each port that is exposed. Standard output if not given.
    remind : callable, optional
        Called with a line for each device that still waits for hosts, if others have come and none has for 5 s.
        Standard error if not given.

    Returns
    -------
    dict
        ``lines``, ``flags`` (none: what a device does to its samples on purpose is no failure), and per
        device how many samples it took and sent and how often each fault struck.

    Raises
    ------
    SloshlabError
        If an argument is wrong or a device cannot appear.
    """
    if settings.truth is not None:
        require_free_place(settings.truth, overwrite=settings.overwrite, described="truth")
    told = announce or say
    places = _places(settings)
    laboratory = LaboratoryTime(len(places), speed=_speed(settings.speed))
    players = _players(settings, places, laboratory)
    with contextlib.ExitStack() as cleaning, _stopped_by_signal(players):
        for place, player in zip(places, players, strict=True):
            cleaning.callback(player.endpoint.close)
            if settings.expose and place.listens:
                told(place.exposure())
            told(f"ready {player.endpoint.open()}")
        _run(players, _Reminder([place.device for place in places], remind or functools.partial(say, error=True)))
    return _summary(settings, places, players)


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not _SLOWEST <= speed <= _FASTEST:
        raise InputError("--speed", got=repr(text), allowed=f"{_SLOWEST:g} … {_FASTEST:g}, or max")
    return speed


def _places(settings: ReplaySettings) -> list[Appearance]:
    if not settings.urls:
        raise InputError("--as", got="nothing", allowed="at least one URL")
    urls = enumerate(settings.urls, start=1)
    places = [appearance(parse_url(url), number=number, expose=settings.expose) for number, url in urls]
    names = [place.device for place in places]
    if len(set(names)) < len(names):
        raise InputError("--as", got=f"devices {', '.join(names)}", allowed="names that differ")
    _require_used(settings, places)
    for option, values in (("--channels", settings.channels), ("--faults", settings.faults)):
        if len(values) not in (0, len(places)):
            raise InputError(option, got=f"{len(values)} times", allowed=f"once for each of {len(places)} devices")
    return places


def _require_used(settings: ReplaySettings, places: Sequence[Appearance]) -> None:
    """Refuse options that no device would heed, and more clients than a device lets in."""
    if not 1 <= settings.wait_clients <= MOST_CONNECTIONS:
        allowed = f"1 … {MOST_CONNECTIONS}"
        raise InputError("--wait-clients", got=str(settings.wait_clients), allowed=allowed)
    if settings.wait_clients > 1 and not any(place.most_hosts > 1 for place in places):
        raise InputError("--wait-clients", got="no socketcand device", allowed="--as can:socketcand?…")
    if settings.samples_per_frame is not None and not any(place.takes_samples_per_frame for place in places):
        raise InputError("--samples-per-frame", got="no serial device", allowed="--as serial:…")


def _players(settings: ReplaySettings, places: Sequence[Appearance], laboratory: LaboratoryTime) -> list[Player]:
    players = []
    for number, place in enumerate(places):
        names = settings.channels[number].split(",") if settings.channels else None
        played = played_signal(settings.source, names)
        if settings.loop_duration_s is not None:
            played = LoopedSignal(played, duration_s=settings.loop_duration_s)
        players.append(
            simulated_device(
                played,
                place,
                laboratory,
                faults=_faults(settings, number),
                seed=settings.seed * 1000 + number,
                samples_per_frame=settings.samples_per_frame if place.takes_samples_per_frame else None,
                n_hosts=settings.wait_clients if place.most_hosts > 1 else 1,
                runs_freely=settings.free_run,
            )
        )
    return players


def _faults(settings: ReplaySettings, number: int) -> Faults | None:
    path = settings.faults[number] if settings.faults else None
    return None if path is None else Faults.from_toml(path)


class _Reminder:
    """Says who is missing when some hosts have asked their devices to begin and others have not for a while."""

    def __init__(self, devices: Sequence[str], say: Callable[[str], None]) -> None:
        self._devices, self._say = devices, say
        self._seen: list[Awaited] = []
        self._since_s, self._has_told = 0.0, True

    def look(self, players: Sequence[Player]) -> None:
        """Tell what has not changed for too long, once."""
        awaited = [player.awaited for player in players]
        if awaited != self._seen:
            self._seen, self._since_s, self._has_told = awaited, time.monotonic(), False
        has_begun = any(waited_for.n_missing < waited_for.n_hosts for waited_for in awaited)
        if self._has_told or not has_begun or time.monotonic() - self._since_s < _PATIENCE_S:
            return
        self._has_told = True
        for device, waited_for in zip(self._devices, awaited, strict=True):
            if waited_for.n_missing > 0:
                self._say(
                    f"waiting: {device} for {waited_for.n_missing} of {waited_for.n_hosts} hosts; Ctrl-C ends"
                )


def _run(players: Sequence[Player], reminder: _Reminder) -> None:
    """Every device in a thread of its own; the first error of any ends all and is raised here."""
    errors: list[BaseException] = []
    threads = [threading.Thread(target=_play, args=(player, errors), daemon=True) for player in players]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        for thread in threads:
            thread.join(_STEP_S)
        reminder.look(players)
        if errors:
            _stop(players)
    if errors:
        raise errors[0]


def _play(player: Player, errors: list[BaseException]) -> None:
    try:
        player.play()
    except Exception as error:  # noqa: BLE001 - raised again in the main thread
        errors.append(error)


def _stop(players: Sequence[Player]) -> None:
    for player in players:
        player.stop()


@contextlib.contextmanager
def _stopped_by_signal(players: Sequence[Player]) -> Iterator[None]:
    """Interrupt and termination end the devices in order, so that nothing is left behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    known = {number: signals.getsignal(number) for number in (signals.SIGINT, signals.SIGTERM)}
    for number in known:
        signals.signal(number, lambda *_: _stop(players))
    try:
        yield
    finally:
        for number, handler in known.items():
            signals.signal(number, handler)


def _summary(settings: ReplaySettings, places: Sequence[Appearance], players: Sequence[Player]) -> dict[str, Any]:
    truths = {place.device: player.truth for place, player in zip(places, players, strict=True)}
    if settings.truth is not None:
        told = {device: truth.to_json() for device, truth in truths.items()}
        with atomic_file.replaced(settings.truth, overwrite=settings.overwrite) as temporary:
            temporary.write_text(json.dumps(told, indent=1, sort_keys=True) + "\n")
    lines = []
    for place, player in zip(places, players, strict=True):
        numbers = ", ".join(f"{key.replace('_', ' ')} {n}" for key, n in player.truth.summary().items())
        gone = "; the host went before the end" if player.has_lost_host else ""
        lines.append(f"{place.device}: {numbers}{gone}")
    devices = {
        place.device: {**player.truth.summary(), "host_gone": player.has_lost_host}
        for place, player in zip(places, players, strict=True)
    }
    return {"lines": lines, "flags": [], "devices": devices}
