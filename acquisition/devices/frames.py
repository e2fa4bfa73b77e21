"""Frames on their way from a device to its hosts, as arrays: what they hold, where they belong, when they go."""

from __future__ import annotations

import enum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

FrameArray = NDArray[np.void]
"""Structured array with one element per frame; fields of `_PLACE` and those of the transport."""

_PLACE: Final[list[tuple[str, Any]]] = [
    ("kind", np.uint8),
    ("group", np.int16),
    ("counter", np.int64),
    ("n_samples", np.int32),
    ("due_s", np.float64),
]
"""Kind of frame; group of channels, unwrapped counter of the first sample and number of samples of a frame with
samples; when the frame leaves, on the laboratory's clock."""

# frames differ in length: an array of bytes would be as wide as the longest
SERIAL_FRAME: Final = np.dtype([*_PLACE, ("bytes", object)])
"""``bytes``: the frame with the zero that ends it."""


class FrameKind(enum.IntEnum):
    """What a frame holds."""

    SAMPLES = 0
    CONTROL = 1
    """What the device says about itself and its state; no fault of frames touches it."""
    GARBAGE = 2
    ERROR = 3
    """Error frame of a CAN bus."""
    SPOILED = 4
    """Samples, damaged on purpose."""
    REPEATED = 5
    """Samples that were sent already."""


def can_frame(longest: int) -> np.dtype[np.void]:
    """Type of CAN frames with at most so many data bytes: ``id``, ``length`` and ``data``."""
    return np.dtype([*_PLACE, ("id", np.uint32), ("length", np.uint8), ("data", np.uint8, (longest,))])


def serial_frames(frames: list[bytes], kind: FrameKind = FrameKind.CONTROL, *, due_s: float = 0.0) -> FrameArray:
    """Serial frames that hold no samples."""
    made = np.zeros(len(frames), SERIAL_FRAME)
    made["kind"], made["due_s"] = kind, due_s
    for k, frame in enumerate(frames):
        made["bytes"][k] = frame
    return made


def place(frame: np.void) -> dict[str, int]:
    """Where a frame with samples belongs."""
    return {key: int(frame[key]) for key in ("group", "counter", "n_samples")}
