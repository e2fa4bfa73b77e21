"""A model trained on random motion, too, against one of the slow run only: many frequencies at once.

Random motion is that of the tank on the beam whose root moves with 0.2 g RMS: 60 s of it train, the last 30 s stop
the training. The runs at 0.1 and 0.4 g choose nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from studies.beyond_the_source.models import Workshop
from studies.beyond_the_source.recordings import Recordings, part

STARTS: Final = (0, 1)


def frequency_lines(recordings: Recordings, workshop: Workshop) -> list[str]:
    """Return the table as lines of text.

    Parameters
    ----------
    recordings : Recordings
    workshop : Workshop
    """
    slow, slow_validation, random = recordings.vfa(480), recordings.vfa(240), recordings.beam_random(0.2)
    training, validation = [slow, part(random, 0.0, 60.0)], [slow_validation, part(random, 60.0, 90.0)]
    kinds = {
        "slow run only": [
            workshop.model("slow_no_state", [slow], [slow_validation], seed=seed) for seed in STARTS
        ],
        "with random motion": [
            workshop.model("random_no_state", training, validation, seed=seed) for seed in STARTS
        ],
    }
    unseen = [recordings.beam_random(level_g) for level_g in (0.1, 0.4)]
    known = {"validation: slow run": slow_validation, "validation: random": validation[1]}
    lines = ["fit of the force and predicted over recorded work, mean ± standard deviation of the starts"]
    lines.append(f"  {'run':26s}" + "".join(f"{name:>34s}" for name in kinds))
    for name, run in {**known, **{signals.name: signals for signals in unseen}}.items():
        lines.append(
            f"  {name.removeprefix('fill_0.50_'):26s}" + "".join(_cell(models, run) for models in kinds.values())
        )
    return lines


def _cell(models: Sequence[ReducedOrderModel], run: LiquidSignals) -> str:
    fits, ratios = [], []
    for model in models:
        simulated = model.simulate(run.velocity_m_per_s)
        known = np.isfinite(simulated) & np.isfinite(run.dynamic_force_n) & np.isfinite(run.velocity_m_per_s)
        fits.append(fit_quality(run.dynamic_force_n, simulated).fit_percent)
        velocity = run.velocity_m_per_s[known]
        ratios.append(float(simulated[known] @ velocity) / float(run.dynamic_force_n[known] @ velocity))
    fit = f"{np.mean(fits):.1f} ± {np.std(fits, ddof=1):.1f} %"
    return f"{fit:>18s}{f'{np.mean(ratios):.2f} ± {np.std(ratios, ddof=1):.2f}':>16s}"
