"""A device and the hosts on its byte streams: who is let go, who is not, and what each is told."""

import contextlib
import os
import select
import socket

import numpy as np
import pytest

from acquisition.devices.can_conversation import SocketcandConversation
from acquisition.devices.connection import Connection, Listener, ListeningSocket, PseudoTerminal
from acquisition.devices.conversation import Conversation
from acquisition.devices.endpoint import LONGEST_STALL_S, StreamEndpoint

tty = pytest.importorskip("tty", reason="needs pseudo-terminals")

FRAMES = np.zeros(1)  # what is sent is the text that the endpoint makes of them
MIB = 1 << 20


class Clock:
    """Stands still unless it is moved."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


class Greedy(Conversation):
    """Answers every byte with 64 KiB; any word makes a host one that listens."""

    def answer(self, host, data):
        host.listens = host.has_started = True
        return b"a" * 65536 * data.count(b"?")


class ScriptedHost(Connection):
    """Takes as many bytes at a time as it is told; a pipe stands in for the descriptor."""

    def __init__(self, takes):
        self.words, self.taken, self.is_closed, self._takes = [], b"", False, takes
        self._pipe = os.pipe()

    def fileno(self):
        return self._pipe[1]

    def receive(self):
        return self.words.pop(0) if self.words else b""

    def send(self, data):
        n = min(self._takes(), len(data))
        self.taken += bytes(data[:n])
        return n

    def is_read(self):
        return True

    def close(self):
        self.is_closed = True

    def release(self):
        for end in self._pipe:
            os.close(end)


class ScriptedListener(Listener):
    """All hosts come at once."""

    def __init__(self, *hosts):
        self.coming = list(hosts)

    def open(self):
        return "here"

    def arrived(self):
        coming, self.coming = self.coming, []
        return coming

    def waiting_on(self):
        return None

    def close(self):
        """Nothing."""


@contextlib.contextmanager
def served(*hosts, clock, text=b"", listener=None):
    endpoint = StreamEndpoint(listener or ScriptedListener(*hosts), Greedy(), lambda _: text, str, now_s=clock)
    try:
        endpoint.serve(0.0)
        for host in hosts:
            host.words.append(b"!")
        endpoint.serve(0.0)
        yield endpoint
    finally:
        endpoint.close()
        for host in hosts:
            host.release()


def test_of_several_hosts_one_that_reads_slowly_is_kept_and_one_that_reads_nothing_is_let_go():
    clock = Clock()

    def slowly():
        # takes something whenever there was time to, and nothing when it is tried again at once
        clock.now_s += 0.4 * LONGEST_STALL_S
        slowly.turn += 1
        return 40 * (slowly.turn % 2 == 0)

    slowly.turn = 0
    quick, slow, dead = ScriptedHost(lambda: 1 << 30), ScriptedHost(slowly), ScriptedHost(lambda: 0)
    with served(quick, slow, dead, clock=clock, text=b"x" * 1000) as endpoint:
        assert endpoint.send(FRAMES, is_given_up=lambda: clock.now_s > 100 * LONGEST_STALL_S)
        assert quick.taken == slow.taken == b"x" * 1000
        assert not slow.is_closed
        assert dead.is_closed


@pytest.mark.parametrize("n_questions", [0, 1])
def test_a_host_may_speak_while_much_is_on_its_way_to_it(n_questions):
    slow = ScriptedHost(lambda: MIB // 8)
    with served(slow, clock=Clock(), text=b"x" * (4 * MIB)) as endpoint:
        slow.words += [b"", b"?" * n_questions or b"!"]
        assert endpoint.send(FRAMES, is_given_up=lambda: False)
    assert slow.taken == b"x" * (4 * MIB) + b"a" * 65536 * n_questions


def test_a_terminal_that_is_opened_again_before_that_is_noticed_is_one_host():
    host = ScriptedHost(lambda: 1 << 30)
    listener = ScriptedListener(host)
    with served(host, clock=Clock(), text=b"x", listener=listener) as endpoint:
        listener.coming = [host]
        endpoint.serve(0.0)
        assert endpoint.send(FRAMES, is_given_up=lambda: False)
    assert host.taken == b"x"


def test_a_host_that_asks_and_asks_and_never_reads_is_let_go():
    hostile = ScriptedHost(lambda: 0)
    with served(hostile, clock=Clock()) as endpoint:
        for _ in range(17):
            hostile.words.append(b"?")
            endpoint.serve(0.0)
        assert hostile.is_closed
        assert not endpoint.has_hosts


def test_who_asks_for_a_bus_that_is_not_there_is_told_so_before_the_connection_ends():
    endpoint = StreamEndpoint(ListeningSocket("127.0.0.1", 0), SocketcandConversation("can0"), bytes, str)
    place = endpoint.open().rpartition(":")
    try:
        with socket.create_connection((place[0], int(place[2])), timeout=30) as client:
            client.sendall(b"< open can7 >")
            endpoint.serve(1.0)  # lets it in
            endpoint.serve(1.0)  # and hears it
            said = b""
            while data := client.recv(100):
                said += data
    finally:
        endpoint.close()
    assert said == b"< hi >< error could not open bus >"


def test_a_terminal_whose_host_was_let_go_is_there_for_the_next_one(tmp_path):
    endpoint = StreamEndpoint(PseudoTerminal(tmp_path / "tty"), Greedy(), bytes, str)
    endpoint.open()
    try:
        for _ in range(2):
            host = os.open(tmp_path / "tty", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                tty.setraw(host)
                endpoint.serve(0.0)
                assert endpoint.has_hosts
                os.write(host, b"?" * 17)
                endpoint.serve(1.0)
                assert not endpoint.has_hosts
                endpoint.serve(0.0)  # it is still there and not let in again
                assert not endpoint.has_hosts
            finally:
                os.close(host)
            endpoint.serve(0.0)
    finally:
        endpoint.close()


def test_at_a_full_door_each_one_waits_its_own_time():
    clock = Clock()
    listener = ListeningSocket("127.0.0.1", 0, most=1, now_s=clock)
    host, _, port = listener.open().rpartition(":")
    with contextlib.ExitStack() as stack:
        stack.callback(listener.close)
        clients = [stack.enter_context(socket.create_connection((host, int(port)), timeout=30)) for _ in range(3)]
        (first,) = listener.arrived()
        stack.callback(first.close)
        for k, client in enumerate(clients[1:], start=2):
            assert listener.arrived() == []
            clock.now_s += 2.1
            assert listener.arrived() == []
            assert client.recv(1) == b""
            still_there(clients[k:])


def still_there(clients):
    """Nothing has been said to any of them, and none has been hung up on."""
    assert select.select(clients, [], [], 0.0)[0] == []
