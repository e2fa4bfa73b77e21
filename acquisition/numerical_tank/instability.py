"""What is raised when a computation cannot go on."""

from __future__ import annotations

from typing import Any, Final

from sloshlab.errors import SloshlabError

_REMEDY: Final = "take a smaller courant_number or a larger speed of sound"
STOPPED: Final = "numerical_tank_stopped"
"""Global attribute of a recording whose computation became unstable: why, when and where."""


class InstabilityError(SloshlabError, ArithmeticError):
    """The computation became unstable; what was computed before is valid and kept.

    Parameters
    ----------
    reason : str
        What happened.
    time_s : float
        When.
    place_m : tuple of float
        Where, x and z in the tank.
    valid : object
        What the call that failed would have returned, up to the last completed step: `WallForces` of a moved
        tank, `StructureHistory` of one that a structure carries, a recording of a virtual experiment.
    remedy : str
        What to change; by default of a liquid of particles.

    Examples
    --------
    >>> str(InstabilityError("a particle is too fast", 1.25, (0.1, 0.02), None))[:74]
    'numerical tank: a particle is too fast at 1.25 s, x = 0.1 m, z = 0.02 m; r'
    """

    def __init__(
        self, reason: str, time_s: float, place_m: tuple[float, float], valid: Any, remedy: str = _REMEDY
    ) -> None:
        self.reason, self.time_s, self.place_m, self.valid = reason, time_s, place_m, valid
        self.remedy = remedy
        super().__init__(
            f"numerical tank: {reason} at {time_s:.6g} s, x = {place_m[0]:.4g} m, z = {place_m[1]:.4g} m; "
            f"remedy: {remedy}"
        )
