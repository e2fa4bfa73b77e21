"""Contents of a page read back by NumPy, as the script in the browser reads them."""

from __future__ import annotations

import base64
import gzip
import json
from html.parser import HTMLParser
from typing import Any

import numpy as np


def numbers(carried: dict[str, Any]) -> np.ndarray:
    codes = np.frombuffer(base64.b64decode(carried["codes"]), "<u2")
    return np.where(codes == 65535, np.nan, carried["low"] + carried["step"] * codes.astype(float))


def samples(carried: dict[str, Any]) -> np.ndarray:
    if "count" in carried:
        return np.arange(carried["count"])
    return np.cumsum(np.frombuffer(base64.b64decode(carried["steps"]), f"<u{carried['bits'] // 8}").astype(int))


class Scripts(HTMLParser):
    """The script and style elements and the policy of a page, as a browser finds them."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.data: list[Any] = []
        self.scripts: list[str] = []
        self.carried = ""
        self.styles: list[str] = []
        self.policy = ""
        self._open, self._type = "", ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        its = {name: value or "" for name, value in attrs}
        if tag in ("script", "style"):
            self._open, self._type = tag, its.get("type", "")
        if its.get("http-equiv") == "Content-Security-Policy":
            self.policy = its["content"]

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open == "style":
            self.styles.append(data)
        elif self._open == "script" and self._type == "application/json":
            self.data.append(json.loads(data))
        elif self._open == "script" and self._type == "application/gzip":
            self.carried += gzip.decompress(base64.b64decode(data)).decode()
        elif self._open == "script":
            self.scripts.append(data)
