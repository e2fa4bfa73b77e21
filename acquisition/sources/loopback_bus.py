"""A bus of python-can over multicast that stays on this computer.

python-can's own ``udp_multicast`` joins its group on the default network interface, which tells the network so,
and takes datagrams from anywhere on its port. The socket here is bound to the loopback interface before it joins
its group there: it neither sends to the network nor hears it, and the network hears of no membership. Its
datagrams are those of python-can.
"""

from __future__ import annotations

import select
import socket
import struct
from typing import Final

import can
from can.interfaces.udp_multicast.utils import pack_message, unpack_message

_INTERFACE: Final = b"lo\0"
_ADDRESS: Final = "127.0.0.1"
_LARGEST_DATAGRAM_BYTES: Final = 4096
# Linux: a control message of two longs, seconds and nanoseconds; Python has no name for it
_SO_TIMESTAMPNS: Final = 35
_TIMESTAMP: Final = struct.Struct("@ll")


class LoopbackMulticastBus(can.BusABC):
    """A bus between processes of one computer.

    Parameters
    ----------
    channel : str
        IPv4 multicast address.
    port : int
    receive_buffer_bytes : int
        Asked for; the system may give less.

    Raises
    ------
    OSError, AttributeError
        If the socket cannot be confined to the loopback interface; other systems than Linux have no such option.
    """

    def __init__(self, channel: str, port: int, receive_buffer_bytes: int) -> None:
        self._destination = (channel, port)
        self._socket = _confined_socket(channel, port, receive_buffer_bytes)
        self.channel_info = f"multicast group {channel}, port {port}, on this computer"
        super().__init__(channel)
        self._can_protocol = can.CanProtocol.CAN_FD

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            ready, _, _ = select.select([self._socket], [], [], timeout)
            if not ready:
                return None, False
            data, ancillary, _, _ = self._socket.recvmsg(
                _LARGEST_DATAGRAM_BYTES, socket.CMSG_SPACE(_TIMESTAMP.size)
            )
        except (OSError, ValueError) as error:  # ValueError: the socket was closed
            raise can.CanOperationError(str(error)) from error
        ((_, _, stamp),) = ancillary
        seconds, nanoseconds = _TIMESTAMP.unpack(stamp)
        try:
            message = unpack_message(data, replace={"timestamp": seconds + 1e-9 * nanoseconds}, check=True)
        except Exception as error:
            # whatever a stranger's bytes make msgpack raise
            raise can.CanOperationError("could not unpack a datagram") from error
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to all buses of the group on this computer."""
        try:
            self._socket.sendto(pack_message(msg), self._destination)
        except OSError as error:
            raise can.CanOperationError(str(error)) from error

    def fileno(self) -> int:
        """File descriptor of the socket; −1 after `shutdown`."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Close the socket."""
        super().shutdown()
        self._socket.close()


def _confined_socket(group: str, port: int, receive_buffer_bytes: int) -> socket.socket:
    confined = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # first of all, so that it never was on another interface
        confined.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _INTERFACE)
        # 0 hops: what is sent goes no further than this computer
        confined.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        interface = socket.inet_aton(_ADDRESS)
        confined.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        confined.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer_bytes)
        confined.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        # several programs on one group and port; python-can asks for both, and all of one port must agree
        confined.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        confined.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        # to the group, not to any address: other groups that somebody joined here are not heard
        confined.bind((group, port))
        confined.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + interface)
    except (OSError, AttributeError):
        confined.close()
        raise
    return confined
