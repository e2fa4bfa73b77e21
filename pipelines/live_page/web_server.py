"""The page over HTTP and its messages over a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable, MutableMapping
from importlib import resources
from typing import Any, Final

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from pipelines.live_page.access import Access
from pipelines.live_page.page_state import PageState, Viewer

SHORTEST_INTERVAL_S: Final = 0.1
"""No browser gets more than ten messages per second."""

MOST_VIEWERS: Final = 8
LONGEST_TEXT: Final = 60
"""Letters of a mark."""

_ASSETS: Final = {"": ("page.html", "text/html"), "page.js": ("page.js", "text/javascript"),
                  "plots.js": ("plots.js", "text/javascript"), "page.css": ("page.css", "text/css")}  # fmt: skip
_POLICY_VIOLATION, _TRY_LATER = 1008, 1013

Mapping = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Mapping]]
Send = Callable[[Mapping], Awaitable[None]]


class Guarded:
    """Refuses everything that does not know the token or comes from elsewhere, before anything is looked at.

    Parameters
    ----------
    application : ASGI application
    access : Access
    """

    def __init__(self, application: Starlette, access: Access) -> None:
        self._application, self._access = application, access

    async def __call__(self, scope: Mapping, receive: Receive, send: Send) -> None:
        """Serve one request or WebSocket."""
        if scope["type"] in ("http", "websocket") and not self._is_allowed(scope):
            if scope["type"] == "websocket":
                await WebSocket(scope, receive, send).close(_POLICY_VIOLATION)
            else:
                await PlainTextResponse("not for you\n", status_code=403)(scope, receive, send)
            return
        await self._application(scope, receive, send)

    def _is_allowed(self, scope: Mapping) -> bool:
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get("origin")
        # a browser always says where a WebSocket comes from; a plain request of the page itself does not
        is_origin_right = self._access.is_own_origin(origin) if origin or scope["type"] == "websocket" else True
        return (
            self._access.is_own_host(headers.get("host"))
            and is_origin_right
            and self._access.knows_token(scope["path"])
        )


def application(state: PageState, access: Access, mark: Callable[[str], None]) -> Guarded:
    """The ASGI application of one page.

    Parameters
    ----------
    state : PageState
    access : Access
    mark : callable
        Takes the text of a mark that a person set.
    """
    viewers = _Viewers(state, mark)
    routes = [
        *(Route(f"/{{token}}/{name}", _asset(*asset, access)) for name, asset in _ASSETS.items()),
        WebSocketRoute("/{token}/live", viewers.serve),
    ]
    return Guarded(Starlette(routes=routes), access)


def _asset(name: str, media_type: str, access: Access) -> Callable[[Request], Awaitable[Response]]:
    content = (resources.files("pipelines.live_page") / "assets" / name).read_bytes()

    async def serve(request: Request) -> Response:
        # named as well: not every browser takes 'self' for a WebSocket
        own = f"ws://{request.headers['host']}"
        policy = (
            f"default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self' {own}; img-src data:; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        headers = {
            "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
        }
        return Response(content, media_type=media_type, headers=headers)

    return serve


class _Viewers:
    def __init__(self, state: PageState, mark: Callable[[str], None]) -> None:
        self._state, self._mark = state, mark
        self._n_viewers = 0

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one browser until it goes or the recording is over."""
        if self._n_viewers >= MOST_VIEWERS:
            await websocket.close(_TRY_LATER)
            return
        self._n_viewers += 1
        try:
            await websocket.accept()
            await self._talk(websocket)
        # however a browser goes, it is gone
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass
        finally:
            self._n_viewers -= 1

    async def _talk(self, websocket: WebSocket) -> None:
        viewer = Viewer(self._state)
        listening = asyncio.create_task(self._listen(websocket, viewer))
        try:
            while not listening.done():
                has_ended = self._state.has_ended
                text = json.dumps(viewer.message(), ensure_ascii=False, separators=(",", ":"))
                # waits while the browser does not take it: the next message is made when it does
                await websocket.send_text(text)
                if has_ended:
                    await websocket.close()
                    return
                await asyncio.sleep(SHORTEST_INTERVAL_S)
        finally:
            listening.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await listening

    async def _listen(self, websocket: WebSocket, viewer: Viewer) -> None:
        while True:
            text = await websocket.receive_text()
            try:
                message = json.loads(text)
            # whatever it was, it was no message of this page
            except (ValueError, RecursionError):
                continue
            if not isinstance(message, dict):
                continue
            if isinstance(message.get("mark"), str):
                self._mark(" ".join(message["mark"].split())[:LONGEST_TEXT])
            with self._state.locked():
                viewer.wishes(message)
