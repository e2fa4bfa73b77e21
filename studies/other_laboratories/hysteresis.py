"""Structures with memory: the published Bouc–Wen benchmark, wire-rope isolators, and two beams with a joint."""

from __future__ import annotations

from string import Template
from typing import Final

import numpy as np

from studies.other_laboratories.case_files import LaboratoryCase, RightAnswer, Run
from studies.other_laboratories.integration import FloatArray, Sampling, integrated, multisine, swept_sine

MASS_KG, DAMPING, STIFFNESS, ALPHA, BETA, GAMMA = 2.0, 10.0, 5e4, 5e4, 800.0, -1100.0
NOISE_M: Final = 8e-6
BOUC_WEN_SAMPLING: Final = Sampling(750.0, 2048, 12)
FORCE_RMS_N: Final = (10.0, 25.0, 50.0)
"""The largest is that of the published benchmark."""

_SINGLE_MASS: Final = Template('''"""$title"""

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading


def oscillator(run, values):
    return Mechanism(
        mass_kg=$mass,
        stiffness_n_per_m=values["stiffness"],
        damping_n_s_per_m=values["damping"],
        driving_force_n=run.channels["force_drive"],
        readings={"displacement_mass": Reading(1.0)},
    )


TWIN = MechanicalTwin(
    parameters=[
        Parameter("stiffness", $stiffness, "N m-1"),
        Parameter("damping", $damping, "N s m-1"),
    ],
    driving=["force_drive"],
    compared={"displacement_mass": "m"},
    mechanism=oscillator,
)
''')


def bouc_wen() -> list[LaboratoryCase]:
    """The published benchmark with three beliefs about its spring.

    Notes
    -----
    m ÿ + c ẏ + k_L y + z = u,  ż = α ẏ − (β |ẏ| z + γ ẏ |z|)

    is the form of Noël & Schoukens, ż = α ẏ − β′ (γ′ |ẏ| |z|^{ν−1} z + δ′ ẏ |z|^ν), with ν = 1,
    β = β′γ′ = 10³ · 0.8 and γ = β′δ′ = −10³ · 1.1. With α the spring of
    small motions is k_L + α = 1·10⁵ N/m, 35.6 Hz.

    References
    ----------
    J.-P. Noël, M. Schoukens, Hysteretic benchmark with a dynamic nonlinearity, Workshop on Nonlinear System
    Identification Benchmarks, 2016.
    """
    runs = _bouc_wen_runs()
    hysteresis = (RightAnswer("named", ("hysteresis",)), RightAnswer("indistinguishable", ("hysteresis",)))
    refuted = tuple(RightAnswer(verdict, says="refuted") for verdict in ("named", "indistinguishable", "unknown"))
    beliefs = {
        "documented": ("5e4, 1e3", "10.0, 2.0", "its documented linear part", hysteresis),
        "frequency_response": ("1e5, 2e4", "10.0, 4.0", "a frequency response, 35 ± 4 Hz", hysteresis),
        "refuted": ("1e5, 1e4", "10.0, 4.0", "a frequency response that is trusted too far", refuted),
    }
    return [
        LaboratoryCase(
            f"bouc_wen_{name}",
            f"A hysteretic oscillator whose spring is believed from {source}.",
            BOUC_WEN_SAMPLING.rate_hz,
            runs,
            {"displacement_mass": NOISE_M},
            right,
            {"stiffness_n_per_m": ALPHA, "beta_gamma": BETA, "beta_delta": GAMMA, "exponent": 1.0},
            twin=_SINGLE_MASS.substitute(
                title="A mass on a spring, driven by a known force.",
                mass=MASS_KG,
                stiffness=stiffness,
                damping=damping,
            ),
            seed=1,
        )
        for name, (stiffness, damping, source, right) in beliefs.items()
    ]


def bouc_wen_displacement(drive: FloatArray, sampling: Sampling = BOUC_WEN_SAMPLING) -> FloatArray:
    """Displacement [m] of the benchmark, shape (n_runs, n_samples), under forces [N] at half steps."""

    def rates(state: FloatArray, force: FloatArray) -> FloatArray:
        y, v, z = state
        return np.stack(
            [
                v,
                (force - STIFFNESS * y - DAMPING * v - z) / MASS_KG,
                ALPHA * v - BETA * np.abs(v) * z - GAMMA * v * np.abs(z),
            ]
        )

    return integrated(rates, np.zeros((3, drive.shape[0])), drive, sampling)[:, 0].T


