"""How far the scaling law (2.33–2.35) may be wrong: an error bar for W̄ and β of a model in a tank of another size.

The law disregards Reynolds and Bond number. What their change does was computed with a numerical tank in
similarity, and, where that computes nothing, estimated (`docs/scaling.md`); the numbers below are those of
`raw_data/tank_scaling/law.json`, made by `make tank-scaling`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

COMPUTED: Final = (
    # factor of the Reynolds number, rms change of W̄ in shares, rms change of β
    (0.04**1.5, 0.4772, 0.0667),
    (0.1**1.5, 0.2230, 0.0312),
    (0.2**1.5, 0.1027, 0.0285),
    (2.0**1.5, 0.0494, 0.0241),
    (5.0**1.5, 0.0696, 0.0368),
    (25.0**1.5, 0.0520, 0.0192),
)
"""Over ten points of ω̄ and acceleration; scatter of the computation is in them."""
WALL_LAYERS: Final = 0.0289
"""Share of the work in Stokes layers along the walls of the training tank, of all points; falls with Re^(−1/2)."""
SURFACE_TENSION: Final = 0.1222
"""The same for making surface, by order of magnitude; falls with 1/Bo."""


@dataclass(frozen=True)
class ScalingError:
    """Standard error that the law adds to what a model says.

    Attributes
    ----------
    work : float
        Of W̄, in shares of it.
    beta : float
        Of β.
    is_tested : bool
        Whether the Reynolds number is within what was computed.
    """

    work: float
    beta: float
    is_tested: bool

    def __str__(self) -> str:
        beyond = "" if self.is_tested else ", beyond the sizes that were computed"
        return f"W̄ ± {100 * self.work:.0f} %, β ± {self.beta:.2f} by the scaling{beyond}"


def scaling_error(reynolds: float, bond: float) -> ScalingError:
    """Return the error bar of the law.

    Parameters
    ----------
    reynolds, bond : float
        Factors of Reynolds and Bond number from the tank of the training to this one, above 0.

    Notes
    -----
    Root of the sum of squares of the computed change, of s_w |Re^(−1/2) − 1| for the layers along the walls and of
    s_σ |1/Bo − 1| for surface tension. The computed change is interpolated in ln Re; beyond the smallest and the
    largest that were computed it stays, and `is_tested` says so.
    """
    way = math.copysign(1.0, math.log(reynolds))
    distance = abs(math.log(reynolds))
    computed = sorted((way * math.log(factor), *change) for factor, *change in COMPUTED)
    known = np.array([(0.0, 0.0, 0.0), *(row for row in computed if row[0] > 0)])
    # farther away an error does not become smaller; that it seems to is scatter
    work, beta = (
        float(np.interp(distance, known[:, 0], np.maximum.accumulate(known[:, column]))) for column in (1, 2)
    )
    layers = WALL_LAYERS * (reynolds**-0.5 - 1)
    tension = SURFACE_TENSION * (1 / bond - 1)
    return ScalingError(math.hypot(work, layers, tension), beta, bool(distance <= known[-1, 0] + 1e-9))
