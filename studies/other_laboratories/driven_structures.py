"""Driven structures: a drive that saturates, pulses that nobody told the twin of, and repeats that are none."""

from __future__ import annotations

from typing import Final

import numpy as np

from studies.other_laboratories.case_files import LaboratoryCase, RightAnswer, Run
from studies.other_laboratories.integration import FloatArray, Sampling, integrated, multisine

SAMPLING: Final = Sampling(500.0, 2000, 8)

_SHAKING_TABLE: Final = '''"""A table on springs under a drive that is told a force; only its speed is measured."""

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading


def table(run, values):
    return Mechanism(
        mass_kg=values["mass"],
        stiffness_n_per_m=values["stiffness"],
        damping_n_s_per_m=values["damping"],
        driving_force_n=run.channels["force_command"],
        readings={"velocity_table": Reading(velocity=1.0)},
    )


TWIN = MechanicalTwin(
    parameters=[
        Parameter("mass", 12.0, 0.12, "kg"),
        Parameter("stiffness", 3.0e4, 6e2, "N m-1"),
        Parameter("damping", 120.0, 24.0, "N s m-1"),
    ],
    driving=["force_command"],
    compared={"velocity_table": "m s-1"},
    mechanism=table,
)
'''


def saturating_drive() -> list[LaboratoryCase]:
    """A shaking table whose drive gives at most 25 N, whatever it is told; command and motion are known."""
    limit_n, mass, stiffness, damping = 25.0, 12.06, 3.03e4, 112.0

    def rates(state: FloatArray, force: FloatArray) -> FloatArray:
        x, v = state
        return np.stack([v, (np.clip(force, -limit_n, limit_n) - stiffness * x - damping * v) / mass])

    levels = (8.0, 16.0, 30.0)
    commands = np.stack([multisine(SAMPLING, (2.0, 30.0), rms, seed=71 + i) for i, rms in enumerate(levels)])
    speed = integrated(rates, np.zeros((2, 3)), commands, SAMPLING)[:, 1].T
    runs = [
        Run(
            f"level_{rms:g}n_{repeat}",
            {"force_command": SAMPLING.samples(command), "velocity_table": velocity},
            {"test": f"{rms:g} N", "repeat": repeat},
        )
        for rms, command, velocity in zip(levels, commands, speed, strict=True)
        for repeat in (1, 2)
    ]
    right = [
        *(RightAnswer(verdict, ("actuator_saturation",)) for verdict in ("named", "indistinguishable")),
        RightAnswer("unknown", block="excitation"),
        RightAnswer("unknown", block="structure"),
    ]
    story = "A shaking table whose drive saturates; only the command and the motion are recorded."
    noise, numbers = {"velocity_table": 1e-4}, {"limit_n": limit_n}
    return [
        LaboratoryCase(
            "saturating_drive",
            story,
            SAMPLING.rate_hz,
            runs,
            noise,
            right,
            numbers,
            twin=_SHAKING_TABLE,
            seed=7,
        )
    ]


_TWO_MASSES: Final = '''"""Two masses on springs, driven at the first by a random force."""

import numpy as np

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading


def structure(run, values):
    first, second = values["spring 1"], values["spring 2"]
    return Mechanism(
        mass_kg=np.diag([6.0, 4.0]),
        stiffness_n_per_m=[[first + second, -second], [-second, second]],
        damping_n_s_per_m=values["damping"] * np.array([[20.0, -8.0], [-8.0, 8.0]]),
        driving_force_n=run.channels["force_drive"],
        driven_along=(1.0, 0.0),
        acts_along=(0.0, 1.0),
        readings={
            "acceleration_mass1": Reading(acceleration=(1.0, 0.0)),
            "acceleration_mass2": Reading(acceleration=(0.0, 1.0)),
        },
    )


TWIN = MechanicalTwin(
    parameters=[
        Parameter("spring 1", 4.0e4, 8e2, "N m-1"),
        Parameter("spring 2", 2.5e4, 5e2, "N m-1"),
        Parameter("damping", 1.0, 0.2),
    ],
    driving=["force_drive"],
    compared={"acceleration_mass1": "m s-2", "acceleration_mass2": "m s-2"},
    mechanism=structure,
)
'''
PULSE_N: Final = 180.0
PULSE_LENGTH_S: Final = 0.012


def pulse_train() -> list[LaboratoryCase]:
    """Pulses of ±180 N on the second of two masses, at the same instants in every repeat, or at others."""
    right = [
        *(RightAnswer(verdict, ("external_force",)) for verdict in ("named", "indistinguishable")),
        RightAnswer("unknown", block="structure"),
    ]
    noise = {"acceleration_mass1": 0.05, "acceleration_mass2": 0.05}
    numbers = {"size_n": PULSE_N, "length_s": PULSE_LENGTH_S}
    stories = {
        "pulse_train": "Pulses of ±180 N, at the same instants in every repeat, that nobody told the twin of.",
        "pulse_train_unsynchronised": "Pulses of ±180 N by a machine next door, at other instants in each repeat.",
    }
    return [
        LaboratoryCase(
            name,
            story,
            SAMPLING.rate_hz,
            _pulsed_runs(synchronised=name == "pulse_train"),
            noise,
            right,
            numbers,
            twin=_TWO_MASSES,
            seed=9,
        )
        for name, story in stories.items()
    ]


def pulses(time_s: FloatArray, first_s: float) -> FloatArray:
    """Half-sine pulses of alternating sign, one in 0.45 s [N]."""
    since = time_s - first_s
    number = np.floor(since / 0.45)
    within = since - 0.45 * number
    shape = np.where((number >= 0) & (within < PULSE_LENGTH_S), np.sin(np.pi * within / PULSE_LENGTH_S), 0.0)
    return PULSE_N * (1 - 2 * (number % 2)) * shape


