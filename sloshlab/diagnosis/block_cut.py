"""Which block owns how much of the mismatch, for a twin of several blocks whose motion is measured.

Every block is fed what was measured: what a place would have to do beyond the retuned baseline, so that the
channels follow, is the least-squares solution of residual = transfer × what it lacks, band by band. Its share of
the mismatch is what that solution explains beyond what any direction would explain of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.places import SENSOR, block_of
from sloshlab.diagnosis.inference.run_noise import run_noise
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.observations import Observation
from sloshlab.missing_force.interface_cut import N_DRAWS, BlockCut, InterfaceCut
from sloshlab.missing_physics.extension import NOTHING

FloatArray = NDArray[np.float64]
_FED_WITH: Final = {
    "aerodynamics": "measured motion of the wing",
    "tank": "measured acceleration of the tank",
    "control": "command of the flap",
    "excitation": "measured gust",
    "structure": "forces of the other blocks",
    SENSOR: "what the other sensors say",
}
_COMPARED: Final = {
    "aerodynamics": "lift that it lacks",
    "tank": "force of the liquid that it lacks",
    "control": "angle of the flap that it lacks",
    "excitation": "gust that it lacks",
    "structure": "force that it lacks",
    SENSOR: "one channel",
}


def block_cut(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], values: Mapping[str, float], seed: int = 0
) -> InterfaceCut:
    """Cut the system open at its blocks.

    Parameters
    ----------
    model : DiagnosedModel
        Of several blocks.
    runs : sequence of sequences of Observation
        Per run.
    values : mapping
        Of the retuned baseline.
    seed : int
        Of the draws for intervals.
    """
    usable = [run for run in runs if run]
    explained: dict[str, FloatArray] = {}
    total = np.zeros(len(usable))
    for number, run in enumerate(usable):
        noise = run_noise(model, run, values)
        readings = model.simulate(run[0].run, values, NOTHING)
        residual = noise.whitened(np.stack([each.residual(readings[each.channel]) for each in run]))
        # of noise every coefficient has one, and every direction explains one
        total[number] = (residual**2).sum() - residual.size
        for place, (projections, shares) in noise.places.items():
            shown = shares > 0
            along = (np.einsum("bkmc,cbk->bkm", projections, residual) ** 2)[shown]
            explained.setdefault(place, np.zeros(len(usable)))[number] = along.sum() - shown.sum()
    return InterfaceCut(_cuts(explained, total, seed), (), "", "", ())


def _cuts(explained: Mapping[str, FloatArray], total: FloatArray, seed: int) -> tuple[BlockCut, ...]:
    """Of every block its best place, with an interval by drawing runs with replacement."""
    generator = np.random.default_rng(seed)
    drawn = generator.integers(0, max(total.size, 1), (N_DRAWS, max(total.size, 1)))
    best: dict[str, tuple[float, str]] = {}
    for place, own in explained.items():
        share = _share(float(own.sum()), float(total.sum()))
        if block_of(place) not in best or share > best[block_of(place)][0]:
            best[block_of(place)] = (share, place)
    cuts = []
    for block, (share, place) in best.items():
        own = explained[place]
        draws = [_share(float(own[chosen].sum()), float(total[chosen].sum())) for chosen in drawn]
        low, high = np.quantile(draws, (0.05, 0.95))
        size = float(np.sqrt(max(own.sum(), 0.0)))
        is_known = total.sum() > 0
        cuts.append(
            BlockCut(
                block,
                _FED_WITH.get(block, "what drives it"),
                f"{_COMPARED.get(block, 'what it lacks')}: {place}",
                share if is_known else float("nan"),
                min(float(low), share) if is_known else float("nan"),
                max(float(high), share) if is_known else float("nan"),
                size,
                1.0,
                "" if is_known else "within noise",
            )
        )
    return tuple(cuts)


def _share(own: float, total: float) -> float:
    return float(np.clip(own / total, 0.0, 1.0)) if total > 0 else 0.0
