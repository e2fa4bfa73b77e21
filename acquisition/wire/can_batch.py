"""Frames of a CAN bus as arrays, whatever brought them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquisition.wire.can_bits import FrameBytes, IntArray

_CLASSIC, _FD = 8, 64


@dataclass(frozen=True, eq=False)
class FrameBatch:
    """Frames in order of arrival.

    Attributes
    ----------
    arbitration_id : ndarray of int64, shape (n_frames,)
    extended, remote, fd : ndarray of bool, shape (n_frames,)
        29-bit identifier; remote frame, without data; frame of CAN FD.
    length : ndarray of int64, shape (n_frames,)
        Data bytes of each frame.
    data : ndarray of uint8, shape (n_frames, 8 or 64)
        Zero beyond `length`.
    """

    arbitration_id: IntArray
    extended: NDArray[np.bool_]
    remote: NDArray[np.bool_]
    fd: NDArray[np.bool_]
    length: IntArray
    data: FrameBytes

    def __len__(self) -> int:
        return len(self.arbitration_id)

    def __getitem__(self, wanted: slice | NDArray[Any]) -> FrameBatch:
        """Some of the frames."""
        return FrameBatch(*(getattr(self, name)[wanted] for name in self.__dataclass_fields__))

    def followed_by(self, other: FrameBatch) -> FrameBatch:
        """These frames and then others."""
        if not len(self) or not len(other):
            return self if len(self) else other
        width = max(self.data.shape[1], other.data.shape[1])
        data = np.zeros((len(self) + len(other), width), np.uint8)
        data[: len(self), : self.data.shape[1]] = self.data
        data[len(self) :, : other.data.shape[1]] = other.data
        return FrameBatch(
            np.concatenate([self.arbitration_id, other.arbitration_id]),
            np.concatenate([self.extended, other.extended]),
            np.concatenate([self.remote, other.remote]),
            np.concatenate([self.fd, other.fd]),
            np.concatenate([self.length, other.length]),
            data,
        )

    @classmethod
    def empty(cls) -> Self:
        """No frames."""
        return cls.from_messages([])

    @classmethod
    def from_messages(cls, messages: Sequence[Any]) -> Self:
        """Take messages of python-can apart; error frames are none and must be sorted out before.

        Examples
        --------
        >>> import can
        >>> batch = FrameBatch.from_messages([can.Message(arbitration_id=5, data=b"ab", is_extended_id=False)])
        >>> batch.arbitration_id.tolist(), batch.length.tolist(), batch.data.shape
        ([5], [2], (1, 8))
        """
        contents = [b"" if message.is_remote_frame else bytes(message.data) for message in messages]
        length = np.array([len(content) for content in contents], np.int64)
        # rows of 64 bytes for classic frames would be copied for nothing, eight times as much
        width = _FD if length.size and length.max() > _CLASSIC else _CLASSIC
        packed = b"".join([content.ljust(width, b"\0") for content in contents])
        return cls(
            np.array([message.arbitration_id for message in messages], np.int64),
            np.array([message.is_extended_id for message in messages], np.bool_),
            np.array([message.is_remote_frame for message in messages], np.bool_),
            np.array([message.is_fd for message in messages], np.bool_),
            length,
            np.frombuffer(packed, np.uint8).reshape(len(contents), width),
        )
