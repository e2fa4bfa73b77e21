"""Empty and frozen runs of a rig: examined, and what they identify for the other runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import xarray as xr

from pipelines.inputs.recordings import RunSource, recording_of
from pipelines.sweep.stages import examined_recording, naming, require_usable
from sloshlab.conditioning.calibration import DryMass, check_signs, identify_dry_mass
from sloshlab.conditioning.combined_channels import acceleration_channels, force_channels
from sloshlab.configurations import STILL_CONFIGURATIONS
from sloshlab.consistency.between_runs import calibration_findings, still_reference
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.examination import Reference, like_series
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

HIGHEST_SWEEP_HZ = 20.0
"""Where sweeps end; the effect of a delay grows with frequency."""


@dataclass(frozen=True)
class StillRuns:
    """What the empty and frozen runs of a rig give for the others, and what was found in them.

    Attributes
    ----------
    reference : Reference
        Rig, dry mass and sensors that sloshing runs are compared with.
    examinations : tuple of ConsistencyExamination
        One for each run, and one for what they identify together under the name of the rig.
    """

    reference: Reference
    examinations: tuple[ConsistencyExamination, ...] = ()

    @property
    def dry(self) -> DryMass | None:
        """The dry mass that they identify; None without any run."""
        return self.reference.dry


def read_still_runs(paths: Sequence[RunSource], rig: Rig, rig_name: str) -> StillRuns:
    """Read empty and frozen runs and identify the dry mass.

    Raises
    ------
    InputError
        If a run is unusable, contradicts itself beyond use, or is neither empty nor frozen.
    """
    examinations: list[ConsistencyExamination] = []
    still: dict[str, list[xr.Dataset]] = {configuration: [] for configuration in STILL_CONFIGURATIONS}
    for path in paths:
        recording, examination = examined_run(path, Reference(rig))
        configuration = str(recording.attrs.get("configuration"))
        if configuration not in still:
            allowed = " or ".join(STILL_CONFIGURATIONS)
            raise AnalysisError(
                f"{path}: configuration", got=repr(configuration), allowed=f"{allowed} of a still run"
            )
        still[configuration].append(recording)
        examinations.append(examination)
    recordings = still["empty"] + still["frozen"]
    if not recordings:
        return StillRuns(Reference(rig))
    dry = identify_dry_mass(
        still["empty"],
        still["frozen"],
        liquid_mass_kg=rig.liquid_mass_kg,
        force_names=force_channels(recordings[0]),
        acceleration_names=acceleration_channels(recordings[0]),
    )
    found = calibration_findings(dry, rig, Inertia.of(rig, HIGHEST_SWEEP_HZ))
    examinations.append(ConsistencyExamination(rig_name, tuple(found)))
    compared_with = still_reference(recordings)
    series = () if compared_with is None else like_series(compared_with)
    return StillRuns(Reference(rig, dry, series), tuple(examinations))


def examined_run(path: RunSource, reference: Reference) -> tuple[xr.Dataset, ConsistencyExamination]:
    """A recording with working sensors, the right signs and no contradiction that forbids its use.

    Raises
    ------
    InputError
        If it is anything else.
    """
    with naming(path):
        recording = recording_of(path)
        # a dead force cell in an empty run would halve the dry mass unnoticed
        require_usable(recording, path)
        check_signs(recording, reference.rig)
        return examined_recording(recording, path, reference)
