"""Speed of wings: the cantilever wing with eight tanks, a virtual flight test, an aircraft with eight models.

`python -m tests.benchmarks.flights` prints JSON.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Final

from tests.benchmarks.measurements import processor_s

REPOSITORY: Final = Path(__file__).resolve().parents[2]
WING: Final = REPOSITORY / "raw_data" / "aircraft" / "single_aisle" / "wing.toml"
MODEL_IN_FLIGHT: Final = REPOSITORY / "docs" / "examples" / "flight_wing.toml"
AIR_LABEL: Final = "wing with eight tanks: forces of the air on its nodes [s]"
FLUTTER_LABEL: Final = "wing with eight tanks: model, air on its modes and flutter [s]"
FLIGHT_LABEL: Final = "virtual flight test of a wing with two tanks [s]"
FLUTTER_SPEED_M_PER_S: Final = 319.3


def flight_figures() -> dict[str, float]:
    """Processor times, each of one run; kernels of the flight are compiled by a first one."""
    from pipelines.recording.virtual_flight import make_flight
    from sloshlab.aircraft.wing_air import air_on_nodes
    from sloshlab.aircraft.wing_calibration import wing_state
    from sloshlab.aircraft.wing_file import load_wing
    from tests.benchmarks.tanks_in_flight import figures as tanks_in_flight

    wing, kept = load_wing(WING), []
    found = {AIR_LABEL: processor_s(lambda: kept.append(air_on_nodes(wing, wing.flow.mach)[0]))}
    found[FLUTTER_LABEL] = processor_s(lambda: wing_state(wing, kept[0], FLUTTER_SPEED_M_PER_S))
    with tempfile.TemporaryDirectory() as name:
        times = [
            processor_s(lambda at=number: make_flight(MODEL_IN_FLIGHT, Path(name, str(at)), seed=at, hide=""))  # type: ignore[misc]
            for number in range(3)
        ]
    found[FLIGHT_LABEL] = min(times[1:])
    return found | tanks_in_flight()


if __name__ == "__main__":
    print(json.dumps(flight_figures(), indent=1, ensure_ascii=False))
