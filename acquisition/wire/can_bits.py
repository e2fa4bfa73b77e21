"""Bit fields of CAN frames, read and written for many frames at once.

A field is where a DBC file says it is: `start_bit` is its least significant bit for little-endian
fields (Intel) and its most significant bit for big-endian ones (Motorola); bit b of a frame is bit
b mod 8 of byte b // 8.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FrameBytes = NDArray[np.uint8]
"""Data bytes of frames of one length, shape (n_frames, length)."""

IntArray = NDArray[np.int64]


class Piece(NamedTuple):
    """The part of a field that lies in one byte: `n_bits` from bit `shift` on, worth 2^`weight`."""

    byte: int
    shift: int
    n_bits: int
    weight: int


@dataclass(frozen=True)
class BitField:
    """Some bits of a frame that are one integer.

    Attributes
    ----------
    name : str
        Of the signal.
    start_bit, length : int
        As in a DBC file; 1 to 63 bits.
    big_endian, signed : bool
    """

    name: str
    start_bit: int
    length: int
    big_endian: bool = False
    signed: bool = False

    def pieces(self) -> tuple[Piece, ...]:
        """The bytes that hold the field.

        Examples
        --------
        >>> BitField("a", 4, 8).pieces()
        (Piece(byte=0, shift=4, n_bits=4, weight=0), Piece(byte=1, shift=0, n_bits=4, weight=4))
        >>> BitField("a", 3, 8, big_endian=True).pieces()
        (Piece(byte=0, shift=0, n_bits=4, weight=4), Piece(byte=1, shift=4, n_bits=4, weight=0))
        """
        return tuple(self._big_endian_pieces() if self.big_endian else self._little_endian_pieces())

    def _little_endian_pieces(self) -> Iterator[Piece]:
        weight = 0
        while weight < self.length:
            byte, shift = divmod(self.start_bit + weight, 8)
            n_bits = min(8 - shift, self.length - weight)
            yield Piece(byte, shift, n_bits, weight)
            weight += n_bits

    def _big_endian_pieces(self) -> Iterator[Piece]:
        # in DBC files big-endian fields start at their most significant bit and go on at bit 7 of the next byte
        byte, top = divmod(self.start_bit, 8)
        left = self.length
        while left:
            n_bits = min(top + 1, left)
            left -= n_bits
            yield Piece(byte, top + 1 - n_bits, n_bits, left)
            byte, top = byte + 1, 7

    @property
    def lowest(self) -> int:
        """Smallest value."""
        return -(1 << (self.length - 1)) if self.signed else 0

    @property
    def highest(self) -> int:
        """Largest value."""
        return (1 << (self.length - self.signed)) - 1

    def read(self, data: FrameBytes) -> IntArray:
        """Value of the field in every frame.

        Parameters
        ----------
        data : ndarray of uint8, shape (n_frames, length)

        Returns
        -------
        ndarray of int64, shape (n_frames,)

        Examples
        --------
        >>> BitField("a", 0, 16, signed=True).read(np.array([[0xFE, 0xFF], [1, 0]], np.uint8)).tolist()
        [-2, 1]
        """
        value: IntArray = np.zeros(len(data), np.int64)
        for byte, shift, n_bits, weight in self.pieces():
            part = data[:, byte] if n_bits == 8 else (data[:, byte] >> shift) & ((1 << n_bits) - 1)
            value |= part.astype(np.int64) << weight
        if self.signed:
            # not negative yet: a top bit of 1 takes 2^length away
            value -= (value >> (self.length - 1)) << self.length
        return value

    def write(self, data: FrameBytes, values: ArrayLike) -> None:
        """Put values into frames whose bits there are zero; bits beyond the field are cut off.

        Parameters
        ----------
        data : ndarray of uint8, shape (n_frames, length)
            Changed in place.
        values : array_like of int, shape (n_frames,) or ()
        """
        numbers = np.asarray(values).astype(np.int64, copy=False)
        for byte, shift, n_bits, weight in self.pieces():
            data[:, byte] |= (((numbers >> weight) & ((1 << n_bits) - 1)) << shift).astype(np.uint8)