def _bouc_wen_runs() -> list[Run]:
    sampling = BOUC_WEN_SAMPLING
    forces = [multisine(sampling, (5.0, 150.0), rms, seed=11 + i) for i, rms in enumerate(FORCE_RMS_N)]
    forces.append(swept_sine(sampling, (20.0, 50.0), 40.0))
    names = [f"multisine_{rms:g}n" for rms in FORCE_RMS_N] + ["swept_sine"]
    moved = bouc_wen_displacement(np.stack(forces))
    return [
        Run(
            f"{name}_{repeat}",
            {"force_drive": sampling.samples(force), "displacement_mass": displacement},
            {"test": name, "repeat": repeat},
        )
        for name, force, displacement in zip(names, forces, moved, strict=True)
        for repeat in (1, 2)
    ]


WIRE_ROPE_SAMPLING: Final = Sampling(500.0, 2000, 12)


def wire_rope() -> list[LaboratoryCase]:
    """A mass on wire-rope isolators: Bouc–Wen hysteresis whose loop saturates, and a spring that hardens.

    Notes
    -----
    m ÿ + c ẏ + k y + k₃ y³ + z = u,  ż = α ẏ − β (|ẏ| z + ẏ |z|) · ½: the loop closes at z = α/β = 8 N.
    """
    sampling = WIRE_ROPE_SAMPLING
    mass, damping, stiffness, cubic, alpha, beta = 4.0, 6.0, 1.6e4, 1.2e9, 8e3, 1e3

    def rates(state: FloatArray, force: FloatArray) -> FloatArray:
        y, v, z = state
        acceleration = (force - damping * v - stiffness * y - cubic * y**3 - z) / mass
        return np.stack([v, acceleration, alpha * v - 0.5 * beta * (np.abs(v) * z + v * np.abs(z))])

    levels = (5.0, 15.0, 40.0)
    forces = np.stack([multisine(sampling, (3.0, 40.0), rms, seed=31 + i) for i, rms in enumerate(levels)])
    moved = integrated(rates, np.zeros((3, 3)), forces, sampling)[:, 0].T
    runs = [
        Run(
            f"level_{rms:g}n_{repeat}",
            {"force_drive": sampling.samples(force), "displacement_mass": displacement},
            {"test": f"{rms:g} N", "repeat": repeat},
        )
        for rms, force, displacement in zip(levels, forces, moved, strict=True)
        for repeat in (1, 2)
    ]
    both = ("hysteresis", "cubic_stiffness")
    right = [
        *(RightAnswer(verdict, both) for verdict in ("named", "indistinguishable")),
        RightAnswer("unknown", block="structure"),
    ]
    twin = _SINGLE_MASS.substitute(
        title="A mass on isolators, as their data sheet has them.",
        mass=mass,
        stiffness="1.8e4, 3e3",
        damping="10.0, 5.0",
    )
    numbers = {"stiffness_n_per_m": alpha, "beta_gamma": 0.5 * beta, "cubic_stiffness_n_per_m3": cubic}
    story = "A mass on wire-rope isolators, which lose by rubbing and harden."
    noise = {"displacement_mass": 2e-6}
    return [LaboratoryCase("wire_rope", story, sampling.rate_hz, runs, noise, right, numbers, twin=twin, seed=3)]


BEAMS_SAMPLING: Final = Sampling(1000.0, 2500, 12)
N_SLIDERS: Final = 8

