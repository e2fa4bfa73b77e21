"""What a set of runs can decide, and which runs are lacking, told before any search.

A model is told from another only by runs in which their predictions differ: "informative experiments" (Ljung 1999,
chapter 13). Here this is judged by what was done and what moved, without a simulation: levels, frequencies,
repeats, decays, rests, and which channels were recorded. What two fitted models would need beyond that is
simulated by `sloshlab.diagnosis.separating_experiment`.

References
----------
L. Ljung: System Identification, Theory for the User, 2nd edition. Prentice Hall (1999).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from sloshlab import channel_names
from sloshlab.configurations import SLOSHING
from sloshlab.experiments import EXPERIMENTS
from sloshlab.identification.case import Case, CaseRun, level
from sloshlab.identification.split import Split, split
from sloshlab.recording import channels

FloatArray = NDArray[np.float64]
LEAST_RATIO_OF_LEVELS: Final = 1.5
"""Of two levels, from which a law over the level shows: F sgn v and c v differ by as much."""
LEAST_DECAY: Final = 3.0
"""First over last amplitude of a decay that passes through levels of its own."""
LEAST_RATIO_OF_FREQUENCIES: Final = 1.25
"""Of the frequencies between which 80 % of the power of a motion lie. A spring, a mass and a damper differ by less
than the tolerances of a rig below it."""
_QUIET: Final = 0.05
"""Of the RMS of a run, up to which a second of it is a rest."""
_LISTED: Final = 4
_DRIVES: Final = (channel_names.ACCELERATION_ROOT, channel_names.ACCELERATION_CONTROL, "acceleration", "force")
_MOVES_WITH_THE_TANK: Final = (
    channel_names.ACCELERATION_TIP,
    channel_names.ACCELERATION_ROOF,
    channel_names.ACCELERATION_BEAM,
    channel_names.DISPLACEMENT_TANK,
    channel_names.FORCE_INTERFACE,
    channel_names.FORCE_CELL,
)


@dataclass(frozen=True)
class Decision:
    """One question that a diagnosis asks, and whether these runs can answer it.

    Attributes
    ----------
    question : str
    is_possible : bool
    because : str
        What in the runs answers it, or prevents an answer.
    lacking : str
        What to record for an answer; empty where it is possible.
    """

    question: str
    is_possible: bool
    because: str
    lacking: str = ""

    @property
    def lines(self) -> list[str]:
        """Lines for a terminal.

        Examples
        --------
        >>> Decision("own scatter", False, "no test was repeated", "run_01 once more").lines
        ['own scatter (no test was repeated)', '  to record: run_01 once more']
        """
        said = [f"{self.question} ({self.because})"]
        return [*said, f"  to record: {self.lacking}"] if self.lacking else said


@dataclass(frozen=True)
class InformativeRuns:
    """What the runs of a case can decide.

    Attributes
    ----------
    runs : tuple of str
        One line for every kind of experiment: what was recorded.
    decisions : tuple of Decision
    """

    runs: tuple[str, ...]
    decisions: tuple[Decision, ...]

    @property
    def possible(self) -> tuple[Decision, ...]:
        """Questions that can be answered."""
        return tuple(decision for decision in self.decisions if decision.is_possible)

    @property
    def open(self) -> tuple[Decision, ...]:
        """Questions that need other runs or channels."""
        return tuple(decision for decision in self.decisions if not decision.is_possible)

    @property
    def lacking(self) -> tuple[str, ...]:
        """What to record, each once."""
        return tuple(dict.fromkeys(decision.lacking for decision in self.open if decision.lacking))

    @property
    def lines(self) -> list[str]:
        """Lines for a terminal."""
        shown = [*self.runs]
        for title, decisions in (
            ("these runs can decide", self.possible),
            ("these runs cannot decide", self.open),
        ):
            if decisions:
                shown.append(f"{title}:")
                for first, *others in (decision.lines for decision in decisions):
                    shown += [f"  - {first}", *(f"  {line}" for line in others)]
        return shown


def informative_runs(case: Case) -> InformativeRuns:
    """Judge what the runs of a case can decide.

    Parameters
    ----------
    case : Case

    Returns
    -------
    InformativeRuns
    """
    parts = split(case)
    questions: tuple[Callable[[Case], Decision | None], ...] = (
        lambda these: _missing_at_all(these, parts),
        _scatter,
        _laws_over_the_level,
        _laws_over_the_frequency,
        _structure_against_liquid,
        _sensor_against_physics,
        _noise,
        _small_motion,
    )
    decisions = [question(case) for question in questions]
    return InformativeRuns(
        tuple(_recorded(case)), tuple(decision for decision in decisions if decision is not None)
    )


def _recorded(case: Case) -> Iterable[str]:
    """One line for every kind of experiment."""
    for (experiment, configuration), tests in _kinds(case).items():
        n_runs = sum(len(test) for test in tests)
        levels = ", ".join(
            _level_words(test[0]) + (f" ({len(test)} times)" if len(test) > 1 else "") for test in tests
        )
        yield f"{n_runs} {'run' if n_runs == 1 else 'runs'} of {experiment}, {configuration}: {levels}"


def _kinds(case: Case) -> dict[tuple[str, str], list[tuple[CaseRun, ...]]]:
    """Tests by experiment and configuration, the largest level first."""
    kinds: dict[tuple[str, str], list[tuple[CaseRun, ...]]] = {}
    for test in sorted(case.tests(), key=lambda runs: -level(runs[0])):
        kinds.setdefault((test[0].attributes.experiment, test[0].attributes.configuration), []).append(test)
    return kinds


def _level_words(run: CaseRun) -> str:
    stated = run.attributes
    if run.is_free and stated.initial_displacement_m is not None:
        return f"{1000 * stated.initial_displacement_m:.3g} mm"
    if not run.is_free and stated.acceleration_g is not None:
        return f"{stated.acceleration_g:.3g} g"
    return f"level {level(run):.3g}"


def _missing_at_all(case: Case, parts: Split) -> Decision:
    question = "whether anything is missing"
    if not parts.has_held_out:
        return Decision(
            question,
            False,
            "one run alone, and none that chooses nothing",
            f"{case.runs[0].name} once more, and at two other levels",
        )
    names = _listed(run.name for run in parts.held_out)
    if any(limit.startswith("held-out runs are repeats") for limit in parts.limits):
        return Decision(
            question, True, f"{names} judged without being fitted, at no other level than those that are fitted"
        )
    return Decision(question, True, f"{names} judged without being fitted")


def _scatter(case: Case) -> Decision:
    question = "how far the rig repeats itself"
    repeated = [test for test in case.tests() if len(test) > 1]
    if repeated:
        names = _listed(f"{test[0].name} {len(test)} times" for test in repeated)
        return Decision(question, True, names)
    largest = max(case.runs, key=level).name
    return Decision(question, False, "no test was repeated", f"{largest} once more, nothing changed")


def _laws_over_the_level(case: Case) -> Decision:
    """Dry friction, drag and hardening from a damper and a spring (`docs/diagnosis.md`)."""
    question = "laws over the level: friction, drag, hardening, stops"
    for (experiment, _), tests in _kinds(case).items():
        levels = [level(test[0]) for test in tests]
        if len(levels) > 1 and levels[0] >= LEAST_RATIO_OF_LEVELS * max(levels[-1], 1e-300):
            ratio = levels[0] / max(levels[-1], 1e-300)
            return Decision(question, True, f"{experiment} at levels that differ {ratio:.2g} times")
    through = [run for run in case.runs if _range_of_levels(run) >= _least_range(run)]
    if through:
        return Decision(question, True, f"{_listed(run.name for run in through)} pass through several levels")
    largest = max(case.runs, key=level).name
    return Decision(question, False, "one level", f"{largest} at a third of its level, and at one in between")


def _least_range(run: CaseRun) -> float:
    return LEAST_DECAY if run.is_free else LEAST_RATIO_OF_LEVELS


def _range_of_levels(run: CaseRun) -> float:
    """Ratio of the RMS of the loudest and the quietest tenth of the seconds of a run, ramps at both ends aside."""
    sizes = _rms_by_second(run)
    if sizes.size < 4:
        return 1.0
    if run.is_free:
        return float(sizes[0] / max(sizes[-1], 1e-300))
    quiet, loud = np.quantile(sizes[1:-1], (0.1, 0.9))
    return float(loud / max(quiet, 1e-300))


def _laws_over_the_frequency(case: Case) -> Decision:
    """A mass from a spring, a loss factor from a damper, a filter from a gain."""
    question = "laws over the frequency: mass or spring, loss factor or damper, filters"
    several = [run for run in case.runs if not run.is_free and _has_frequencies(run)]
    if several:
        return Decision(question, True, f"{_listed(run.name for run in several)} hold several frequencies")
    n_modes = _n_modes(case)
    if n_modes > 1 and any(run.is_free for run in case.runs):
        return Decision(question, True, f"decays of {n_modes} modes")
    is_shaken = any(EXPERIMENTS[run.attributes.experiment].moves == "shaker" for run in case.runs)
    wanted = (
        "a sweep, or steps of frequency"
        if is_shaken or _n_modes(case) == 0
        else f"random or stepped motion of the base, with {channel_names.ACCELERATION_ROOT} recorded"
    )
    return Decision(question, False, "every run moves at one frequency", wanted)


def _n_modes(case: Case) -> int:
    """Of the structure as described; 0 without one, or where a twin of the user's own stands for it."""
    structure = None if case.rig is None else case.rig.structure
    if structure is None:
        return 0
    return 1 if structure.kind == "sdof" else len(structure.frequencies_hz or ()) or 1


