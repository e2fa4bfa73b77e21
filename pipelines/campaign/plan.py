"""`PLAN.toml`: what a campaign shall do with which files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from campaigns.working import RETRIES
from sloshlab.errors import InputError
from sloshlab.key_spelling import nearest_key
from sloshlab.toml_file import read_toml

LONGEST_S: Final = 31 * 86400.0
"""Limit of a task: longer than any queue of a cluster lets a job live."""
Boundaries = Literal["measured", "law"]
Pattern = Annotated[str, Field(min_length=1, max_length=200)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Part(_Table):
    """One kind of task over the files of one folder.

    Attributes
    ----------
    folder : Path
        Relative to the plan.
    name : str
        Begins the names of its tasks, so that several parts may have recordings of one name.
    """

    folder: Path
    name: str = Field(default="", pattern=r"^[\w.-]{0,40}$")


class SweepPart(Part):
    """Every sweep or VFA run by itself, with the still runs of its rig: as `sloshlab shaker`."""

    kind: Literal["sweep"]
    recordings: tuple[Pattern, ...] = ("*.nc",)
    rigs: tuple[Pattern, ...] = ("rig*.toml",)
    p: int = Field(default=6, ge=1, le=10_000)
    m: int = Field(default=24, ge=1, le=100_000)
    boundaries: Boundaries = "measured"
    allow_incomplete: bool = False
    report: bool = False


class BeamPart(Part):
    """Every run of a beam or a guided tank by itself: as `sloshlab beam`."""

    kind: Literal["beam", "sdof"]
    recordings: tuple[Pattern, ...] = ("*.nc",)
    rigs: tuple[Pattern, ...] = ("rig*.toml",)
    modes: int | None = Field(default=None, ge=1, le=100)
    cycles: int = Field(default=4, ge=2, le=1000)
    segment_s: float | None = Field(default=None, gt=0)
    report: bool = False


class TrainPart(Part):
    """Every case of a sensitivity study: as `sloshlab study`."""

    kind: Literal["train"]
    training: tuple[Pattern, ...] = Field(default=(), max_length=1000)
    validation: Pattern | None = None
    still: tuple[Pattern, ...] = Field(default=(), max_length=1000)
    rig: Pattern | None = None
    cases: Literal["source", "all"] = "all"
    rate_hz: float | None = Field(default=None, gt=0)
    epochs: int = Field(default=20, ge=1, le=100_000)
    starts: int = Field(default=1, ge=1, le=1000)
    seed: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _all_or_none(self) -> TrainPart:
        given = (bool(self.training), self.validation is not None, self.rig is not None)
        if any(given) and not all(given):
            raise ValueError("training, validation and rig together, or none of them")
        return self


class DiagnosePart(Part):
    """Every case folder: as `sloshlab diagnose`."""

    kind: Literal["diagnose"]
    report: bool = False


class TrialPart(Part):
    """Every case of a blind trial, each in a process of its own: as `sloshlab trial run`."""

    kind: Literal["trial"]
    diagnoses: str = "diagnoses"
    case_time_limit_s: float = Field(default=180.0, gt=0, le=LONGEST_S)


AnyPart = Annotated[SweepPart | BeamPart | TrainPart | DiagnosePart | TrialPart, Field(discriminator="kind")]


class SlurmSettings(_Table):
    """What one job of the queue asks for; what is not given comes from the configuration of dask-jobqueue."""

    queue: str | None = None
    account: str | None = None
    cores: int | None = Field(default=None, ge=1, le=1024)
    processes: int | None = Field(default=None, ge=1, le=1024)
    memory: str | None = Field(default=None, max_length=40)
    walltime: str | None = Field(default=None, max_length=40)
    job_extra_directives: tuple[str, ...] = Field(default=(), max_length=100)
    job_script_prologue: tuple[str, ...] = Field(default=(), max_length=100)

    @property
    def asked(self) -> dict[str, Any]:
        """What the plan says itself."""
        return self.model_dump(exclude_none=True, exclude_unset=True)


class Plan(_Table):
    """A campaign.

    Attributes
    ----------
    time_limit_s : float, optional
        Of every task, by the clock.
    retries : int
        How often a task is begun again whose process died.
    parts : tuple of Part
    slurm : SlurmSettings
    """

    time_limit_s: float | None = Field(default=None, gt=0, le=LONGEST_S)
    retries: int = Field(default=RETRIES, ge=0, le=100)
    parts: tuple[AnyPart, ...] = Field(alias="part", min_length=1, max_length=1000)
    slurm: SlurmSettings = SlurmSettings()


def read_plan(file: Path) -> Plan:
    """Read a plan; its folders are those seen from where it lies.

    Parameters
    ----------
    file : Path
        At most a megabyte of TOML.

    Raises
    ------
    InputError
        On the first thing wrong with it.
    """
    what = f"plan {file}"
    plan = plan_from_document(read_toml(file, what, remedy="see the example in docs/campaigns.md"), what)
    parts = tuple(part.model_copy(update={"folder": file.absolute().parent / part.folder}) for part in plan.parts)
    return plan.model_copy(update={"parts": parts})


def plan_from_document(document: Mapping[str, Any], what: str = "plan") -> Plan:
    """Validate a parsed plan.

    Parameters
    ----------
    document : mapping
    what : str
        What messages call it.

    Raises
    ------
    InputError
        On the first thing wrong with it.
    """
    try:
        return Plan.model_validate(document)
    except ValidationError as error:
        raise _explained(error, what) from error


def _explained(error: ValidationError, what: str) -> InputError:
    problems = error.errors(include_url=False, include_context=False)
    # a misspelt key often is the cause of one that is missing
    first = next((problem for problem in problems if problem["type"] == "extra_forbidden"), problems[0])
    place = ".".join(str(part)[:80] for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(first["loc"])
        meant = nearest_key(str(first["loc"][-1]), known)
        remedy = f"did you mean {meant!r}?" if meant else "remove it"
        return InputError(f"{what}: {place}", got="an unknown key", allowed=", ".join(known), remedy=remedy)
    missing = first["type"] == "missing"
    got = "nothing" if missing else repr(first["input"])[:80]
    allowed = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(f"{what}: {place or 'campaign'}", got=got, allowed=allowed)


def _known_keys(place: tuple[int | str, ...]) -> list[str]:
    """Keys of the table that an unknown key stands in."""
    parts: dict[str, type[BaseModel]] = {"sweep": SweepPart, "beam": BeamPart, "sdof": BeamPart}
    parts |= {"train": TrainPart, "diagnose": DiagnosePart, "trial": TrialPart}
    model: type[BaseModel] = Plan
    if len(place) > 1:
        model = SlurmSettings if place[0] == "slurm" else parts.get(str(place[2]), Part)
    return [field.alias or name for name, field in model.model_fields.items()]
