"""Spectra, loops and works of the last seconds, computed beside the curves and as often as there is time for."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipelines.live_page.last_cycles import Roles, last_cycles, recording_of, rig_at, roles_of
from pipelines.live_page.page_state import PageState
from pipelines.live_page.source_view import KEPT_S
from pipelines.live_page.spectra import LATEST_S, spectrum
from sloshlab.errors import SloshlabError

FloatArray = npt.NDArray[np.float64]

_INTERVAL_S: Final = 1.0
_MOST_SPECTRA: Final = 32
_MOST_WORKS: Final = 400
# windows that share most of their cycles are no new points
_SHORTEST_STEP_CYCLES: Final = 4


def since_the_last_loss(place: int, values: FloatArray) -> tuple[int, FloatArray]:
    """Place and values of the samples behind the last one that is missing in any channel."""
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    n_before = int(lost[-1]) + 1 if lost.size else 0
    return place + n_before, values[n_before:]


class Analyst:
    """Computes in a thread of its own what is too slow to be part of every message.

    Parameters
    ----------
    state : PageState
        Gets what was computed.
    """

    def __init__(self, state: PageState) -> None:
        self._state = state
        self._works: list[dict[str, float]] = []
        self._roles: list[Roles] | None = None
        self._thread = threading.Thread(target=self._run, name="analyses", daemon=True)

    def start(self) -> None:
        """Begin; the thread ends with the process."""
        self._thread.start()

    def _run(self) -> None:
        while not self._state.has_ended:
            began_s = time.monotonic()
            self.update()
            # at most half of the time: the browsers are served in between
            time.sleep(max(_INTERVAL_S, time.monotonic() - began_s))

    def update(self) -> None:
        """Compute everything once."""
        if not self._state.sources or self._state.finished is not None:
            return
        self._state.put_analyses({"spectra": self._spectra()})
        try:
            work = self._work()
        except SloshlabError as error:
            work = {"headline": "", "note": f"not computed: {error}"}
        # a signal that no analysis foresaw must not end the spectra
        except Exception as error:  # noqa: BLE001
            work = {"headline": "", "note": f"not computed: {type(error).__name__} {error}"}
        self._state.put_analyses({"work": work})

    def _spectra(self) -> dict[str, Any]:
        every = [(s, c) for s, view in enumerate(self._state.sources) for c in range(len(view.info.channels))]
        found = {}
        for source, channel in every[:_MOST_SPECTRA]:
            info = self._state.sources[source].info
            _, values = self._state.latest(source, LATEST_S, [channel])
            found[f"{source}:{channel}"] = spectrum(
                values[:, 0], info.sampling_rate_hz, info.channels[channel].units
            )
        return found

    def _work(self) -> dict[str, Any]:
        if self._roles is None:
            self._roles = [roles_of(view.info.channels) for view in self._state.sources]
        chosen = [number for number, roles in enumerate(self._roles) if not roles.reason]
        if not chosen:
            return {"headline": "", "note": f"not computed: {self._why_not()}"}
        source = chosen[0]
        if self._state.about["attributes"].get("configuration") == "empty":
            return {"headline": "", "note": "not computed: the tank is empty, so that W̄ has no scale"}
        roles, info = self._roles[source], self._state.sources[source].info
        numbers = [*roles.forces, *roles.accelerations]
        place, values = since_the_last_loss(*self._state.latest(source, KEPT_S, numbers))
        recording = recording_of(info.channels, numbers, values, info.sampling_rate_hz)
        rig = rig_at(self._state.about["rig"])
        return self._shown(last_cycles(recording, rig, place / info.sampling_rate_hz))

    def _why_not(self) -> str:
        assert self._roles is not None
        reasons = {roles.reason for roles in self._roles}
        if len(self._roles) > 1 and reasons == {"no force channel", "no acceleration channel of the tank"}:
            return "force and acceleration are on different devices, whose clocks are aligned after the recording"
        return "no force channel" if "no force channel" in reasons else reasons.pop()

    def _shown(self, found: Mapping[str, Any]) -> dict[str, Any]:
        if "reason" in found:
            kept = {"trend": self._trend(), "trend_label": "W̄ [1]"} if self._works else {}
            return {"headline": "", "note": f"not computed: {found['reason']}", **kept}
        before = self._works[-1]["time_s"] if self._works else float("-inf")
        if found["time_s"] - before >= _SHORTEST_STEP_CYCLES / found["frequency_hz"]:
            self._works = [*self._works[-_MOST_WORKS:], {k: v for k, v in found.items() if k != "loop"}]
        work_mj = 1e3 * found["work_j"]
        return {
            "headline": f"W̄ = {found['w_bar']:.4g} ± {found['w_bar_std']:.2g}   (W = {work_mj:.4g} mJ per cycle)",
            "note": (
                f"mean of {found['n_cycles']:.0f} cycles about {found['time_s']:.1f} s, "
                f"{found['frequency_hz']:.4g} Hz, {found['acceleration_g']:.3g} g; "
                "W̄ = W/(m_l Ω²u₀²), dimensionless, positive = dissipated, with the masses of the rig file"
            ),
            "trend": self._trend(),
            "trend_label": "W̄ [1]",
            "loop": found["loop"],
        }

    def _trend(self) -> list[dict[str, float]]:
        return [{"x": work["time_s"], "y": work["w_bar"], "error": work["w_bar_std"]} for work in self._works]