def _pulsed_runs(*, synchronised: bool) -> list[Run]:
    first, second = 4.03e4, 2.49e4
    stiffness = np.array([[first + second, -second], [-second, second]])
    damping = 1.05 * np.array([[20.0, -8.0], [-8.0, 8.0]])
    masses = np.array([[6.0], [4.0]])
    levels = (15.0, 30.0, 60.0)
    repeated = [(number, rms, repeat) for number, rms in enumerate(levels) for repeat in (1, 2)]
    drives = np.stack([multisine(SAMPLING, (3.0, 60.0), rms, seed=91 + number) for number, rms, _ in repeated])
    instants = np.random.default_rng(17).uniform(0.1, 0.5, (len(levels), 2))
    struck = np.stack(
        [
            pulses(SAMPLING.half_steps_s, instants[number, 0 if synchronised else repeat - 1])
            for number, _, repeat in repeated
        ]
    )

    def rates(state: FloatArray, forces: FloatArray) -> FloatArray:
        x, v = state[:2], state[2:]
        return np.concatenate([v, (forces.reshape(2, -1) - stiffness @ x - damping @ v) / masses])

    both = np.concatenate([drives, struck])
    state = integrated(rates, np.zeros((4, len(repeated))), both, SAMPLING)
    sampled = np.stack([SAMPLING.samples(force) for force in both])
    acceleration = np.stack([rates(state[i], sampled[:, i])[2:] for i in range(SAMPLING.n_samples)])
    return [
        Run(
            f"level_{rms:g}n_{repeat}",
            {
                "force_drive": sampled[i],
                "acceleration_mass1": acceleration[:, 0, i],
                "acceleration_mass2": acceleration[:, 1, i],
            },
            {"test": f"{rms:g} N", "repeat": repeat},
        )
        for i, (_, rms, repeat) in enumerate(repeated)
    ]


_RELEASED: Final = '''"""A mass on a spring, let go."""

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading


def oscillator(run, values):
    return Mechanism(
        mass_kg=2.2,
        stiffness_n_per_m=values["stiffness"],
        damping_n_s_per_m=values["damping"],
        initial_displacement_m=values["start"],
        readings={"displacement_mass": Reading(1.0), "acceleration_mass": Reading(acceleration=1.0)},
    )


TWIN = MechanicalTwin(
    parameters=[
        Parameter("stiffness", 3.7e3, 1e2, "N m-1"),
        Parameter("damping", 1.2, 0.3, "N s m-1"),
        Parameter("start", 0.03, 0.001, "m", each_run=True),
    ],
    driving=[],
    compared={"displacement_mass": "m", "acceleration_mass": "m s-2"},
    mechanism=oscillator,
)
'''
_DRIVEN: Final = '''"""A mass on a spring, driven by a known force."""

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading


def oscillator(run, values):
    return Mechanism(
        mass_kg=2.2,
        stiffness_n_per_m=values["stiffness"],
        damping_n_s_per_m=values["damping"],
        driving_force_n=run.channels["force_drive"],
        readings={"acceleration_mass": Reading(acceleration=1.0)},
    )


TWIN = MechanicalTwin(
    parameters=[Parameter("stiffness", 3.7e3, 1e2, "N m-1"), Parameter("damping", 1.2, 0.3, "N s m-1")],
    driving=["force_drive"],
    compared={"acceleration_mass": "m s-2"},
    mechanism=oscillator,
)
'''
RIGS_HZ: Final = (6.42, 6.61)
"""Natural frequencies of the two rigs whose runs call themselves repeats."""


def not_repeats() -> list[LaboratoryCase]:
    """Runs of two rigs, 6.42 and 6.61 Hz, that call themselves repeats of one test: decays, and driven ones."""
    right = [RightAnswer("refused", says="repeats")]
    mass, loss = 2.2, 1.2
    stiffness = mass * (2 * np.pi * np.array(RIGS_HZ)) ** 2

    def rates(state: FloatArray, force: FloatArray) -> FloatArray:
        x, v = state
        return np.stack([v, (force - stiffness * x - loss * v) / mass])

    force = multisine(SAMPLING, (2.0, 20.0), 5.0, seed=111)
    drives = {"decays": np.zeros((2, force.size)), "driven": np.stack([force, force])}
    start = {"decays": np.array([[0.03, 0.03], [0.0, 0.0]]), "driven": np.zeros((2, 2))}
    cases = []
    for name, drive in drives.items():
        state = integrated(rates, start[name], drive, SAMPLING)
        runs = []
        for i in range(2):
            sampled = SAMPLING.samples(drive[i])
            acceleration = (sampled - stiffness[i] * state[:, 0, i] - loss * state[:, 1, i]) / mass
            shown = {"displacement_mass": state[:, 0, i]} if name == "decays" else {"force_drive": sampled}
            runs.append(Run(f"run_{i + 1}", {**shown, "acceleration_mass": acceleration}, {"repeat": i + 1}))
        cases.append(
            LaboratoryCase(
                f"not_repeats_{name}",
                "Two runs that call themselves repeats of one test, of rigs of 6.42 and 6.61 Hz.",
                SAMPLING.rate_hz,
                runs,
                {"displacement_mass": 1e-5, "acceleration_mass": 0.02},
                right,
                {"frequency_1_hz": RIGS_HZ[0], "frequency_2_hz": RIGS_HZ[1]},
                twin=_RELEASED if name == "decays" else _DRIVEN,
                seed=11,
            )
        )
    return cases
