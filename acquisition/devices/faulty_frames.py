"""Frames that get lost, come twice, in the wrong order or damaged, and bytes that are no frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.faults import Faults, FrameFault
from acquisition.devices.frames import FrameArray, FrameKind, place
from acquisition.devices.truth import Truth
from acquisition.devices.wire import Wire

Mask = NDArray[np.bool_]

_NAMES = ("drop", "duplicate", "reorder", "corrupt", "garbage")


class FrameFaults:
    """Faults of frames with samples, drawn per frame; what blocks the frames come in does not matter.

    A dropped frame suffers nothing else. A copy leaves directly after its frame, equally damaged.

    Parameters
    ----------
    faults : Faults
    wire : Wire
    seed : int
    truth : Truth
        Where every frame that was struck is noted.
    """

    def __init__(self, faults: Faults, wire: Wire, *, seed: int, truth: Truth) -> None:
        self._faults, self._wire, self._truth = faults, wire, truth
        # a generator for each fault: adding one does not change which frames another strikes
        self._chance = {name: np.random.default_rng([seed, 21, k]) for k, name in enumerate(_NAMES)}
        self._damage = np.random.default_rng([seed, 22])
        self._held: FrameArray | None = None
        self._held_places: NDArray[np.float64] = np.empty(0)
        self._n_seen = 0
        kinds: list[FrameFault] = [getattr(faults, name) for name in _NAMES]
        self._is_active = any(fault.probability or fault.at_counters for fault in kinds)

    def applied(self, frames: FrameArray, stream: int) -> FrameArray:
        """Frames as they leave; some are held back for a later call.

        Parameters
        ----------
        frames : FrameArray
            In the order of their making.
        stream : int
            For the truth.
        """
        if not self._is_active:
            return frames
        frames = frames.copy()
        at = np.arange(self._n_seen, self._n_seen + len(frames), dtype=np.float64)
        self._n_seen += len(frames)
        dropped = self._struck("drop", self._faults.drop, frames)
        struck = {name: self._struck(name, getattr(self._faults, name), frames) & ~dropped for name in _NAMES[1:]}
        self._note(frames, {"drop": dropped, **struck}, stream)
        # places between whole numbers: half behind a frame for what is late, a quarter for a copy, a quarter
        # before for noise
        at[struck["reorder"]] += self._faults.reorder.distance + 0.5
        for chosen in np.flatnonzero(struck["corrupt"]):
            self._wire.corrupted(frames, int(chosen), self._faults.corrupt.n_bits, self._damage)
            frames["kind"][chosen] = FrameKind.SPOILED
        copies = frames[struck["duplicate"]]
        copies["kind"] = FrameKind.REPEATED
        bursts = [self._burst(frames[chosen]) for chosen in np.flatnonzero(struck["garbage"])]
        places = [at[~dropped], at[struck["duplicate"]] + 0.25]
        places += [
            np.full(len(burst), at[chosen] - 0.25)
            for burst, chosen in zip(bursts, np.flatnonzero(struck["garbage"]), strict=True)
        ]
        return self._in_order([frames[~dropped], copies, *bursts], places)

    def flushed(self) -> FrameArray | None:
        """What is still held back."""
        held, self._held, self._held_places = self._held, None, np.empty(0)
        return held

    def _struck(self, name: str, fault: FrameFault, frames: FrameArray) -> Mask:
        """Which frames a fault strikes: one number is drawn for each frame with samples."""
        # calibration, status and end are never struck
        struck = frames["kind"] == FrameKind.SAMPLES
        drawn = np.ones(len(frames))
        # for every frame, also where the probability is 0: which frames are struck depends on the seed alone
        drawn[struck] = self._chance[name].random(int(struck.sum()))
        chosen = drawn < fault.probability
        if fault.at_counters:
            counters = np.sort(np.asarray(fault.at_counters, dtype=np.int64))
            first = np.searchsorted(counters, frames["counter"])
            after = np.searchsorted(counters, frames["counter"] + frames["n_samples"])
            chosen |= after > first
        return np.asarray(struck & chosen)

    def _note(self, frames: FrameArray, struck: dict[str, Mask], stream: int) -> None:
        for name, mask in struck.items():
            for chosen in np.flatnonzero(mask):
                self._truth.note(name, stream=stream, **place(frames[chosen]))

    def _burst(self, before: np.void) -> FrameArray:
        burst = self._wire.garbage(self._faults.garbage.n_bytes, self._damage)
        burst["due_s"] = before["due_s"]
        return burst

    def _in_order(self, parts: list[FrameArray], places: list[NDArray[np.float64]]) -> FrameArray:
        held = [] if self._held is None else [self._held]
        everything = np.concatenate([*held, *parts])
        at = np.concatenate([self._held_places, *places])
        order = np.argsort(at, kind="stable")
        # what comes after frames that do not exist yet is held back, across blocks as well
        leaving = at[order] < self._n_seen - 0.5
        self._held, self._held_places = everything[order[~leaving]], at[order[~leaving]]
        frames: FrameArray = everything[order[leaving]]
        # a late frame leaves no earlier than those that it waited for
        frames["due_s"] = np.maximum.accumulate(frames["due_s"]) if len(frames) else frames["due_s"]
        return frames
