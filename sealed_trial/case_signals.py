"""All runs of a case as perfect sensors would show them, with and without what is hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from sealed_trial.hidden_physics.effect import Change, Scales, Signals
from sealed_trial.laboratory.hidden_rig import HiddenRig
from sealed_trial.laboratory.recorder import Recorder
from sealed_trial.laboratory.signals import Setting, true_signals
from sealed_trial.laboratory.test_plan import TestPlan

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Laboratory:
    """A rig, a plan, the seed of its motions, and the recorder of all channels."""

    rig: HiddenRig
    plan: TestPlan
    seed: int
    recorder: Recorder = field(default_factory=Recorder)

    def signals(self, changes: Sequence[Change] = (), *, relative_tolerance: float = 1e-9) -> list[Signals]:
        """Perfect signals of every run, as the chains pass them on before noise.

        Raises
        ------
        ArithmeticError
            If a motion diverges.
        """
        system = self.rig.system(sum(change.compliance_rad_per_n_m for change in changes))
        kernel: dict[int, float] = {}
        for change in changes:
            kernel |= {place: value + kernel.get(place, 0.0) for place, value in change.kernel.items()}
        base = system.parameters
        never_zero = {place for place in kernel if base[place] == 1.0}
        system = system.with_parameters(
            {place: value + (0.0 if place in never_zero else base[place]) for place, value in kernel.items()}
        )
        exponents = [change.relaxation_exponent for change in changes if change.relaxation_exponent]
        system = replace(system, relaxation_exponent=exponents[0] if exponents else 0.0)
        obeyed = [change.obeyed for change in changes if change.obeyed is not None]
        setting = Setting(self.plan, self.seed, self.recorder, obeyed[0] if obeyed else None)
        runs = []
        for number, run in enumerate(self.plan.runs):
            own: dict[int, float] = {}
            for change in changes:
                own |= change.kernel_of_run(number)
            runs.append(
                true_signals(
                    self.rig, system.with_parameters(own), run, setting, relative_tolerance=relative_tolerance
                )
            )
        for change in changes:
            runs = change.distorted(runs, self.plan.sampling_rate_hz)
        return runs


def scales_of(laboratory: Laboratory, runs: Sequence[Signals]) -> Scales:
    """Sizes of a case without anything hidden."""
    rig = laboratory.rig
    names = list(runs[0])
    rms = {name: max(float(np.sqrt(np.mean(run[name] ** 2))) for run in runs) for name in names}
    peak = {name: max(float(np.abs(run[name]).max()) for run in runs) for name in names}
    tank = next(name for name in ("acceleration_tip", "acceleration_control") if name in names)
    acceleration = peak[tank]
    system = rig.system()
    if rig.kind == "shaker":
        frequencies = [f for run in laboratory.plan.runs for f in run.frequencies_hz]
        rate = 2 * np.pi * float(np.exp(np.mean(np.log(frequencies))))
        stiffness, mass = 0.0, rig.carried_mass_kg
        displacement = acceleration / rate**2
    else:
        mass, stiffness = float(system.mass[0, 0]), float(system.stiffness[0, 0])
        rate = float(np.sqrt(stiffness / mass))
        displacement = max(_stretch(run, rate) for run in runs)
    return Scales(
        displacement_m=displacement,
        velocity_m_per_s=displacement * rate,
        acceleration_g=acceleration / 9.81,
        stiffness_n_per_m=stiffness,
        mass_kg=mass,
        rate_rad_per_s=rate,
        liquid_mass_kg=rig.liquid_mass_kg,
        room_m=rig.tank.height_m * (1 - rig.tank.fill_level),
        length_m=rig.beam.length_m if rig.beam is not None else 0.0,
        rms=rms,
        peak=peak,
    )


def _stretch(run: Signals, rate_rad_per_s: float) -> float:
    """Peak displacement relative to the base, from the first mode alone."""
    relative = run["acceleration_tip"] - run["acceleration_root"]
    return float(np.abs(relative).max()) / rate_rad_per_s**2