_TWO_BEAMS: Final = '''"""The first modes of two beams, coupled by what is taken for a spring and a damper."""

import numpy as np

from sloshlab.user_twin import Mechanism, MechanicalTwin, Parameter, Reading

JOINT = np.array([1.0, -1.0])
ACROSS = np.outer(JOINT, JOINT)


def beams(run, values):
    return Mechanism(
        mass_kg=np.diag([1.2, 0.8]),
        stiffness_n_per_m=np.diag([values["beam 1"], values["beam 2"]]) + values["joint"] * ACROSS,
        damping_n_s_per_m=np.diag([1.5, 1.0]) + values["joint damping"] * ACROSS,
        driving_force_n=run.channels["force_drive"],
        driven_along=(1.0, 0.0),
        acts_along=JOINT,
        readings={
            "acceleration_beam1": Reading(acceleration=(1.0, 0.0)),
            "acceleration_beam2": Reading(acceleration=(0.0, 1.0)),
        },
    )


TWIN = MechanicalTwin(
    parameters=[
        Parameter("beam 1", 2.0e4, 4e2, "N m-1"),
        Parameter("beam 2", 3.0e4, 6e2, "N m-1"),
        Parameter("joint", 1.5e4, 3e3, "N m-1"),
        Parameter("joint damping", 1.0, 0.5, "N s m-1"),
    ],
    driving=["force_drive"],
    compared={"acceleration_beam1": "m s-2", "acceleration_beam2": "m s-2"},
    mechanism=beams,
)
'''


def two_beams() -> list[LaboratoryCase]:
    """Two beams with an Iwan joint: stick–slip elements in parallel, which soften and lose more with amplitude.

    Notes
    -----
    Eight Jenkins elements, a spring of 1500 N/m and a slider each, slip from 0.4 to 6 N; one of 4000 N/m stays.
    """
    sampling, masses = BEAMS_SAMPLING, np.array([[1.2], [0.8]])
    springs, dampers, mounts = np.array([[2.0e4], [3.0e4]]), np.array([[1.5], [1.0]]), np.array([[1.0], [-1.0]])
    slips = np.geomspace(0.4, 6.0, N_SLIDERS)[:, None]

    def rates(state: FloatArray, force: FloatArray) -> FloatArray:
        x, v, sliders = state[:2], state[2:4], state[4:]
        across = v[:1] - v[1:]
        joint = 4e3 * (x[:1] - x[1:]) + 1.0 * across + np.clip(sliders, -slips, slips).sum(axis=0)
        driven = np.stack([force, np.zeros_like(force)])
        acceleration = (driven - springs * x - dampers * v - mounts * joint) / masses
        # A slider at its limit gives no more force in this direction; the clip takes off what a step overshoots.
        slides = (np.abs(sliders) >= slips) & (sliders * across > 0)
        return np.concatenate([v, acceleration, np.where(slides, 0.0, 1.5e3 * across)])

    levels = (4.0, 12.0, 30.0)
    forces = np.stack([multisine(sampling, (10.0, 60.0), rms, seed=51 + i) for i, rms in enumerate(levels)])
    state = integrated(rates, np.zeros((4 + N_SLIDERS, 3)), forces, sampling)
    driven = np.stack([sampling.samples(force) for force in forces])
    acceleration = np.stack(
        [rates(state[i], driven[:, i])[2:4] for i in range(sampling.n_samples)]
    )  # (n_samples, 2, n_runs)
    runs = [
        Run(
            f"level_{rms:g}n_{repeat}",
            {
                "force_drive": driven[number],
                "acceleration_beam1": acceleration[:, 0, number],
                "acceleration_beam2": acceleration[:, 1, number],
            },
            {"test": f"{rms:g} N", "repeat": repeat},
        )
        for number, rms in enumerate(levels)
        for repeat in (1, 2)
    ]
    right = [
        RightAnswer("unknown", block="structure"),
        *(RightAnswer(verdict, ("hysteresis",)) for verdict in ("named", "indistinguishable")),
    ]
    story = "Two beams whose joint sticks and slips: it softens, and its loss grows with amplitude."
    noise = {"acceleration_beam1": 0.02, "acceleration_beam2": 0.02}
    numbers = {"joint_stiffness_stuck_n_per_m": 4e3 + N_SLIDERS * 1.5e3, "joint_stiffness_slipping_n_per_m": 4e3}
    return [
        LaboratoryCase("two_beams", story, sampling.rate_hz, runs, noise, right, numbers, twin=_TWO_BEAMS, seed=5)
    ]