def _has_frequencies(run: CaseRun) -> bool:
    values, rate_hz = _drive(run), run.attributes.sampling_rate_hz
    if values.size < rate_hz:
        return False
    frequency_hz, power = welch(values, rate_hz, nperseg=min(values.size, int(4 * rate_hz)))
    cumulated = np.cumsum(power[1:])
    if not cumulated[-1] > 0:
        return False
    low, high = np.interp((0.1, 0.9), cumulated / cumulated[-1], frequency_hz[1:])
    return bool(high >= LEAST_RATIO_OF_FREQUENCIES * low)


def _structure_against_liquid(case: Case) -> Decision | None:
    """Nothing to ask where there is no structure, or nobody knows of one."""
    if _n_modes(case) == 0:
        return None
    question = "whether structure or liquid misses a force"
    measured = [run for run in case.runs if channel_names.FORCE_INTERFACE in run.recording]
    if measured:
        return Decision(question, True, f"{channel_names.FORCE_INTERFACE} between them was recorded")
    configurations = {run.attributes.configuration for run in case.runs}
    if SLOSHING in configurations and len(configurations) > 1:
        other = _listed(sorted(configurations - {SLOSHING}))
        return Decision(question, True, f"runs of a {other} tank beside those of a {SLOSHING} one")
    return Decision(
        question,
        False,
        "no force between them, and one filling",
        f"{channel_names.FORCE_INTERFACE}, or a run of the frozen or empty tank",
    )


