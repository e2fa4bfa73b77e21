"""Frames against the documented bytes, written out by hand, and against cantools."""

from __future__ import annotations

import binascii
import struct
from typing import Any

import cantools
import numpy as np
import pytest

from acquisition.files.can_database import read_layout
from acquisition.files.can_database_text import dbc_text
from acquisition.samples.channel import Channel
from acquisition.wire.can_bits import BitField
from acquisition.wire.can_frames import (
    ENDED,
    RUNNING,
    checksums,
    control_frame,
    decode,
    encode_samples,
    read_control_frame,
)
from acquisition.wire.can_layout import COMMAND, STATUS, CanLayout, device_database
from sloshlab.errors import InputError

CHANNELS = [
    Channel("force_cell_1", "force", "N", 16, 0.01),
    Channel("acceleration_roof_1", "acceleration", "m s-2", 16, 0.001, 0.5),
    Channel("voltage_drive", "voltage", "V", 24, 1e-6),
    Channel("displacement_tank", "displacement", "m", 32, 1e-9),
]


def sealed(arbitration_id: int, body: bytes) -> bytes:
    return struct.pack("<H", binascii.crc_hqx(struct.pack("<I", arbitration_id) + body, 0xFFFF)) + body


def classic_by_hand(arbitration_id: int, counter: int, latched: int, flags: int, samples: bytes) -> bytes:
    """Byte table of docs/can_protocol.md."""
    pages = [
        counter >> 8,
        counter >> 16,
        counter >> 24,
        latched,
        latched >> 8,
        latched >> 16,
        latched >> 24,
        flags,
    ]
    return sealed(arbitration_id, bytes([counter & 0xFF, pages[counter % 8] & 0xFF]) + samples)


