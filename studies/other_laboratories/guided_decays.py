"""Six decays of the guided tank by this project's own virtual laboratory, its friction told to the twin or not."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.virtual_laboratory.structure_rig import structure_laboratory
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from sloshlab.rig import Rig
from studies.other_laboratories.case_files import FloatArray, LaboratoryCase, RightAnswer, Run
from studies.other_laboratories.late_recorder import SDOF_RIG

FRICTION_N: Final = 0.325
"""With the moving mass of 2.241 kg its reversal is a jump of 0.29 m/s²."""
LEVELS_M: Final = (0.02, 0.04, 0.064)
SEEDS: Final = (0, 1, 2)
"""Of the laboratory: in the first everything is as believed, the others are a little off."""
QUIET_NOISE: Final = {"acceleration_tip": 0.0015, "force_interface": 0.00375, "displacement_tank": 7.5e-7}
"""A tenth of the noise that the virtual laboratory has at these levels."""
_WITH_FRICTION: Final = SDOF_RIG.replace("[twin]", f"coulomb_force_n = {FRICTION_N}\n[twin]")


def guided_decays() -> list[LaboratoryCase]:
    """Three levels twice, for several seeds, with the friction left out of the rig file and in it."""
    cases = []
    for seed in SEEDS:
        runs = _runs(seed)
        friction = [RightAnswer(verdict, ("coulomb_friction",)) for verdict in ("named", "indistinguishable")]
        for name, rig, right in (
            ("left_out", SDOF_RIG, friction),
            ("known", _WITH_FRICTION, [RightAnswer("nothing_missing")]),
        ):
            cases.append(
                LaboratoryCase(
                    f"guided_friction_{name}_{seed}",
                    f"Six quiet decays of the guided tank, frozen; the friction of its guide is {name}.",
                    1024.0,
                    runs,
                    QUIET_NOISE,
                    right,
                    {"force_n": FRICTION_N},
                    rig=rig,
                    seed=200 + seed,
                )
            )
    return cases


def _runs(seed: int) -> list[Run]:
    rig = Rig.from_toml_text(_WITH_FRICTION)
    laboratory = structure_laboratory(rig, seed or None)
    runs = []
    for level in LEVELS_M:
        recorded = virtual_structure_run(
            rig,
            experiment="sdof_free",
            configuration="frozen",
            duration_s=5.0,
            initial_displacement_m=level,
            imperfect=False,
            laboratory=laboratory,
        )
        channels: dict[str, FloatArray] = {
            str(name): np.asarray(variable.values, np.float64) for name, variable in recorded.data_vars.items()
        }
        for repeat in (1, 2):
            attributes = {"experiment": "sdof_free", "initial_displacement_m": level, "repeat": repeat}
            runs.append(Run(f"release_{1000 * level:g}mm_{repeat}", channels, attributes))
    return runs
