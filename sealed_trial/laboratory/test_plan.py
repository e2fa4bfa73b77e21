"""What a laboratory measures: the runs of a case, drawn before anybody knows what is hidden."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sealed_trial.laboratory.hidden_rig import HiddenRig

PLANS: Final = (
    "sdof_decays",
    "sdof_base",
    "sdof_mixed",
    "sdof_one_frequency",
    "beam_decays",
    "beam_base",
    "beam_mixed",
    "shaker_sweeps",
    "shaker_stepped",
    "shaker_one_frequency",
)
"""Of trials."""
SHORT_DECAYS: Final = "sdof_short"
"""Of demonstrations: a quarter of the samples of `sdof_decays`, for an answer within a minute."""


@dataclass(frozen=True)
class RunPlan:
    """One run.

    Attributes
    ----------
    motion : str
        'free', 'random', 'stepped', 'swept' or 'wandering'.
    test : int
        Runs of one test are repeats of each other.
    level : float
        Deflection [m] of a free run, RMS [g] of a random one, amplitude [g] of the others.
    repeat : int
    frequencies_hz : tuple of float
        Dwells of a stepped run, ends of a sweep, centre and width of random motion.
    levels : tuple of float
        Of the dwells, relative to `level`.
    duration_s : float
    """

    motion: str
    test: int
    level: float
    repeat: int = 1
    frequencies_hz: tuple[float, ...] = ()
    levels: tuple[float, ...] = ()
    duration_s: float = 8.0


@dataclass(frozen=True)
class TestPlan:
    """All runs of a case and what they can tell apart.

    Attributes
    ----------
    name : str
    kind : str
        Of the rig.
    sampling_rate_hz : float
    runs : tuple of RunPlan
    """

    __test__ = False

    name: str
    kind: str
    sampling_rate_hz: float
    runs: tuple[RunPlan, ...]

    @property
    def has_levels(self) -> bool:
        """Several amplitudes; the name says it because a decay passes through all of them."""
        return self.name not in ("sdof_one_frequency", "shaker_one_frequency")

    @property
    def has_driven_base(self) -> bool:
        """A base under a structure that is commanded to move."""
        return self.kind != "shaker" and any(run.motion != "free" for run in self.runs)

    @property
    def has_frequencies(self) -> bool:
        """More than the first natural frequency or the one of a single dwell."""
        return self.name in (
            "sdof_base",
            "sdof_mixed",
            "beam_decays",
            "beam_base",
            "beam_mixed",
            "shaker_sweeps",
            "shaker_stepped",
        )


def drawn_plan(name: str, rig: HiddenRig, generator: np.random.Generator) -> TestPlan:
    """Runs of a plan for a rig; levels vary, but nothing depends on what is hidden."""
    kind = name.partition("_")[0]
    first_hz = _first_frequency_hz(rig)
    rate_hz, deflections_m, level_g = _drawn_levels(kind, generator)
    if name == SHORT_DECAYS:
        rate_hz = 256.0
    if kind == "shaker":
        runs = _shaker_runs(name, level_g, generator)
    else:
        runs = _structure_runs(name, first_hz, deflections_m, level_g)
    return TestPlan(name, kind, rate_hz, tuple(runs))


def _drawn_levels(kind: str, generator: np.random.Generator) -> tuple[float, list[float], float]:
    """Sampling rate, deflections and acceleration [g] of a rig of a kind."""
    uniform = generator.uniform
    if kind == "sdof":
        deflections = [
            float(np.round(v, 3)) for v in (uniform(0.045, 0.065), uniform(0.02, 0.03), uniform(0.008, 0.012))
        ]
        return 512.0, deflections, float(f"{uniform(0.04, 0.06):.2g}")
    if kind == "beam":
        deflections = [
            -float(np.round(v, 4)) for v in (uniform(0.012, 0.016), uniform(0.006, 0.008), uniform(0.003, 0.004))
        ]
        return 1024.0, deflections, float(f"{uniform(0.15, 0.25):.2g}")
    return 512.0, [], float(f"{uniform(2.0, 4.0):.2g}")


def _structure_runs(name: str, first_hz: float, deflections_m: list[float], level_g: float) -> list[RunPlan]:
    """Free decays, random and stepped motion of the base."""
    duration_s = 8.0 if name.startswith("sdof") else 6.0
    free = [RunPlan("free", k, d, duration_s=duration_s) for k, d in enumerate(deflections_m)]
    band = (first_hz, 0.45 * first_hz)
    random = [
        RunPlan("random", 10 + k, float(f"{level_g * s:.2g}"), 1, band) for k, s in enumerate((1.0, 0.5, 0.2))
    ]
    steps = tuple(float(f"{first_hz * r:.3g}") for r in (0.6, 0.85, 1.3, 1.9, 3.0))
    stepped = RunPlan("stepped", 20, float(f"{4 * level_g:.2g}"), 1, steps, (1.0,) * 5, 10.0)
    if name == SHORT_DECAYS:
        short = [replace(run, duration_s=5.0) for run in free]
        return [short[0], _again(short[0], 2), short[1], short[2]]
    if name.endswith("decays"):
        return [free[0], _again(free[0], 2), free[1], _again(free[1], 2), free[2]]
    if name.endswith("base"):
        return [random[0], _again(random[0], 2), random[1], random[2], stepped]
    if name.endswith("mixed"):
        return [free[0], _again(free[0], 2), free[2], random[0], _again(random[0], 2), stepped]
    one_frequency = (float(f"{0.9 * first_hz:.3g}"),)
    steady = RunPlan("stepped", 30, float(f"{3 * level_g:.2g}"), 1, one_frequency, (1.0,), 10.0)
    return [steady, _again(steady, 2), _again(steady, 3)]


def _shaker_runs(name: str, level_g: float, generator: np.random.Generator) -> list[RunPlan]:
    """Sweeps, stepped tones, and one that wanders."""
    wander = RunPlan("wandering", 50, level_g, 1, (6.0, 15.0), (), 10.0)
    if name == "shaker_sweeps":
        sweeps = [
            RunPlan("swept", 40 + k, float(f"{level_g * s:.2g}"), 1, (5.0, 18.0), (), 10.0)
            for k, s in enumerate((1.0, 0.5, 0.2))
        ]
        return [sweeps[0], _again(sweeps[0], 2), sweeps[1], sweeps[2], wander]
    if name == "shaker_stepped":
        both = RunPlan("stepped", 60, level_g, 1, (7.0, 9.0, 12.0, 15.0, 12.0), (1.0, 0.7, 1.0, 0.5, 0.25), 10.0)
        lower = replace(both, test=61, level=float(f"{0.4 * level_g:.2g}"))
        return [both, _again(both, 2), lower, _again(lower, 2), wander]
    frequency_hz = float(f"{generator.uniform(8.0, 13.0):.3g}")
    steady = RunPlan("stepped", 70, level_g, 1, (frequency_hz,), (1.0,), 8.0)
    lower = replace(steady, test=71, level=float(f"{0.4 * level_g:.2g}"))
    return [steady, _again(steady, 2), lower, _again(lower, 2)]


def _again(run: RunPlan, repeat: int) -> RunPlan:
    return replace(run, repeat=repeat)


def _first_frequency_hz(rig: HiddenRig) -> float:
    if rig.kind == "shaker":
        return 0.0
    system = replace(rig, factors={}).system()
    return float(np.sqrt(system.stiffness[0, 0] / system.mass[0, 0]) / (2 * np.pi))