def drawn_counts(n_samples: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    columns = [rng.integers(-(2 ** (c.bits - 1)), 2 ** (c.bits - 1), n_samples) for c in CHANNELS]
    counts = np.stack(columns, 1)
    counts[0], counts[1] = [[-(2 ** (c.bits - 1)) for c in CHANNELS], [2 ** (c.bits - 1) - 1 for c in CHANNELS]]
    return counts


def layout(fd: bool = False) -> CanLayout:
    return device_database("daq", 1000.0, 1e6, CHANNELS, fd)


class TestByHand:
    def test_classic_frames_are_the_documented_bytes(self) -> None:
        first, counts = 2**32 - 16, drawn_counts(40)
        ticks = 2**32 - 5000 + 977 * np.arange(40)
        frames = encode_samples(layout(), first, ticks, counts, device_flags=1)
        assert [frame.arbitration_id for frame in frames] == [0x101, 0x102, 0x103]
        for k in range(40):
            latched, flags = int(ticks[k - k % 8]), 1 if k == 7 else 0
            samples = [
                struct.pack("<hh", *counts[k, :2]),
                int(counts[k, 2]).to_bytes(3, "little", signed=True) + b"\0",
                struct.pack("<i", counts[k, 3]),
            ]
            for frame, content in zip(frames, samples, strict=True):
                expected = classic_by_hand(frame.arbitration_id, (first + k) % 2**32, latched, flags, content)
                assert frame.data[k].tobytes() == expected, (k, frame.arbitration_id)

    def test_fd_frames_are_the_documented_bytes(self) -> None:
        first, counts = 2**32 - 3, drawn_counts(6)
        ticks = 2**32 - 2000 + 1000 * np.arange(6)
        (frame,) = encode_samples(layout(fd=True), first, ticks, counts, device_flags=1)
        for j, (start, n) in enumerate([(0, 4), (4, 2)]):
            body = struct.pack("<IIBB", (first + start) % 2**32, int(ticks[start]) % 2**32, 1 if j == 0 else 0, n)
            for row in counts[start : start + n]:
                body += struct.pack("<hh", *row[:2]) + int(row[2]).to_bytes(3, "little", signed=True)
                body += struct.pack("<i", row[3])
            assert frame.data[j].tobytes() == sealed(0x101, body.ljust(62, b"\0"))

    def test_status_and_command(self) -> None:
        expected = sealed(0x100, struct.pack("<BBI", ENDED, 7, 123456))
        assert control_frame(STATUS, state=ENDED, stream=7, n_samples=123456) == expected
        assert control_frame(COMMAND, command=1) == sealed(0x080, bytes([1, 0, 0, 0, 0, 0]))
        said = read_control_frame(STATUS, sealed(0x100, struct.pack("<BBI", RUNNING, 255, 2**32 - 1)))
        assert said is not None
        assert (said["state"], said["stream"], said["n_samples"]) == (1, 255, 2**32 - 1)

    @pytest.mark.parametrize("bit", range(64))
    def test_any_flipped_bit_of_a_status_is_noticed(self, bit: int) -> None:
        data = bytearray(control_frame(STATUS, state=RUNNING, stream=7, n_samples=5))
        data[bit // 8] ^= 1 << bit % 8
        assert read_control_frame(STATUS, bytes(data)) is None

    def test_status_of_another_length_is_none(self) -> None:
        assert read_control_frame(STATUS, control_frame(STATUS, state=1)[:7]) is None


class TestAgainstCantools:
    @pytest.mark.parametrize("fd", [False, True])
    def test_what_is_encoded_cantools_decodes(self, fd: bool) -> None:
        described = layout(fd)
        database = cantools.database.load_string(dbc_text(described), "dbc")
        counts, ticks = drawn_counts(64), 3_000_000_000 + 1000 * np.arange(64)
        for message, frames in zip(
            described.messages, encode_samples(described, 70_000, ticks, counts), strict=True
        ):
            for j, row in enumerate(frames.data):
                said = database.decode_message(frames.arbitration_id, row.tobytes(), scaling=False)
                for index in message.channels:
                    for k in range(message.samples_per_frame):
                        name = CHANNELS[index].name + (f"__{k}" if message.samples_per_frame > 1 else "")
                        assert said[name] == counts[j * message.samples_per_frame + k, index]
                scaled = database.decode_message(frames.arbitration_id, row.tobytes())
                name = message.samples[0][0].name
                channel = CHANNELS[message.channels[0]]
                assert scaled[name] == said[name] * channel.scale_factor + channel.add_offset

    @pytest.mark.parametrize("seed", range(60))
    def test_any_bit_field_is_read_and_written_as_cantools_does(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        n_bytes = int(rng.choice([1, 2, 5, 8, 12, 64]))
        big_endian, signed = bool(rng.integers(2)), bool(rng.integers(2))
        length = int(rng.integers(1 + signed, min(8 * n_bytes, 48) + 1))
        first = int(rng.integers(0, 8 * n_bytes - length + 1))
        # counted along the wire, bit n of a big-endian field is bit 7 - n % 8 of byte n // 8
        start = 8 * (first // 8) + 7 - first % 8 if big_endian else first
        signal = cantools.database.can.Signal(
            "s", start, length, "big_endian" if big_endian else "little_endian", signed
        )
        peer = cantools.database.can.Message(1, "m", n_bytes, [signal], strict=True)
        data = rng.integers(0, 256, (50, n_bytes)).astype(np.uint8)
        field = BitField("s", start, length, big_endian, signed)
        expected = [peer.decode(row.tobytes(), scaling=False)["s"] for row in data]
        np.testing.assert_array_equal(field.read(data), expected)
        assert min(expected) >= field.lowest
        assert max(expected) <= field.highest
        written = np.zeros_like(data)
        field.write(written, expected)
        assert [row.tobytes() for row in written] == [peer.encode({"s": v}, scaling=False) for v in expected]

    @pytest.mark.parametrize("seed", range(40))
    def test_layouts_of_others_are_decoded_as_cantools_does(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        text, names = foreign_dbc(rng)
        described, database = read_layout(text), cantools.database.load_string(text, "dbc")
        (message,) = described.messages
        data = rng.integers(0, 256, (100, message.length)).astype(np.uint8)
        decoded = decode(message, data)
        for j, row in enumerate(data):
            said = database.decode_message(
                message.arbitration_id, row.tobytes(), scaling=False, allow_truncated=False
            )
            assert decoded.counts[j, 0].tolist() == [said[name] for name in names]
            parts = {
                int(name.rsplit("_", 1)[1]): v for name, v in said.items() if name.startswith("sample_counter")
            }
            assert decoded.counter[j] == sum(value << bit for bit, value in parts.items())
            known = sum(((1 << PART_BITS[bit]) - 1) << bit for bit in parts)
            assert decoded.counter_known[j] == known
        scaled = database.decode_message(message.arbitration_id, data[0].tobytes())
        for channel, count in zip(described.channels, decoded.counts[0, 0], strict=True):
            assert channel.scale_factor * count + channel.add_offset == scaled[channel.name]


PART_BITS = {0: 1, 1: 7, 8: 8, 16: 8}


def foreign_dbc(rng: np.random.Generator) -> tuple[str, list[str]]:
    """A database of another laboratory: fields in any place, byte order and sign, offsets, a 29-bit identifier."""
    fields: list[tuple[str, str, int, bool, float, float]] = [
        ("sample_counter_0", "M", 1, False, 1, 0),
        ("sample_counter_1", "", 7, False, 1, 0),
    ]
    names = ["force_cell_a", "acceleration_b", "voltage_c"]
    for name in names:
        signed = bool(rng.integers(2))
        length = int(rng.integers(2, 16 if signed else 15))
        fields.append(
            (
                name,
                "",
                length,
                signed,
                float(rng.choice([1.0, 0.25, 0.1, -2.0])),
                float(rng.choice([0.0, -40.0, 0.5])),
            )
        )
    places = rng.permutation(len(fields) + 1)
    lines: dict[int, list[str]] = {}
    position = 0
    for place in places:
        group = (
            [fields[place]]
            if place < len(fields)
            else [("sample_counter_8", "m0", 8, False, 1, 0), ("sample_counter_16", "m1", 8, False, 1, 0)]
        )
        for name, mark, length, signed, scale, offset in group:
            big_endian = bool(rng.integers(2))
            start = 8 * (position // 8) + 7 - position % 8 if big_endian else position
            order = f"{start}|{length}@{0 if big_endian else 1}{'-' if signed else '+'}"
            lines.setdefault(position, []).append(f' SG_ {name} {mark} : {order} ({scale},{offset}) [0|0] "N" x')
        # both byte orders stay within the same whole bytes
        position = -(-(position + group[0][2]) // 8) * 8
    length = position // 8
    body = "\n".join(line for group in lines.values() for line in group).replace('"N" x', '"{u}" x')
    units = {"force": "N", "acceleration": "m s-2", "voltage": "V"}
    body = "\n".join(
        line.replace("{u}", units.get(line.split()[1].split("_")[0], "")) for line in body.splitlines()
    )
    text = f'VERSION ""\nBU_: x\nBO_ {0x80000000 | 0x18FF0000} m: {length} x\n{body}\n'
    text += 'BA_DEF_ BO_ "SamplingRateHz" FLOAT 0 1e9;\nBA_DEF_DEF_ "SamplingRateHz" 0;\n'
    text += f'BA_ "SamplingRateHz" BO_ {0x80000000 | 0x18FF0000} 100;\n'
    order = [name for name in sorted(names, key=lambda n: body.index(f"SG_ {n} "))]
    return text, order


class TestEncoding:
    @pytest.mark.parametrize("fd", [False, True])
    def test_decoded_again(self, fd: bool) -> None:
        described, counts = layout(fd), drawn_counts(203, 5)
        ticks = 1000 * np.arange(203)
        for message, frames in zip(described.messages, encode_samples(described, 0, ticks, counts), strict=True):
            decoded = decode(message, frames.data)
            assert decoded.intact.all()
            assert decoded.n_samples.sum() == 203
            flat = decoded.counts.reshape(-1, len(message.channels))[:203]
            np.testing.assert_array_equal(flat, counts[:, message.channels])

    @pytest.mark.parametrize("bit", [0, 15, 16, 19, 24, 32, 63])
    def test_flipped_bit_fails_the_checksum(self, bit: int) -> None:
        (first, *_) = encode_samples(layout(), 0, np.arange(10), drawn_counts(10))
        data = first.data.copy()
        data[4, bit // 8] ^= 1 << bit % 8
        assert np.flatnonzero(~decode(layout().messages[0], data).intact).tolist() == [4]

    @pytest.mark.parametrize("start", [0, 3, 6])
    def test_checksums_are_those_of_the_standard_library(self, start: int) -> None:
        data = np.random.default_rng(1).integers(0, 256, (200, 8)).astype(np.uint8)
        found = checksums(0x18FF1234, data, BitField("crc_16", 8 * start, 16))
        for value, row in zip(found.tolist(), data, strict=True):
            rest = bytes(byte for n, byte in enumerate(row) if n not in (start, start + 1))
            assert value == binascii.crc_hqx(struct.pack("<I", 0x18FF1234) + rest, 0xFFFF)

    def test_pieces_make_the_same_frames_as_the_whole(self) -> None:
        counts, ticks = drawn_counts(24), 500 + 1000 * np.arange(24)
        whole = encode_samples(layout(), 40, ticks, counts)
        first = encode_samples(layout(), 40, ticks[:13], counts[:13])
        second = encode_samples(layout(), 53, ticks[13:], counts[13:], latched_ticks=int(ticks[8]))
        for whole_message, a, b in zip(whole, first, second, strict=True):
            np.testing.assert_array_equal(whole_message.data, np.concatenate([a.data, b.data]))

    def test_missing_latched_clock_is_asked_for(self) -> None:
        with pytest.raises(InputError, match="latched_ticks"):
            encode_samples(layout(), 3, np.arange(5), drawn_counts(5))

    @pytest.mark.parametrize("count", [2**15, -(2**15) - 1])
    def test_counts_that_do_not_fit_are_refused(self, count: int) -> None:
        counts = drawn_counts(5)
        counts[3, 0] = count
        with pytest.raises(InputError, match="counts of force_cell_1"):
            encode_samples(layout(), 0, np.arange(5), counts)

    def test_frames_of_another_length_are_refused(self) -> None:
        with pytest.raises(InputError, match="frames of samples_0"):
            decode(layout().messages[0], np.zeros((3, 7), np.uint8))

    def test_unknown_signal_of_a_control_message_is_refused(self) -> None:
        values: dict[str, Any] = {"speed": 1}
        with pytest.raises(InputError, match="signal of device_status"):
            control_frame(STATUS, **values)
