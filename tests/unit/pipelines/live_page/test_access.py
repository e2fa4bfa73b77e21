"""Who may see the page: the rules, and the server that keeps them."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
from collections.abc import Iterator

import pytest

from pipelines.live_page.access import Access, is_loopback
from pipelines.live_page.page_state import PageState

TOKEN = "a-token_123"
PORT = 8123


def access(host: str = "127.0.0.1") -> Access:
    return Access(TOKEN, host, PORT)


@pytest.mark.parametrize(
    ("host", "is_own"),
    [("127.0.0.1", True), ("::1", True), ("localhost", True), ("127.8.9.1", True), ("0.0.0.0", False),
     ("192.168.1.4", False), ("rig.example.org", False), ("", False)],
)  # fmt: skip
def test_only_this_computers_own_addresses_are_loopback(host: str, is_own: bool) -> None:
    assert is_loopback(host) is is_own


@pytest.mark.parametrize(
    ("listens", "header", "is_own"),
    [
        ("127.0.0.1", "127.0.0.1:8123", True), ("127.0.0.1", "localhost:8123", True),
        ("127.0.0.1", "[::1]:8123", True), ("127.0.0.1", "127.0.0.1:80", False), ("127.0.0.1", "127.0.0.1", False),
        ("127.0.0.1", "evil.example:8123", False), ("127.0.0.1", "192.168.1.4:8123", False),
        ("127.0.0.1", None, False), ("127.0.0.1", "127.0.0.1:8123@evil.example", False),
        ("127.0.0.1", "127.0.0.1.evil.example:8123", False), ("127.0.0.1", "[::1", False),
        ("192.168.1.4", "192.168.1.4:8123", True), ("192.168.1.4", "127.0.0.1:8123", False),
        ("192.168.1.4", "evil.example:8123", False),
        ("0.0.0.0", "10.1.2.3:8123", True), ("0.0.0.0", "localhost:8123", True),
        ("0.0.0.0", "evil.example:8123", False),
    ],
)  # fmt: skip
def test_only_the_pages_own_names_are_its_host(listens: str, header: str | None, is_own: bool) -> None:
    assert access(listens).is_own_host(header) is is_own
    # an origin is a host with its scheme
    assert access(listens).is_own_origin(header and f"http://{header}") is is_own
    assert not access(listens).is_own_origin(header and f"https://{header}")
    assert not access(listens).is_own_origin("null")


def test_the_token_is_the_first_part_of_the_path() -> None:
    assert access().knows_token(f"/{TOKEN}/live")
    for path in ("/", "", f"/{TOKEN[:-1]}/", f"/{TOKEN}x/", f"/x/{TOKEN}/", "/é/"):
        assert not access().knows_token(path)


class Served:
    """The page on a port of this computer, by the server that the command uses."""

    def __init__(self, state: PageState) -> None:
        import uvicorn

        from pipelines.live_page.web_server import application

        self.marks: list[str] = []
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        own = application(state, Access(TOKEN, "127.0.0.1", self.port), self.marks.append)
        config = uvicorn.Config(own, log_config=None, lifespan="off", ws_per_message_deflate=False)
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._listening]})
        self._thread.start()

    def get(self, path: str, headers: dict[str, str]) -> tuple[int, http.client.HTTPMessage, str]:
        """Status, headers and text of the answer; no text where a WebSocket begins."""
        given = {"host": "127.0.0.1:{port}", **headers}
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)) as connection:
            connection.request("GET", path, headers={name: self.filled(value) for name, value in given.items()})
            with connection.getresponse() as answer:
                text = "" if answer.status == 101 else answer.read().decode()
                return answer.status, answer.headers, text

    def handshake(self, path: str, headers: dict[str, str]) -> int:
        """Status of the answer to a browser that asks for a WebSocket."""
        asked = {
            "connection": "Upgrade", "upgrade": "websocket", "sec-websocket-version": "13",
            "sec-websocket-key": "dGhlIHNhbXBsZSBub25jZQ==",
        }  # fmt: skip
        return self.get(path, {**asked, **headers})[0]

    def filled(self, text: str) -> str:
        return text.replace("{port}", str(self.port))

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join(30)
        self._listening.close()


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    for package in ("starlette", "uvicorn", "websockets"):
        pytest.importorskip(package, reason="needs the extra live")
    page = Served(PageState())
    yield page
    page.close()


OWN = {"origin": "http://127.0.0.1:{port}"}


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        (f"/{TOKEN}/", {}, 200), (f"/{TOKEN}/page.js", {}, 200), (f"/{TOKEN}/plots.js", {}, 200),
        (f"/{TOKEN}/page.css", OWN, 200), (f"/{TOKEN}/other", {}, 404), (f"/{TOKEN}/../secrets", {}, 404),
        ("/", {}, 403), ("/wrong/", {}, 403), ("/page.js", {}, 403), (f"/x/../{TOKEN}/", {}, 403),
        (f"/{TOKEN}/", {"host": "evil.example:{port}"}, 403), (f"/{TOKEN}/", {"host": "127.0.0.1:9"}, 403),
        (f"/{TOKEN}/", {"origin": "http://evil.example"}, 403), (f"/{TOKEN}/", {"origin": "null"}, 403),
    ],
)  # fmt: skip
def test_the_page_is_served_to_those_who_know_it_alone(
    path: str, headers: dict[str, str], status: int, served: Served
) -> None:
    found, answered, text = served.get(path, headers)
    assert found == status
    if status == 200:
        assert "default-src 'none'" in str(answered["content-security-policy"])
        assert answered["cache-control"] == "no-store"
        assert answered["referrer-policy"] == "no-referrer"
        # nothing of another computer
        assert "http:" not in text
        assert "https:" not in text


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        (f"/{TOKEN}/live", OWN, 101), ("/wrong/live", OWN, 403), ("/live", OWN, 403), (f"/{TOKEN}/live", {}, 403),
        (f"/{TOKEN}/live", {"origin": "null"}, 403),
        (f"/{TOKEN}/live", {"origin": "http://evil.example:{port}"}, 403),
        (f"/{TOKEN}/live", {**OWN, "host": "evil.example:{port}"}, 403),
    ],
)  # fmt: skip
def test_the_websocket_is_opened_to_the_page_alone(
    path: str, headers: dict[str, str], status: int, served: Served
) -> None:
    assert served.handshake(path, headers) == status


def test_marks_and_wishes_come_through_and_nonsense_changes_nothing(served: Served) -> None:
    from websockets.sync.client import connect

    url = f"ws://127.0.0.1:{served.port}/{TOKEN}/live"
    with connect(url, origin=served.filled(OWN["origin"])) as browser:  # type: ignore[arg-type]
        assert json.loads(browser.recv(30))["window"] == 5.0
        for text in (
            "no JSON",
            "[" * 3000,
            "7",
            '{"mark": 7}',
            '{"window": "x", "show": 3}',
            '{"show": [[0, 99]]}',
        ):
            browser.send(text)
        browser.send(json.dumps({"mark": "  a \n b  " + "x" * 100}))
        browser.send(json.dumps({"window": 30}))
        windows = [json.loads(browser.recv(30))["window"] for _ in range(20)]
    assert served.marks == ["a b " + "x" * 56]
    assert windows[-1] == 30.0


def test_the_ninth_browser_is_turned_away() -> None:
    pytest.importorskip("websockets", reason="needs the extra live")
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    page = Served(PageState())
    url, origin = f"ws://127.0.0.1:{page.port}/{TOKEN}/live", page.filled(OWN["origin"])
    with contextlib.ExitStack() as browsers:
        browsers.callback(page.close)
        for _ in range(8):
            browsers.enter_context(connect(url, origin=origin))  # type: ignore[arg-type]
        with pytest.raises(InvalidStatus):
            connect(url, origin=origin)  # type: ignore[arg-type]
