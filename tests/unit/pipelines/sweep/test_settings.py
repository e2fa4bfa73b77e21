"""Settings of the sweep analysis: the usual ones need no argument."""

from __future__ import annotations

import inspect
from typing import Any

from pipelines.commands import analysis
from pipelines.sweep.shaker import ShakerSettings
from sloshlab.sweep.windows import WindowSettings


def test_settings_without_arguments_are_those_of_the_command() -> None:
    options: dict[str, Any] = dict(inspect.signature(analysis.shaker).parameters)
    chosen = {name: options[name].default for name in ("p", "m", "boundaries", "allow_incomplete")}
    assert ShakerSettings() == ShakerSettings.checked(**chosen)
    assert ShakerSettings().windows == WindowSettings(half_width_cycles=6, spacing_cycles=24)