def _sensor_against_physics(case: Case) -> Decision:
    question = "whether a sensor lies or a force is missing"
    shown = {run.name: _showing_the_tank(run) for run in case.runs}
    if all(len(names) > 1 for names in shown.values()):
        return Decision(question, True, f"{_listed(shown[case.runs[0].name])} show one motion")
    alone = next(run for run, names in shown.items() if len(names) < 2)
    which = shown[alone][0] if shown[alone] else "no channel"
    return Decision(
        question, False, f"{which} alone shows the tank in {alone}", "a second sensor of the tank's motion"
    )


def _showing_the_tank(run: CaseRun) -> list[str]:
    """Channels that move with the tank; all but the drive where names tell nothing."""
    names = channels(run.recording)
    own = [name for name in names if name.startswith(_MOVES_WITH_THE_TANK)]
    cells = [name for name in own if name.startswith(channel_names.FORCE_CELL)]
    if own:
        # cells that share a load are one reading
        motion = [name for name in names if name.startswith(channel_names.ACCELERATION_CONTROL)]
        return [*(name for name in own if name not in cells), *cells[:1], *(motion if cells else [])]
    return [name for name in names if name != channel_names.ACCELERATION_ROOT]


def _noise(case: Case) -> Decision:
    question = "what is noise of each sensor"
    silent = {
        name: run.name
        for run in case.runs
        for name in channels(run.recording)
        if "noise_std" not in run.recording[name].attrs and not _has_rest(run, name)
    }
    if not silent:
        return Decision(question, True, "stated, or heard in a rest")
    return Decision(
        question,
        False,
        f"{_listed(silent)} state no noise_std and never rest",
        "a few seconds before anything moves, or noise_std of the channel",
    )


def _has_rest(run: CaseRun, channel: str) -> bool:
    sizes = _rms_by_second(run, channel)
    return bool(sizes.size and sizes.min() <= _QUIET * np.sqrt(np.mean(sizes**2)))


def _small_motion(case: Case) -> Decision | None:
    """Friction under a driven base has many peaks of the posterior; a decay has one (`docs/diagnosis.md`)."""
    if _n_modes(case) == 0:
        return None
    question = "damping and friction of the structure itself, down to rest"
    free = [run for run in case.runs if run.is_free]
    if free:
        return Decision(question, True, f"{_listed(run.name for run in free)} are decays")
    return Decision(question, False, "no decay", "the tank held at its largest deflection and let go, twice")


def _drive(run: CaseRun) -> FloatArray:
    """What is nearest to the drive of a run, without its mean; empty where nothing was recorded."""
    names = channels(run.recording)
    for start in _DRIVES:
        found = [name for name in names if name.startswith(start)]
        if found:
            return _known(run, found[0])
    return _known(run, names[0]) if names else np.zeros(0)


def _known(run: CaseRun, channel: str) -> FloatArray:
    values = np.asarray(run.recording[channel].values, np.float64)
    values = values[np.isfinite(values)]
    return values - values.mean() if values.size else values


def _rms_by_second(run: CaseRun, channel: str = "") -> FloatArray:
    """RMS of every whole second of the drive, or of a channel; of a free run of its motion."""
    if not channel and run.is_free:
        moving = [name for name in channels(run.recording) if name.startswith(_MOVES_WITH_THE_TANK)]
        channel = moving[0] if moving else ""
    values = _known(run, channel) if channel else _drive(run)
    n_block = max(1, round(run.attributes.sampling_rate_hz))
    n_blocks = values.size // n_block
    blocks = values[: n_blocks * n_block].reshape(n_blocks, n_block)
    return np.asarray(np.sqrt(np.mean((blocks - blocks.mean(axis=1, keepdims=True)) ** 2, axis=1)))


def _listed(names: Iterable[str]) -> str:
    """Names with commas; many of them shortened.

    Examples
    --------
    >>> _listed(["a", "b"]), _listed("abcdef")
    ('a, b', 'a, b, c, d and 2 more')
    """
    every: Sequence[str] = list(names)
    shown = ", ".join(every[:_LISTED])
    return shown if len(every) <= _LISTED else f"{shown} and {len(every) - _LISTED} more"
