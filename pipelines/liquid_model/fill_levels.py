"""One model for several fills of a tank: `sloshlab train` with more than one rig.

The network sees the fill level, and its force is that on the liquid of a full tank: what grows with the mass alone
is not learnt. `filled_model` makes of it the model of the tank at one fill.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.inputs.recordings import RunSource, attributes_of
from pipelines.inputs.rigs import RigSource
from pipelines.liquid_model.model_settings import ModelSettings
from pipelines.liquid_model.training_runs import RunFiles, TrainingRuns, runs_as_recorded
from pipelines.report.free_place import require_free_place
from pipelines.report.outputs import RESULT_ID, provenance_of
from pipelines.report.progress import amounts
from pipelines.sweep.shaker import rigs_by_name
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Run
from sloshlab.reduced_order_model.stability import stability
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.tank_scaling import FULL_MASS, filled_model
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord, TrainingSettings, fit
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Rig

_SAME_MASS = 1e-6


@dataclass(frozen=True)
class FilledRuns:
    """Signals of a training at several fills of one tank, at one rate.

    Attributes
    ----------
    fills : tuple of TrainingRuns
        One for each rig, by rising fill level.
    """

    fills: tuple[TrainingRuns, ...]

    @property
    def rate_hz(self) -> float:
        """Of all signals."""
        return self.fills[0].rate_hz

    @property
    def full_mass_kg(self) -> float:
        """Mass of the liquid that would fill the tank."""
        rig = self.fills[0].rig
        return rig.liquid_mass_kg / rig.liquid.fill_level

    @property
    def training(self) -> list[Run]:
        """Runs that train, with their fill levels and the force on a full tank."""
        return [self._run(signals, runs.rig) for runs in self.fills for signals in runs.training]

    @property
    def validation(self) -> list[Run]:
        """Runs that validate, likewise."""
        return [self._run(signals, runs.rig) for runs in self.fills for signals in runs.validation]

    def _run(self, signals: LiquidSignals, rig: Rig) -> Run:
        run, level = signals.run(), rig.liquid.fill_level
        return replace(run, y=run.y / level, fill_level=level)

    @cached_property
    def domain(self) -> ValidityDomain:
        """Where a model of these runs knows what it says: the motions of all fills together."""
        signals = [signals for runs in self.fills for signals in runs.training]
        return ValidityDomain.of([motion_cycles(each.velocity_m_per_s, self.rate_hz) for each in signals])

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using a model of these runs."""
        return tuple(dict.fromkeys(flag for runs in self.fills for flag in runs.flags))

    def facts(self) -> dict[str, Any]:
        """Return what a model keeps of them: no fill level of its own, but that of every rig."""
        of_fills = [runs.facts() for runs in self.fills]
        facts = {
            name: value for name, value in of_fills[0].items() if name not in ("fill_level", "liquid_mass_kg")
        }
        for role in ("training", "validation"):
            facts[role] = {name: digest for of_fill in of_fills for name, digest in of_fill[role].items()}
        return facts | {
            "dry_mass_kg": [of_fill["dry_mass_kg"] for of_fill in of_fills],
            "fill_levels": [runs.rig.liquid.fill_level for runs in self.fills],
            FULL_MASS: self.full_mass_kg,
            "domain": self.domain.facts(),
        }


def files_of_fills(
    runs: Sequence[RunSource], still: Sequence[RunSource], rigs: Sequence[RigSource]
) -> tuple[RunFiles, ...]:
    """Runs of several rigs apart; of each rig the last run validates and the others train.

    Parameters
    ----------
    runs, still : sequence of Path or RecordingInMemory
        Each names its rig.
    rigs : sequence of Path or RigInMemory
        Of one tank and liquid, filled to different levels.

    Raises
    ------
    InputError
        If a run belongs to none of the rigs, a rig has fewer than two runs, or the rigs differ in more than fill.
    """
    described = rigs_by_name(rigs)
    _require_different_fills(described)
    groups: dict[str, tuple[list[RunSource], list[RunSource]]] = {name: ([], []) for name in described}
    for number, paths in enumerate((runs, still)):
        for path in paths:
            name = attributes_of(path).rig
            if name not in groups:
                raise InputError(
                    f"{path}: rig", got=repr(name), allowed=", ".join(groups), remedy="give its rig with --rig"
                )
            groups[name][number].append(path)
    in_order = sorted(rigs, key=lambda rig: described[rig.name].liquid.fill_level)
    for rig in in_order:
        if len(groups[rig.name][0]) < 2:
            raise InputError(
                f"runs of {rig.name}",
                got=f"{len(groups[rig.name][0])}",
                allowed="two at least: the last one of every rig validates",
                remedy="give another run of that fill level, or leave the rig out",
            )
    return tuple(RunFiles.of(*groups[rig.name], rig) for rig in in_order)


def _require_different_fills(rigs: dict[str, Rig]) -> None:
    first_name, first = next(iter(rigs.items()))
    full_kg = first.liquid_mass_kg / first.liquid.fill_level
    levels: dict[float, str] = {}
    for name, rig in rigs.items():
        if rig.liquid.model_copy(update={"fill_level": first.liquid.fill_level}) != first.liquid or (
            abs(rig.liquid_mass_kg / rig.liquid.fill_level / full_kg - 1) > _SAME_MASS
        ):
            got = f"{name} with another liquid than {first_name}"
            raise InputError("--rig", got=got, allowed="rigs that differ in fill level", remedy="train them apart")
        if rig.liquid.fill_level in levels:
            got = f"{name} with the fill level of {levels[rig.liquid.fill_level]}"
            raise InputError("--rig", got=got, allowed="rigs that differ in fill level", remedy="give one of them")
        levels[rig.liquid.fill_level] = name


