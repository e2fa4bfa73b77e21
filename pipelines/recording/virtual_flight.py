"""The command `virtual flight`: cases of virtual flight tests, one by one or as a challenge."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.virtual_flight.described_wing import read_wing
from acquisition.virtual_flight.drawn_flights import Flight
from acquisition.virtual_flight.flight_folder import write_challenge, write_flight
from acquisition.virtual_flight.flight_test import CARD
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.recorded_flight import drawn_laboratory
from pipelines.report.free_place import require_free_folder, require_free_place
from pipelines.report.progress import progress
from sloshlab import atomic_file
from sloshlab.errors import InputError

MOST_CASES: Final = 1000
_OF_THE_WING: Final = tuple(
    each.name for each in dataclasses.fields(HiddenFlight) if isinstance(each.default, float)
)
_OF_A_TANK: Final = ("threshold_g", "peak_w_bar", "effective_mass", "fill_level", "liquid_loss_kg_per_s")


def make_flight(model: Path | None, output: Path, *, seed: int, hide: str) -> dict[str, Any]:
    """Fly one card of tests and write it as a case; return the summary of the command.

    Parameters
    ----------
    model : Path or None
        Of the wing, as it is believed.
    output : Path
        Folder of the case.
    seed : int
        Of the laboratory, of what is done, and of noise.
    hide : str
        ``NAME=VALUE,...``, what is hidden; a number of a tank is ``tank_2.NAME``.

    Raises
    ------
    InputError
        If the model is bad, a number is unknown, or the folder is in use.
    """
    require_free_folder(output, f"--output {output}")
    _require_empty(output)
    wing = read_wing(_required(model))
    hidden = hidden_of(hide, len(wing.tanks))
    laboratory = drawn_laboratory(wing, np.random.default_rng([seed, 10]))
    flight = Flight(output.name, wing, hidden, laboratory, CARD, {}, [seed, 20])
    with atomic_file.filled_folder(output) as complete:
        write_flight(complete, flight)
    lines = [
        f"{len(CARD)} recordings in {output / 'recordings'}",
        f"hidden: {hide or 'nothing'}",
        f"diagnose it: sloshlab diagnose {output}",
    ]
    return {"lines": lines, "case": str(output), "recordings": len(CARD), "laboratory": laboratory.factors}


def make_flight_challenge(
    model: Path | None, output: Path, truths: Path | None, *, n_cases: int, seed: int
) -> dict[str, Any]:
    """Draw flights as a challenge, its truths elsewhere; return the summary of the command.

    Parameters
    ----------
    model : Path or None
    output : Path
        Folder of the challenge.
    truths : Path or None
        JSON file for `sloshlab trial commit`.
    n_cases : int
    seed : int

    Raises
    ------
    InputError
        If the model is bad, there is no place for the truths, or a place is in use.
    """
    if truths is None:
        remedy = "--truths FILE.json outside of the challenge"
        raise InputError("--truths", got="no file for what is hidden", allowed="a file", remedy=remedy)
    if not 1 <= n_cases <= MOST_CASES:
        raise InputError("--cases", got=str(n_cases), allowed=f"1 … {MOST_CASES}")
    if output.resolve() in truths.resolve().parents:
        raise InputError(f"--truths {truths}", got="a place within the challenge", allowed="a file outside")
    require_free_folder(output, f"--output {output}")
    _require_empty(output)
    wing = read_wing(_required(model))
    require_free_place(truths, overwrite=False, described="--truths")
    with progress("drawing flights", n_cases) as advance:
        flights = write_challenge(output, truths, wing, n_cases=n_cases, seed=seed, said=advance)
    lines = [
        f"{len(flights)} flights in {output / 'cases'}, truths in {truths}",
        f"commit to them: sloshlab trial commit {output} {truths} -o KEPT",
    ]
    return {"lines": lines, "cases": len(flights), "truths": str(truths)}


def hidden_of(text: str, n_tanks: int) -> HiddenFlight:
    """What is hidden, from ``NAME=VALUE,...``.

    Parameters
    ----------
    text : str
    n_tanks : int

    Raises
    ------
    InputError
        If a name or a number is none.

    Examples
    --------
    >>> hidden_of("lift_gain=0.2", 2).lift_gain
    0.2
    """
    of_wing: dict[str, float] = {}
    of_tanks: dict[int, dict[str, float]] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise InputError(f"--hide {part[:60]}", got="no number", allowed="NAME=VALUE,...") from None
        tank, _, own = name.partition(".")
        if name in _OF_THE_WING:
            of_wing[name] = number
        elif own in _OF_A_TANK and tank in (f"tank_{i + 1}" for i in range(n_tanks)):
            of_tanks.setdefault(int(tank.removeprefix("tank_")) - 1, {})[own] = number
        else:
            allowed = f"{', '.join(_OF_THE_WING)}; tank_1.NAME of {', '.join(_OF_A_TANK)}"
            raise InputError(f"--hide {name[:40]}", got="no such number", allowed=allowed)
    return dataclasses.replace(
        HiddenFlight(**of_wing),  # type: ignore[arg-type]  # floats by their names
        sloshing={
            tank: (numbers.get("threshold_g", 1.0), numbers["peak_w_bar"])
            for tank, numbers in of_tanks.items()
            if "peak_w_bar" in numbers
        },
        effective_mass=_by_tank(of_tanks, "effective_mass"),
        fill_levels=_by_tank(of_tanks, "fill_level"),
        liquid_loss_kg_per_s=_by_tank(of_tanks, "liquid_loss_kg_per_s"),
    )


def _by_tank(of_tanks: dict[int, dict[str, float]], name: str) -> dict[int, float]:
    return {tank: numbers[name] for tank, numbers in of_tanks.items() if name in numbers}


def _required(model: Path | None) -> Path:
    if model is None:
        raise InputError("--model", got="nothing", allowed="the model file of a wing", remedy="--model MODEL.toml")
    return model


def _require_empty(output: Path) -> None:
    if output.exists() and any(output.iterdir()):
        raise InputError(f"--output {output}", got="a folder with files in it", allowed="a new or empty one")
