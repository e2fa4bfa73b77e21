"""Who may see the page: whoever knows its token, on this computer unless another host is asked for.

The token is the first part of every path. The headers `Host` and `Origin` are compared with the page's own
address, so that a page of somebody else, open in the same browser, cannot reach this one under a name of its own
(DNS rebinding) or from its own origin.
"""

from __future__ import annotations

import hmac
import ipaddress
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
_ANY: Final = ("0.0.0.0", "::", "")


def is_loopback(host: str) -> bool:
    """Whether an address is this computer's own, and no other can reach it."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Access:
    """The rules of one page.

    Attributes
    ----------
    token : str
    host : str
        Address that is listened on.
    port : int
    """

    token: str
    host: str
    port: int

    def knows_token(self, path: str) -> bool:
        """Whether a path begins with the token; takes as long whatever it begins with."""
        first = path.lstrip("/").partition("/")[0]
        return hmac.compare_digest(first.encode("utf-8", "replace"), self.token.encode())

    def is_own_host(self, header: str | None) -> bool:
        """Whether the header `Host` names this page."""
        name, port = _host_and_port(header or "")
        if port != self.port:
            return False
        if name in self._names():
            return True
        # listening everywhere: a literal address cannot be the name of somebody else's page
        return self.host in _ANY and _is_address(name)

    def is_own_origin(self, header: str | None) -> bool:
        """Whether the header `Origin` is that of this page."""
        if header is None or not header.startswith("http://"):
            return False
        return self.is_own_host(header.removeprefix("http://"))

    def url(self, host: str | None = None) -> str:
        """Where a browser finds the page."""
        name = host or ("127.0.0.1" if self.host in _ANY else self.host)
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/{self.token}/"

    def _names(self) -> Iterable[str]:
        names = {self.host.lower()} - set(_ANY)
        if self.host in _ANY:
            names |= {*LOOPBACK, socket.gethostname().lower()}
        elif is_loopback(self.host):
            names |= set(LOOPBACK)
        return names


def _host_and_port(header: str) -> tuple[str, int | None]:
    """Taken apart; port 80 where none is written, None for what is no host."""
    try:
        parts = urlsplit(f"//{header}")
        return (parts.hostname or "").lower(), parts.port or 80
    except ValueError:
        return "", None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