def filled_runs(files: Sequence[RunFiles], rate_hz: float | None) -> FilledRuns:
    """Read the runs of all fills.

    Parameters
    ----------
    files : sequence of RunFiles
    rate_hz : float, optional
        Of the model; by default the highest that one of the fills asks for.

    Raises
    ------
    InputError
        If a recording, a rig or their combination is bad.
    """
    recorded = [runs_as_recorded(of_fill) for of_fill in files]
    wanted = rate_hz or max(runs.rate.sampling_rate_hz for runs in recorded)
    return FilledRuns(tuple(runs.at_rate(wanted) for runs in recorded))


def train_over_fills(
    files: Sequence[RunFiles],
    wanted: ModelSettings,
    settings: TrainingSettings,
    output: Path,
    *,
    command: str,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Train one model at several fills, write it and return the summary of the command.

    Parameters
    ----------
    files : sequence of RunFiles
        From `files_of_fills`.
    wanted : ModelSettings
        Without feedback and without memory.
    settings : TrainingSettings
    output : Path
        The model.
    command : str
        What the user typed.
    overwrite : bool
        Whether a model that is there may be replaced.

    Raises
    ------
    InputError
        If the model cannot see the fill, a recording or a rig is bad, or something is in the way.
    """
    _require_plain(wanted.checked())
    require_free_place(output, overwrite=overwrite, described="model")
    runs = filled_runs(files, wanted.rate_hz)
    model, record = _fitted(runs, wanted, settings)
    errors = {"training_mse_n2": record.best.training_mse, "validation_mse_n2": record.best.validation_mse}
    model.facts.update(runs.facts() | errors)
    inputs = [path for of_fill in files for path in (*of_fill.training, *of_fill.validation, *of_fill.still)]
    provenance = provenance_of(
        command, (*inputs, *(of_fill.rig for of_fill in files)), settings=(wanted, settings)
    )
    model.facts[RESULT_ID] = provenance[RESULT_ID]
    with atomic_file.together() as stagings:
        save_model(model, stagings.file(output, overwrite=overwrite))
    return _summary(model, record, runs, output)


def _fitted(
    runs: FilledRuns, wanted: ModelSettings, settings: TrainingSettings
) -> tuple[ReducedOrderModel, TrainingRecord]:
    with amounts("train") as advance:

        def show_epoch(epoch: Epoch) -> None:
            done = epoch.start * (settings.n_epochs + 1) + epoch.number + 1
            advance(done, settings.n_starts * (settings.n_epochs + 1), f"epoch {epoch.number}")

        return fit(
            wanted.network,
            wanted.network_settings(),
            wanted.delay_lines(),
            runs.training,
            runs.validation,
            sampling_rate_hz=runs.rate_hz,
            settings=settings,
            with_fill=True,
            on_epoch=show_epoch,
        )


def _require_plain(wanted: ModelSettings) -> None:
    asked = (
        ("--model noe", wanted.structure == "noe"),
        ("--memory-s", wanted.memory_s is not None),
        ("--sudden-start", bool(wanted.sudden_starts)),
        ("--ensemble", wanted.n_members > 0),
        ("--weigh-small-motion", wanted.weighs_small_motion),
    )
    for option, is_asked in asked:
        if is_asked:
            raise InputError(
                "a model of several fill levels",
                got=option,
                allowed="--model nfir without memory and ensemble",
                remedy=f"leave {option} out, or give one rig",
            )


def quality_at(model: ReducedOrderModel, runs: TrainingRuns) -> FitQuality:
    """Return how well a model fits the validation runs of one fill.

    Parameters
    ----------
    model : ReducedOrderModel
        That sees the fill.
    runs : TrainingRuns
        Of one rig, at the rate of the model.
    """
    filled = filled_model(model, runs.rig.liquid.fill_level)
    simulated = [filled.simulate(signals.velocity_m_per_s) for signals in runs.validation]
    measured = np.concatenate([signals.dynamic_force_n for signals in runs.validation])
    return fit_quality(measured, np.concatenate(simulated))


def _summary(model: ReducedOrderModel, record: TrainingRecord, runs: FilledRuns, output: Path) -> dict[str, Any]:
    found = {runs_.rig.liquid.fill_level: quality_at(model, runs_) for runs_ in runs.fills}
    signals = [signals.velocity_m_per_s for runs_ in runs.fills for signals in runs_.training]
    middle = list(found)[len(found) // 2]
    lines = [
        f"model: {output}, fill levels {', '.join(f'{level:g}' for level in found)}",
        f"training: {len(record.epochs)} epochs, {record.ended}; kept: epoch {record.best.number} of start "
        f"{record.best.start}",
        *(
            f"free run on the validation runs of fill {level:g}: fit {quality.fit_percent:.1f} %, "
            f"error {quality.rms_error:.3g} N RMS"
            for level, quality in found.items()
        ),
        stability(filled_model(model, middle), signals).line("N"),
        "report: of each fill by `sloshlab validate MODEL RUN --rig RIG`",
    ]
    interrupted = ["training was interrupted; the best model so far is kept"] if record.interrupted else []
    return {
        "lines": lines,
        "flags": [*runs.flags, *interrupted],
        "output": str(output),
        "fit_percent": {f"{level:g}": quality.fit_percent for level, quality in found.items()},
        "rms_error_n": {f"{level:g}": quality.rms_error for level, quality in found.items()},
        "epochs": len(record.epochs),
        "sampling_rate_hz": model.sampling_rate_hz,
    }
