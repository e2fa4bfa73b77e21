"""Spectra, loops and works of the last seconds, computed beside the curves and as often as there is time for."""

from __future__ import annotations

import threading
import time
from typing import Any, Final

from pipelines.live_page.page_state import PageState

_INTERVAL_S: Final = 1.0


class Analyst:
    """Computes in a thread of its own what is too slow to be part of every message.

    Parameters
    ----------
    state : PageState
        Gets what was computed.
    """

    def __init__(self, state: PageState) -> None:
        self._state = state
        self._thread = threading.Thread(target=self._run, name="analyses", daemon=True)

    def start(self) -> None:
        """Begin; the thread ends with the process."""
        self._thread.start()

    def _run(self) -> None:
        while not self._state.has_ended:
            began_s = time.monotonic()
            self._state.put_analyses(self._found())
            # at most half of the time: the browsers are served in between
            time.sleep(max(_INTERVAL_S, time.monotonic() - began_s))

    def _found(self) -> dict[str, Any]:
        return {}
