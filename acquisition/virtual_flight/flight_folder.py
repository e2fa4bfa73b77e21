"""Cases and challenges of flights on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.drawn_flights import Flight, FlightDrawing
from acquisition.virtual_flight.recorded_flight import perfect_run, write_run
from sloshlab import atomic_file


def write_flight(folder: Path, flight: Flight) -> None:
    """Write one case: the model file as believed, and its recordings.

    Parameters
    ----------
    folder : Path
    flight : Flight
    """
    (folder / "recordings").mkdir(parents=True)
    (folder / "model.toml").write_text(flight.wing.text, "utf-8")
    for number, point in enumerate(flight.card, start=1):
        # repeats of a test share what is done, and nothing else
        readings = perfect_run(
            flight.wing, flight.hidden, flight.laboratory, point, [*flight.seed, 0, number - (point.repeat - 1)]
        )
        noise = np.random.default_rng([*flight.seed, 1, number])
        write_run(folder / "recordings" / f"run_{number:02d}.nc", readings, point, number, noise)


def write_challenge(
    folder: Path,
    truths: Path | None,
    wing: DescribedWing,
    *,
    n_cases: int,
    seed: int,
    said: Callable[[str], None] = lambda name: None,
) -> list[Flight]:
    """Draw flights and write them as a challenge, whole or not at all; truths go elsewhere.

    Parameters
    ----------
    folder : Path
        New, takes ``cases/NAME/``.
    truths : Path or None
        JSON as `sloshlab trial commit` reads it.
    wing : DescribedWing
    n_cases : int
    seed : int
    said : callable, optional
        Told the name of every flight that is drawn.
    """
    flights = FlightDrawing(wing, seed).flights(n_cases, said)
    with atomic_file.filled_folder(folder) as complete:
        for flight in flights:
            write_flight(complete / "cases" / flight.name, flight)
    if truths is not None:
        content = json.dumps({flight.name: flight.truth for flight in flights}, indent=1, sort_keys=True)
        atomic_file.write_bytes(truths, content.encode() + b"\n")
    return flights
