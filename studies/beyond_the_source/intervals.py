"""How often recorded forces lie within the intervals of an ensemble, on runs that it has not seen."""

from __future__ import annotations

from typing import Final

import numpy as np

from studies.beyond_the_source.models import Workshop
from studies.beyond_the_source.recordings import Recordings

N_MEMBERS: Final = 4
PROBABILITIES: Final = (0.5, 0.9)
SWEEPS_G: Final = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
BEAM_LEVELS_G: Final = (0.1, 0.2, 0.4)


def interval_lines(recordings: Recordings, workshop: Workshop) -> list[str]:
    """Return the table as lines of text.

    Parameters
    ----------
    recordings : Recordings
    workshop : Workshop
    """
    validation = recordings.vfa(240)
    ensemble = workshop.ensemble("vfa", [recordings.vfa(480)], [validation], n_members=N_MEMBERS)
    residual = ensemble.residual
    lines = [
        f"{N_MEMBERS} members; residual of the validation run: σ² = Var + ({residual.constant:.3f} N)² + "
        f"({residual.slope:.3f})² ⟨ŷ²⟩; |e|/σ up to {residual.reach_of(0.9):.2f} at 90 %",
        f"  {'run':26s}{'50 %':>8s}{'90 %':>8s}{'half width (90 %)':>22s}{'members':>16s}{'rms force':>12s}",
    ]
    runs = {"validation": validation}
    runs |= {f"sweep {level_g:g} g": recordings.sweep(level_g) for level_g in SWEEPS_G}
    runs |= {f"beam, random {level_g:g} g": recordings.beam_random(level_g) for level_g in BEAM_LEVELS_G}
    runs |= {decay.name: decay for decay in recordings.decays(14.6)}
    for name, run in runs.items():
        ranges = [ensemble.predicted_range(run.velocity_m_per_s, probability) for probability in PROBABILITIES]
        covered = "".join(
            f"{100 * predicted_range.coverage(run.dynamic_force_n):6.1f} %" for predicted_range in ranges
        )
        half = float(np.nanmean(ranges[1].upper - ranges[1].lower)) / 2
        alone = float(np.sqrt(np.nanmean(ranges[1].members_std ** 2)))
        rms = float(np.sqrt(np.nanmean(run.dynamic_force_n**2)))
        lines.append(f"  {name:26s}{covered}{half:20.2f} N{alone:14.2f} N{rms:10.2f} N")
    return lines
