"""CAN frames of the documented layout, byte by byte, and a socketcand server that says what a test wants."""

import binascii
import contextlib
import socket
import struct
import threading

from acquisition.files.can_database_text import write_dbc
from acquisition.sources import Channel
from acquisition.wire.can_layout import device_database

RATE_HZ = 1000.0
CELLS = [
    Channel("force_cell_1", "force", "N", scale_factor=0.5, range_min=-20.0, range_max=20.0),
    Channel("force_cell_2", "force", "N", scale_factor=0.5, missing_count=-32768),
]
RUNNING, ENDED = 1, 2


def frame(identifier, content):
    """``crc_16`` and six bytes."""
    crc = binascii.crc_hqx(struct.pack("<I", identifier) + content, 0xFFFF)
    return identifier, struct.pack("<H", crc) + content


def samples(counter, counts):
    """One sample of two channels; the clock ticks once per microsecond."""
    clock = (counter // 8 * 8 * 1000) & 0xFFFFFFFF
    turn = [counter >> 8, counter >> 16, counter >> 24, clock, clock >> 8, clock >> 16, clock >> 24, 0]
    return frame(0x101, struct.pack("<BBhh", counter & 0xFF, turn[counter % 8] & 0xFF, *counts))


def status(state, stream, n_samples):
    """``device_status``."""
    return frame(0x100, struct.pack("<BBI", state, stream, n_samples))


def counts_of(counter):
    """What the cells read."""
    return (counter * 7919) % 60000 - 30000, -(counter % 1000)


def run(first, last, stream=9):
    """Frames of a device from one counter to another, with its status before."""
    return [
        status(RUNNING, stream, first),
        *(samples(counter, counts_of(counter)) for counter in range(first, last)),
    ]


def text(frames):
    """As a socketcand sends it."""
    return b"".join(
        b"< frame %03X 12.000345 %s >" % (number, content.hex().encode()) for number, content in frames
    )


def database(path, **more):
    """A DBC file of the device ``cells``."""
    write_dbc(device_database("cells", RATE_HZ, 1e6, CELLS, **more), path)
    return path


class ScriptedServer:
    """Listens on a port; each connection is served by the next function of the script."""

    def __init__(self, *script):
        self._script = script
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        self.heard = []
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Stop listening and wait for the script's end."""
        with contextlib.suppress(OSError):
            self.listening.shutdown(socket.SHUT_RDWR)
        self.listening.close()
        self._thread.join(60)
        assert not self._thread.is_alive()

    def _serve(self):
        for part in self._script:
            try:
                connection, _ = self.listening.accept()
            except OSError:
                return
            connection.settimeout(60)
            with connection, contextlib.suppress(ConnectionError):  # hosts hang up when they like
                part(self, connection)

    def handshake(self, connection):
        """As socketcand does it, up to raw mode."""
        connection.sendall(b"< hi >")
        for _ in range(2):
            self.hear(connection)
            connection.sendall(b"< ok >")

    def hear(self, connection):
        """One message of the host."""
        said = b""
        while not said.endswith(b">"):
            piece = connection.recv(1)
            if not piece:
                return
            said += piece
        self.heard.append(said)

    def hear_to_the_end(self, connection):
        """Everything, until the host hangs up."""
        while True:
            before = len(self.heard)
            self.hear(connection)
            if len(self.heard) == before:
                return


def sending(*pieces):
    """Script: a handshake, then the pieces, then listening until the host hangs up."""

    def part(server, connection):
        server.handshake(connection)
        for piece in pieces:
            connection.sendall(piece)
        server.hear_to_the_end(connection)

    return part


def hanging_up_after(*pieces):
    """Script: a handshake, then the pieces, then no more."""

    def part(server, connection):
        server.handshake(connection)
        server.hear(connection)
        for piece in pieces:
            connection.sendall(piece)
        connection.shutdown(socket.SHUT_WR)
        server.hear_to_the_end(connection)

    return part
