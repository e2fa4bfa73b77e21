"""The process that serves the page: samples come by standard input, marks go out by standard output.

Started by `pipelines.live_page.live_page`. It has its own interpreter, so that nothing it does can cost the
recorder a sample, and it ends when its standard input does.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import sys
import threading
from typing import Any, BinaryIO

from pipelines.live_page.access import Access
from pipelines.live_page.page_state import PageState
from pipelines.live_page.pipe_frames import read_frames

_FAREWELL_S = 0.5
_LONGEST_FAREWELL_S = 2
_PING_S = 10.0


def main() -> None:
    """Serve ``HOST PORT``, the arguments, until standard input ends."""
    host, port = sys.argv[1], int(sys.argv[2])
    try:
        listening = _listening(host, port)
    # an address of somebody else, a port in use, a name that nobody knows
    except (OSError, UnicodeError) as error:
        _tell({"refused": getattr(error, "strerror", None) or str(error)})
        return
    access = Access(secrets.token_urlsafe(24), host, listening.getsockname()[1])
    asyncio.run(_serve(listening, access))


def _tell(content: dict[str, Any]) -> None:
    try:
        sys.stdout.write(json.dumps(content) + "\n")
        sys.stdout.flush()
    # the recorder has ended: there is nobody to tell
    except OSError:
        pass


def _listening(host: str, port: int) -> socket.socket:
    family, kind, protocol, _, address = socket.getaddrinfo(
        host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listening = socket.socket(family, kind, protocol)
    # a page that has just ended must not keep its port from the next; a port in use is refused nevertheless
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.bind(address)
    listening.listen(64)
    return listening


async def _serve(listening: socket.socket, access: Access) -> None:
    import uvicorn

    from pipelines.live_page.analyses import Analyst
    from pipelines.live_page.web_server import application

    state = PageState()
    config = uvicorn.Config(
        application(state, access, lambda text: _tell({"mark": text})),
        log_config=None, access_log=False, server_header=False, proxy_headers=False, lifespan="off",
        ws_max_size=4096, ws_per_message_deflate=False, ws_ping_interval=_PING_S, ws_ping_timeout=_PING_S,
        timeout_graceful_shutdown=_LONGEST_FAREWELL_S, limit_concurrency=64,
    )  # fmt: skip
    server = uvicorn.Server(config)

    loop = asyncio.get_running_loop()

    def end() -> None:
        state.has_ended = True
        # the browsers get their last message first
        loop.call_later(_FAREWELL_S, lambda: setattr(server, "should_exit", True))

    reader = threading.Thread(
        target=_read, args=(sys.stdin.buffer, state, lambda: loop.call_soon_threadsafe(end)), daemon=True
    )
    Analyst(state).start()
    _tell({"ready": access.url()})
    reader.start()
    await server.serve(sockets=[listening])


def _read(pipe: BinaryIO, state: PageState, ended: Any) -> None:
    try:
        for frame in read_frames(pipe):
            state.take(frame)
    finally:
        ended()


if __name__ == "__main__":
    main()
