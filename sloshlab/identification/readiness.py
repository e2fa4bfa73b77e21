"""Checks before a search: whether a case can be diagnosed at all, in words that say what to correct.

A twin that does not run, or reads something else than what was recorded by orders of magnitude, has no missing
physics: the rig, the units or the folder is another one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import AnalysisError, InputError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.observations import BLOCK_S, observations
from sloshlab.missing_physics.extension import NOTHING
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
LARGEST_RATIO: Final = 30.0
"""Recorded over simulated RMS of a channel; beyond, its units or its rig are others. g for m/s² is 9.8."""
_MASSES_AGREE: Final = 0.05
"""Relative difference, up to which two statements of a mass agree."""
_FEWEST_SAMPLES: Final = 64
_REFUTED: Final = 3.0
"""Tolerances from what is believed, beyond which its prior has less than a thousandth."""


@dataclass(frozen=True)
class RefutedBelief:
    """A believed number that the recordings push to its bound.

    Attributes
    ----------
    name : str
    believed, tolerance : float
        Centre of its prior, and half-width of where it is expected.
    found : float
        Where the fit ends.
    units : str
    """

    name: str
    believed: float
    tolerance: float
    found: float
    units: str

    @property
    def deviation_tolerances(self) -> float:
        """Signed distance of what was found from what was believed, in tolerances."""
        return (self.found - self.believed) / self.tolerance


def refuted_beliefs(
    values: Mapping[str, float], parameters: Sequence[BaselineParameter]
) -> tuple[RefutedBelief, ...]:
    """Believed numbers that the recordings want further away than their tolerances allow.

    Parameters
    ----------
    values : mapping of str to float
        Of a fitted baseline, by name; such as ``explanation.fit.values``. Absent ones are as believed.
    parameters : sequence of BaselineParameter
        Priors.

    Returns
    -------
    tuple of RefutedBelief
        The furthest first; empty where the priors hold the fit.

    Examples
    --------
    >>> spring = BaselineParameter("stiffness", 1e5, 1e4, "N m-1")
    >>> [belief.deviation_tolerances for belief in refuted_beliefs({"stiffness": 6e4}, [spring])]
    [-4.0]
    >>> refuted_beliefs({"stiffness": 7.5e4}, [spring])
    ()
    """
    found = [
        RefutedBelief(
            parameter.name,
            parameter.believed,
            parameter.tolerance,
            values.get(parameter.name, parameter.believed),
            parameter.units,
        )
        for parameter in parameters
    ]
    refuted = [belief for belief in found if abs(belief.deviation_tolerances) >= _REFUTED]
    return tuple(sorted(refuted, key=lambda belief: -abs(belief.deviation_tolerances)))


def require_one_rig(case: Case) -> None:
    """Refuse a rig that contradicts itself, and recordings that are of other rigs.

    Parameters
    ----------
    case : Case

    Raises
    ------
    InputError
    """
    named = sorted({run.attributes.rig for run in case.runs})
    if len(named) > 1:
        raise InputError(
            f"case {case.name}: recordings",
            got=f"of {len(named)} rigs: {', '.join(named)}"[:200],
            allowed="one rig per case",
            remedy="make a case of each",
        )
    if case.rig is None:
        return
    _require_one_moving_mass(case, case.rig)
    kind = None if case.rig.structure is None else case.rig.structure.kind
    for run in case.runs:
        expected = EXPERIMENTS[run.attributes.experiment].structure
        if expected and expected != kind:
            raise InputError(
                f"recording {run.name}: experiment",
                got=f"{run.attributes.experiment} on a rig whose structure is {kind or 'absent'}",
                allowed=f"a rig with structure.kind = {expected!r}",
                remedy="put the recording beside its own rig.toml",
            )


def _require_one_moving_mass(case: Case, rig: Rig) -> None:
    structure = rig.structure
    if structure is None or structure.mass_kg is None or structure.kind != "sdof":
        return
    if abs(structure.mass_kg / rig.tank.dry_mass_kg - 1) > _MASSES_AGREE:
        raise InputError(
            f"case {case.name}: rig.toml",
            got=f"structure.mass_kg = {structure.mass_kg:g} and tank.dry_mass_kg = {rig.tank.dry_mass_kg:g}",
            allowed="the same moving mass without liquid",
            remedy="correct one of them",
        )


def require_comparable(case: Case, model: DiagnosedModel) -> None:
    """Refuse a twin that does not run, and recordings that it cannot be compared with.

    Parameters
    ----------
    case : Case
    model : DiagnosedModel

    Raises
    ------
    InputError
        One line: what, got, allowed, remedy.
    """
    if not any(model.compared(run) for run in case.runs):
        raise AnalysisError(
            f"case {case.name}",
            got="no channel that the twin shows beside those that drive it",
            allowed="a motion of the tank or the beam, or its force",
            remedy="record one more channel",
        )
    ratios: dict[str, list[tuple[float, str, float, float]]] = {}
    for run in case.runs:
        _require_samples(run, model)
        for channel, values in _simulated(run, model).items():
            sizes = _sizes(run, channel, values)
            if sizes is not None:
                recorded, simulated = sizes
                ratios.setdefault(channel, []).append((recorded / simulated, run.name, recorded, simulated))
    _require_same_magnitude(ratios)


def _require_samples(run: CaseRun, model: DiagnosedModel) -> None:
    if observations(run, model.compared(run), model.driving(run)):
        return
    known = [int(np.isfinite(run.recording[name].values).sum()) for name in model.compared(run)]
    raise InputError(
        f"recording {run.name}",
        got=f"at most {max(known, default=0)} known samples in a channel that the twin shows",
        allowed=f"two blocks of {BLOCK_S:g} s in one of them",
        remedy="leave the run out",
    )


def _simulated(run: CaseRun, model: DiagnosedModel) -> Mapping[str, FloatArray]:
    try:
        return model.simulate(run, model.believed, NOTHING)
    except AnalysisError as error:
        raise AnalysisError(
            f"the twin as believed does not run through recording {run.name}",
            got=error.got or error.what,
            remedy="correct the rig's or the twin's numbers",
        ) from error


def _sizes(run: CaseRun, channel: str, simulated: FloatArray) -> tuple[float, float] | None:
    """RMS about the mean of what was recorded and of what is simulated there; None where either says nothing."""
    values = np.asarray(run.recording[channel].values, np.float64)
    n = min(values.size, simulated.size)
    known = np.isfinite(values[:n])
    if known.sum() < _FEWEST_SAMPLES:
        return None
    # About the mean, as the zero of most sensors means nothing.
    recorded, shown = float(values[:n][known].std()), float(simulated[:n][known].std())
    # Rounding of a constant, whatever its size.
    if recorded <= 1e-12 * max(1.0, float(np.abs(values[:n][known]).max())):
        raise InputError(
            f"recording {run.name}: {channel}",
            got=f"one value, {values[:n][known][0]:g}, throughout",
            allowed="a reading that moves",
            remedy="leave the channel out",
        )
    return (recorded, shown) if shown > 0 else None


def _require_same_magnitude(ratios: Mapping[str, list[tuple[float, str, float, float]]]) -> None:
    """A channel that is off in every run; one that moves in some is no matter of units."""
    for channel, found in ratios.items():
        # A friction that holds a tank in one run makes a ratio of any size; wrong units make the same one in
        # all.
        off = [ratio for ratio in found if not 1 / LARGEST_RATIO < ratio[0] < LARGEST_RATIO]
        if off and len(off) == len(found):
            _, name, recorded, simulated = max(off, key=lambda ratio: abs(np.log(ratio[0])))
            raise InputError(
                f"recording {name}: {channel}",
                got=f"RMS {recorded:.3g} where the twin of the rig reads {simulated:.3g}",
                allowed=f"a factor of {LARGEST_RATIO:g} between them",
                remedy="check the channel's units, and whether the recording is of this rig",
            )
