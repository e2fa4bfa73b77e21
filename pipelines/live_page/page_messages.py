"""The recorder's state in plain numbers and texts, for the page."""

from __future__ import annotations

import math
from typing import Any

from acquisition.recorder.statistics import ChannelLevel
from acquisition.recorder.status import RecorderStatus, SourceStatus


def described_status(status: RecorderStatus, n_skipped: int) -> dict[str, Any]:
    """A state as JSON takes it; `n_skipped` samples were left out of the page, not of the recording."""
    return {
        "elapsed_s": status.elapsed_s,
        "remaining_s": status.remaining_s,
        "n_bytes_written": status.n_bytes_written,
        "waiting_for": status.waiting_for,
        "is_stopping": status.is_stopping,
        "n_skipped": n_skipped,
        "sources": [_described_source(source) for source in status.sources],
    }


def _described_source(source: SourceStatus) -> dict[str, Any]:
    drift = source.drift
    return {
        "device": source.device,
        "state": source.state.name.lower(),
        "state_text": source.state.value,
        "n_samples": source.n_samples,
        "n_lost": source.n_lost,
        "rate_hz": source.sampling_rate_hz,
        "measured_rate_hz": source.measured_rate_hz,
        "drift_ppm": None if drift is None else drift.ppm,
        "drift_uncertainty_ppm": None if drift is None else drift.uncertainty_ppm,
        "queue_fill": source.queue_fill,
        "error": source.error,
        "troubles": {kind.value: count for kind, count in source.troubles.items() if count},
        "levels": [_described_level(level) for level in source.levels],
    }


def _described_level(level: ChannelLevel) -> dict[str, Any]:
    return {
        "rms": _finite(level.rms),
        "peak": _finite(level.peak),
        "limit": _finite(level.limit),
        "n_clipped": level.n_clipped,
        "n_missing": level.n_missing,
        "clipped_in_window": level.clipped_in_window,
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
