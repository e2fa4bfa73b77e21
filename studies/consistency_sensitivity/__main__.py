"""``python -m studies.consistency_sensitivity FOLDER``: damage every case and draw what is found.

About an hour on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path

from studies.consistency_sensitivity.figures import (
    draw_matrix,
    draw_operating_points,
    moves,
    read_outcomes,
    summary,
)
from studies.consistency_sensitivity.measurement import CASES, write_outcomes
from studies.consistency_sensitivity.operating_points import (
    FACTORS,
    false_alarm_shares,
    found_shares,
    write_points,
)

IMAGES = Path("docs/images")


def main(folder: Path) -> None:
    """Outcomes that are there already are used."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = folder / "outcomes.jsonl"
    if not lines.exists():
        for files in CASES:
            write_outcomes(files, lines)
    outcomes = read_outcomes(lines)
    draw_matrix(outcomes, IMAGES / "consistency_found.png")
    moving = {(one["case"], one["damage"], one["size"]) for one in outcomes if moves(one)}
    recordings = sorted(path for path in Path("raw_data").rglob("*.nc") if "transients" not in path.parts)
    found, alarms = found_shares(CASES[::3], moving), false_alarm_shares(recordings)
    write_points(folder / "operating_points.json", found, alarms)
    points = [{"factor": factor, "found": found[factor], "false_alarms": alarms[factor]} for factor in FACTORS]
    draw_operating_points(points, IMAGES / "consistency_operating_points.png")
    sys.stdout.write(summary(outcomes) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/consistency"))
