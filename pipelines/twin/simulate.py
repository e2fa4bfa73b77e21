"""The command `simulate`: the twin of a rig file driven by a recorded run."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, cast

import xarray as xr

from pipelines.inputs.recordings import recording_of
from pipelines.inputs.rigs import folder_of, rig_of
from pipelines.report.free_place import require_free_place
from pipelines.report.outputs import RESULT_ID, provenance_of, sha256_of, versions
from pipelines.report.progress import amounts
from pipelines.twin.comparison_figure import comparison_png
from pipelines.twin.simulated_tank_model import departure_attributes, with_tank_model
from pipelines.twin.simulation_settings import SimulationSettings
from pipelines.twin.simulation_summary import simulation_summary
from sloshlab import atomic_file
from sloshlab.configurations import CONFIGURATIONS
from sloshlab.errors import InputError
from sloshlab.missing_physics import effects as vocabulary
from sloshlab.missing_physics.extension import Extension, with_acting
from sloshlab.missing_physics.saved_effects import saved_effects
from sloshlab.recording import run_attributes, write_recording
from sloshlab.reduced_order_model.departures import Departure
from sloshlab.rig import Rig
from sloshlab.toml_file import read_toml
from sloshlab.twin.recorded_run import Block, Drive, drive_of
from sloshlab.twin.reduced_order_model_domain import departures
from sloshlab.twin.simulated_channels import SimulatedRun, simulated_run
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.storage import load_twin, save_twin
from sloshlab.twin.structure_forces import MASS_ERROR
from sloshlab.twin.twin import Twin

assert vocabulary.__all__  # importing it makes the effects known that a saved twin may name

LEAST_RATE_HZ: Final = 20_000.0
STEPS_PER_PERIOD: Final = 60
"""Integration steps per second, and per period of the highest mode, at least."""

_MOST_STEPS = 1000
"""Per sample; a run that needs more is sampled too slowly to drive this twin."""


def simulate_run(settings: SimulationSettings) -> dict[str, Any]:
    """Simulate and write the recording.

    Returns
    -------
    dict
        ``lines`` for people, ``flags`` (exit code 3), and numbers for machines.

    Raises
    ------
    InputError
        If the run cannot drive the twin, or the twin leaves what can be simulated; nothing is written then.
    """
    _check(settings)
    rig = rig_of(settings.rig)
    twin = _chosen_twin(settings, rig)
    _require_free_places(settings, twin)
    return write_simulation(_simulated(settings, rig, twin), settings)


@dataclass(frozen=True, eq=False)
class SimulatedTwin:
    """A run of a twin with all that is to be told of it.

    Attributes
    ----------
    settings : SimulationSettings
    rig : Rig
    twin : Twin
        The one that was to run; `drive.twin` has what the run drives in it.
    recording : xarray.Dataset
        What drove it.
    drive : Drive
    simulation : Simulation
    simulated : SimulatedRun
        Its channels, under the names of the recording.
    n_steps : int
        Integration steps per sample.
    left : sequence of Departure
        Where the tank model was beyond what it was trained on.
    """

    settings: SimulationSettings
    rig: Rig
    twin: Twin
    recording: xr.Dataset
    drive: Drive
    simulation: Simulation
    simulated: SimulatedRun
    n_steps: int
    left: Sequence[Departure]

    @property
    def is_of_another_configuration(self) -> bool:
        """Whether the liquid of the twin is not in the state of that of the recording."""
        now = self.simulated.recording.attrs["configuration"]
        return bool(run_attributes(self.recording).configuration != now)

    def summary(self) -> dict[str, Any]:
        """``lines`` for people, ``flags``, and numbers for machines."""
        summary = simulation_summary(
            self.settings,
            self.rig,
            self.recording,
            self.drive,
            simulation=self.simulation,
            simulated=self.simulated,
            n_steps=self.n_steps,
        )
        return with_tank_model(summary, self.simulation, self.left)


def simulated_twin(settings: SimulationSettings) -> SimulatedTwin:
    """Simulate, and write nothing; `output`, `save_twin` and `overwrite` of the settings mean nothing here.

    Raises
    ------
    InputError
        If the run cannot drive the twin, or the twin leaves what can be simulated.
    """
    _check_configuration(settings)
    rig = rig_of(settings.rig)
    return _simulated(settings, rig, _chosen_twin(settings, rig))


def _simulated(settings: SimulationSettings, rig: Rig, twin: Twin) -> SimulatedTwin:
    recording = recording_of(settings.run)
    effects = _effects(settings)
    driven = _as_it_acts(recording, drive_of(recording, twin, block=cast("Block", settings.block)), effects)
    drive = drive_of(driven, twin, block=cast("Block", settings.block))
    n_steps = settings.steps or steps_per_sample(twin, drive.excitation.sampling_rate_hz)
    with amounts("simulating") as watch:
        simulation = drive.twin.simulate(
            drive.excitation,
            initial_displacement_m=drive.initial_displacement_m,
            n_substeps=n_steps,
            watch=watch,
        ).require_done()
    left = departures(simulation)
    attributes = _attributes(settings, recording, drive, n_steps) | departure_attributes(left)
    attributes[RESULT_ID] = _result_id(settings, twin)
    simulated = simulated_run(simulation, recording, rig, attributes=attributes, seed=settings.seed)
    simulated = replace(simulated, recording=_as_read(simulated.recording, recording, effects))
    return SimulatedTwin(settings, rig, twin, recording, drive, simulation, simulated, n_steps, left)


def write_simulation(found: SimulatedTwin, settings: SimulationSettings) -> dict[str, Any]:
    """Write what was simulated, and the twin where it is to be saved; return the summary of the command.

    Raises
    ------
    InputError
        If a file is in the way; nothing is written then.
    """
    recording = found.simulated.recording
    with atomic_file.together() as stagings:
        place = stagings.file(settings.output, overwrite=settings.overwrite)
        write_recording(recording, place, encoding=_encoding(recording))
        drawn = comparison_png(found.recording, recording) if found.is_of_another_configuration else None
        if drawn is not None:
            figure = settings.output.with_suffix(".png")
            stagings.file(figure, overwrite=settings.overwrite).write_bytes(drawn)
        if settings.save_twin is not None:
            save_twin(found.twin, stagings.file(settings.save_twin, overwrite=settings.overwrite))
    summary = replace(found, settings=settings).summary()
    if drawn is not None:
        summary["lines"].append(f"drawn: {figure}, recorded and simulated where they differ most")
        summary["figure"] = str(figure)
    return summary


def _effects(settings: SimulationSettings) -> Extension:
    """Effects of sensors and actuators that the file of a saved twin names."""
    if settings.twin is None:
        return Extension()
    what = f"twin {settings.twin}"
    return saved_effects(read_toml(settings.twin, what), what)


def _as_it_acts(recording: xr.Dataset, drive: Drive, effects: Extension) -> xr.Dataset:
    """The recording with what acts in its driving channels: faults of their sensors undone, commands as obeyed."""
    rate = drive.excitation.sampling_rate_hz
    for fault in effects.faults:
        if fault.channel in drive.channels and fault.undone is not None:
            own = recording[fault.channel]
            read = {str(name): recording[name].values for name in recording.data_vars}
            acting = fault.undone(own.values.astype(float), rate, read, own.values)
            recording = recording.assign({fault.channel: own.copy(data=acting)})
    return with_acting(recording, effects.drives)


def _as_read(simulated: xr.Dataset, recording: xr.Dataset, effects: Extension) -> xr.Dataset:
    """Simulated channels as their faulty sensors read them."""
    rate = run_attributes(recording).sampling_rate_hz
    for fault in effects.faults:
        if fault.channel in simulated.data_vars:
            own = simulated[fault.channel]
            others = {str(name): simulated[name].values for name in simulated.data_vars}
            read = fault.reading(own.values.astype(float), rate, others, recording[fault.channel].values)
            simulated = simulated.assign({fault.channel: own.copy(data=read)})
    return simulated


def steps_per_sample(twin: Twin, sampling_rate_hz: float) -> int:
    """Steps that make 20 kHz at least, and sixty per period of the highest mode.

    Raises
    ------
    InputError
        If more than a thousand are needed.
    """
    rate = LEAST_RATE_HZ
    if twin.structure is not None:
        rate = max(rate, STEPS_PER_PERIOD * float(twin.structure.frequencies_hz.max()))
    steps = math.ceil(rate / sampling_rate_hz)
    if steps > _MOST_STEPS:
        raise InputError(
            "sampling rate",
            got=f"{sampling_rate_hz:g} Hz, so that a sample needs {steps} steps",
            allowed=f"≤ {_MOST_STEPS} steps",
            remedy="drive the twin with a run of higher sampling rate",
        )
    return steps


def _check_configuration(settings: SimulationSettings) -> None:
    if settings.configuration not in CONFIGURATIONS:
        raise InputError(
            "--configuration", got=repr(settings.configuration)[:80], allowed=", ".join(CONFIGURATIONS)
        )


def _check(settings: SimulationSettings) -> None:
    _check_configuration(settings)
    for option, path in (("--output", settings.output), ("--save-twin", settings.save_twin)):
        if path is None:
            continue
        for given in (settings.run, settings.rig, settings.twin):
            if isinstance(given, Path) and path.exists() and given.exists() and path.samefile(given):
                raise InputError(f"{option} {path}", got="a file that is read", remedy="choose another name")


def _require_free_places(settings: SimulationSettings, twin: Twin) -> None:
    """Of the recording, and of the twin that is saved, whose arrays lie beside its text."""
    require_free_place(settings.output, overwrite=settings.overwrite)
    if settings.save_twin is None:
        return
    has_tables = any(term.table.size for term in twin.terms)
    for path in (settings.save_twin, settings.save_twin.with_suffix(".nc"))[: 1 + has_tables]:
        if path.absolute() == settings.output.absolute():
            raise InputError(f"--save-twin {path}", got="the name of --output", remedy="choose another name")
        require_free_place(path, overwrite=settings.overwrite, described="twin")


def _chosen_twin(settings: SimulationSettings, rig: Rig) -> Twin:
    twin = (
        Twin.from_rig(rig, folder=folder_of(settings.rig)) if settings.twin is None else load_twin(settings.twin)
    )
    if settings.configuration == "sloshing":
        return twin
    frozen = replace(twin, terms=tuple(term for term in twin.terms if term.place == "structure"))
    if settings.configuration == "frozen":
        return frozen
    return frozen.with_term(MASS_ERROR(place="tank", mass_kg=-rig.liquid_mass_kg))


def _attributes(settings: SimulationSettings, recording: xr.Dataset, drive: Drive, n_steps: int) -> dict[str, Any]:
    """Global attributes that say what was simulated; no clock, so that the same inputs give the same bytes."""
    liquid_moves = settings.configuration == "sloshing" and any(t.place == "tank" for t in drive.twin.terms)
    return {
        "run_id": f"{run_attributes(recording).run_id}_simulated"[-200:],
        "configuration": "sloshing" if liquid_moves else settings.configuration.replace("sloshing", "frozen"),
        "rig": settings.rig.name,
        "simulated_from": settings.run.name,
        "simulated_from_sha256": sha256_of(settings.run),
        "simulated_blocks": settings.block,
        "simulated_forces": ", ".join(f"{term.name} ({term.place})" for term in drive.twin.terms) or "none",
        "simulated_with_steps_per_sample": n_steps,
        "versions": json.dumps(versions(), sort_keys=True),
    }


def _result_id(settings: SimulationSettings, twin: Twin) -> str:
    """One identifier of all that is simulated so; the twin counts as it is saved, with the files it is made of."""
    with tempfile.TemporaryDirectory(prefix="sloshlab-twin-") as folder:
        save_twin(twin, Path(folder) / "twin.toml")
        inputs = [settings.run, settings.rig, *sorted(Path(folder).iterdir())]
        chosen = replace(settings, output=Path(), save_twin=None, overwrite=False)
        return str(provenance_of("", inputs, settings=chosen)[RESULT_ID])


def _encoding(simulated: xr.Dataset) -> dict[str, dict[str, Any]]:
    return {str(name): {"_FillValue": None} for name in ("time", "quality") if name in simulated.variables}
