"""Measurements in processes of their own, so that none shares memory, caches or threads with another."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping


class MeasurementError(RuntimeError):
    """A measurement that ended before it had a figure; its message is the last line that its process said."""


def measured_apart(
    module: str, *arguments: object, environment: Mapping[str, str] | None = None
) -> dict[str, float]:
    """Run `python -m module arguments…` and read the figures that it prints last, as JSON.

    Parameters
    ----------
    module : str
    *arguments : object
    environment : mapping, optional
        Variables that differ from those of this process.

    Raises
    ------
    MeasurementError
        If the process fails, or its last line is no JSON.
    """
    command = [sys.executable, "-m", module, *map(str, arguments)]
    told = os.environ | dict(environment or {})
    done = subprocess.run(command, env=told, capture_output=True, text=True, check=False)
    if done.returncode:
        raise MeasurementError(last_line(done.stderr) or f"{module} ended with {done.returncode}")
    try:
        return dict(json.loads(last_line(done.stdout)))
    except ValueError:
        raise MeasurementError(f"{module} printed no figures") from None


def last_line(text: str) -> str:
    """The last line with anything in it, or nothing."""
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "")
