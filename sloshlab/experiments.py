"""The experiments: what moves, what a recording holds, who analyses it, and how the virtual laboratory runs it.

Everything that lists or tells apart experiments reads this registry. Another experiment is an entry here (or an
entry point of the group ``sloshlab.experiments``) and a module with its pipeline, which the entry names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from sloshlab import channel_names
from sloshlab.registry import Registry

Moves = Literal["shaker", "release", "root", "anything"]


@dataclass(frozen=True)
class Experiment:
    """One kind of experiment.

    Attributes
    ----------
    name : str
        By which commands know it.
    description : str
        For a person, in one line.
    moves : {'shaker', 'release', 'root', 'anything'}
        What sets the tank in motion: the shaker under it, letting go of a deflected structure, motion of the
        structure's root, or something unknown.
    structure : str
        Kind of the structure in the rig, ``"beam"`` or ``"sdof"``; empty where there is none.
    is_recorded : bool
        Whether recordings carry its name; the format calls all others ``"other"``.
    is_modulated : bool
        The amplitude changes during the run on purpose, so that the run holds no one level.
    required_attributes, optional_attributes : tuple of str
        Global attributes of its recordings beside those that every recording has.
    required_channels, optional_channels : tuple of str
        Beginnings of the names of channels; any channel with that beginning will do.
    stages : tuple of str
        Stages that its runs go through beside those common to the pipeline.
    pipeline : str
        ``module:function`` that analyses recordings and writes the results; see `pipelines.recording.analysing`.
    report_sections : tuple of str
        Sections of the report that its runs fill, beside those of every report.
    virtual_run : str
        ``module:function`` that makes a run in the virtual laboratory; empty if it cannot.
    virtual_options : mapping of str to str or float
        Arguments of `virtual_run`: the name of the command's option that gives each, or its fixed value.
    virtual_defaults : mapping of str to float
        What `virtual_run` takes where nothing is given.
    """

    name: str
    description: str
    moves: Moves
    structure: str = ""
    is_recorded: bool = True
    is_modulated: bool = False
    required_attributes: tuple[str, ...] = ()
    optional_attributes: tuple[str, ...] = ()
    required_channels: tuple[str, ...] = ()
    optional_channels: tuple[str, ...] = ()
    stages: tuple[str, ...] = ()
    pipeline: str = ""
    report_sections: tuple[str, ...] = ()
    virtual_run: str = ""
    virtual_options: Mapping[str, str | float] = field(default_factory=dict)
    virtual_defaults: Mapping[str, float] = field(default_factory=dict)

    @property
    def recorded_as(self) -> str:
        """What the attribute `experiment` of its recordings says."""
        return self.name if self.is_recorded else OTHER

    def missing_channels(self, names: Iterable[str]) -> tuple[str, ...]:
        """Required channels that are not among the names.

        Examples
        --------
        >>> EXPERIMENTS["beam_random"].missing_channels(["acceleration_tip"])
        ('acceleration_root',)
        """
        there = tuple(names)
        return tuple(
            start for start in self.required_channels if not any(name.startswith(start) for name in there)
        )


OTHER: Final = "other"
EXPERIMENTS: Final[Registry[Experiment]] = Registry("experiment", group="sloshlab.experiments")

_SHAKEN: Final[Mapping[str, Any]] = {
    "moves": "shaker",
    "required_channels": ("force", "acceleration"),
    "optional_attributes": ("acceleration_g", "repeat"),
    "virtual_run": "acquisition.virtual_laboratory.shaker_run:virtual_shaker_run",
}
_SWEPT: Final[Mapping[str, Any]] = {
    **_SHAKEN,
    "pipeline": "pipelines.sweep.outputs:analyse_and_write",
    "report_sections": ("fill_levels", "sensitivity"),
}
_SHAKER_OPTIONS: Final = {name: name for name in ("acceleration_g", "direction", "law")}
_ON_STRUCTURE: Final[Mapping[str, Any]] = {
    "pipeline": "pipelines.structure.outputs:analyse_and_write",
    "virtual_run": "acquisition.virtual_laboratory.structure_run:virtual_structure_run",
    "virtual_options": {name: name for name in ("initial_displacement_m", "rms_g")},
}
_RELEASED: Final[Mapping[str, Any]] = {
    **_ON_STRUCTURE,
    "moves": "release",
    "required_channels": ("acceleration",),
    "optional_channels": (channel_names.DISPLACEMENT_TANK, channel_names.FORCE_INTERFACE),
    "optional_attributes": ("initial_displacement_m", "repeat"),
    "stages": ("decays",),
    "report_sections": ("decays",),
}
RANDOM_LOWEST_HZ: Final = 8.0
"""Of random motion; lower frequencies would use up the stroke."""

for _experiment in (
    Experiment(
        "shaker_sweep",
        "a sweep at one acceleration",
        **{
            **_SWEPT,
            "optional_attributes": (
                "acceleration_g",
                "repeat",
                "sweep_start_hz",
                "sweep_rate_octave_per_s",
                "sweep_rate_hz_per_s",
                "sweep_duration_s",
            ),
        },
        stages=("signs", "end_of_sweep"),
        virtual_options=_SHAKER_OPTIONS,
    ),
    Experiment(
        "shaker_vfa",
        "frequency and amplitude vary",
        **_SWEPT,
        is_modulated=True,
        stages=("signs",),
        virtual_options=_SHAKER_OPTIONS,
    ),
    Experiment(
        "sudden_start",
        "one frequency from rest",
        **_SHAKEN,
        is_recorded=False,
        virtual_options={**_SHAKER_OPTIONS, "start_hz": "frequency_hz"},
    ),
    Experiment(
        "shaker_random",
        "random motion",
        **_SHAKEN,
        is_recorded=False,
        virtual_options={**_SHAKER_OPTIONS, "start_hz": RANDOM_LOWEST_HZ},
    ),
    Experiment(
        "shaker_two_tone",
        "two frequencies at once",
        **_SHAKEN,
        is_recorded=False,
        virtual_options={**_SHAKER_OPTIONS, "start_hz": "frequency_hz", "stop_hz": "second_frequency_hz"},
    ),
    Experiment(
        "beam_free",
        "a beam with the tank at its tip, let go",
        **_RELEASED,
        structure="beam",
        # a weight of 7 kg pulls the beam of the source down by 14.6 mm
        virtual_defaults={"duration_s": 8.0, "initial_displacement_m": -0.0146},
    ),
    Experiment(
        "beam_random",
        "the root of the beam shaken at random",
        **_ON_STRUCTURE,
        moves="root",
        structure="beam",
        required_channels=("acceleration", channel_names.ACCELERATION_ROOT),
        optional_channels=(channel_names.FORCE_INTERFACE,),
        optional_attributes=("repeat",),
        stages=("spectra",),
        report_sections=("spectra",),
        virtual_defaults={"duration_s": 90.0, "initial_displacement_m": 0.0},
    ),
    Experiment(
        "sdof_free",
        "a tank on a guide and springs, let go",
        **_RELEASED,
        structure="sdof",
        # the guided tank of the source is held 64 mm above its rest
        virtual_defaults={"duration_s": 6.0, "initial_displacement_m": 0.064},
    ),
    Experiment("flight_gust", "a wing in flight passes gusts", moves="anything"),
    Experiment("flight_pulse", "a wing in flight whose flap is moved", moves="anything"),
    Experiment("taxi", "a wing on the ground, shaken at its root", moves="anything"),
    Experiment(OTHER, "any other run", moves="anything"),
):
    EXPERIMENTS.add(_experiment.name, _experiment)


def experiment_names(suits: Callable[[Experiment], bool] = lambda experiment: True) -> tuple[str, ...]:
    """Names of the experiments that suit a condition, in the order of the registry.

    Examples
    --------
    >>> experiment_names(lambda experiment: experiment.moves == "release")
    ('beam_free', 'sdof_free')
    """
    return tuple(experiment.name for experiment in EXPERIMENTS if suits(experiment))


def recorded_experiments() -> tuple[str, ...]:
    """Names that the attribute `experiment` of a recording may have."""
    return experiment_names(lambda experiment: experiment.is_recorded)
