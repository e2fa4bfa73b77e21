"""Effects of the excitation: what the base does beyond the motion that is measured at it."""

from __future__ import annotations

from sloshlab.diagnosis.candidate import Effect, EffectParameter, Numbers, Surroundings, register
from sloshlab.diagnosis.evidence import CONSERVATIVE, NO_ONSET, ODD_IN_DISPLACEMENT
from sloshlab.diagnosis.extension import Extension
from sloshlab.twin.base_rocking import BaseRocking


def _has_root_moment(at: Surroundings) -> bool:
    """Only a beam with dimensions bends at a root; a twin of the user's own has no rig."""
    described = getattr(at.rig, "structure", None)
    return described is not None and described.kind == "beam" and described.length_m is not None


def _compliance(at: Surroundings) -> list[Numbers]:
    """From rotations that carry the tip by 3 % and by 0.5 % of its own deflection."""
    described, structure = at.rig.structure, at.twin.structure
    assert described is not None
    assert described.length_m is not None
    assert structure is not None
    bending = structure.static_stiffness_n_per_m * described.length_m**2
    return [{"compliance_rad_per_n_m": share / bending} for share in (0.03, 0.005)]


def _rocks(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del channel
    assert at.rig.structure is not None
    return Extension(structure=BaseRocking(at.rig.structure, numbers["compliance_rad_per_n_m"]).of)


# The root turns without mass or damping of its own, in the modes that the rig file has.
ROCKING = register(
    Effect(
        "base_rocking",
        "excitation",
        "the base turns by θ = c M, M the root moment of the beam; every place moves by x θ, the tip by l θ",
        (EffectParameter("compliance_rad_per_n_m", 0.0, 1.0),),
        _compliance,
        _rocks,
        ("stiffness_change", "mass_error", "missing_mode"),
        "two accelerometers on the base, one before and one behind the root, in a decay",
        _has_root_moment,
        spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT, NO_ONSET),
    )
)
