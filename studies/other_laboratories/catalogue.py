"""Which laboratories there are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from studies.other_laboratories.case_files import LaboratoryCase
from studies.other_laboratories.driven_structures import not_repeats, pulse_train, saturating_drive
from studies.other_laboratories.guided_decays import guided_decays
from studies.other_laboratories.hysteresis import bouc_wen, two_beams, wire_rope
from studies.other_laboratories.late_recorder import late_recorder
from studies.other_laboratories.waves import half_frequency_wave

LABORATORIES: Final[tuple[Callable[[], list[LaboratoryCase]], ...]] = (
    bouc_wen,
    wire_rope,
    two_beams,
    saturating_drive,
    pulse_train,
    not_repeats,
    late_recorder,
    half_frequency_wave,
    guided_decays,
)


def cases(names: list[str] | None = None) -> Iterator[LaboratoryCase]:
    """Cases of the laboratories named, or of all: a name is that of a laboratory, or of a case."""
    for laboratory in LABORATORIES:
        whole = not names or laboratory.__name__ in names
        # A case begins with no other laboratory's name, but computing one costs seconds.
        for case in laboratory() if whole or _may_hold(laboratory.__name__, names or []) else []:
            if whole or case.name in (names or []):
                yield case


def _may_hold(laboratory: str, names: list[str]) -> bool:
    return any(name.split("_")[0] == laboratory.split("_")[0] for name in names)
