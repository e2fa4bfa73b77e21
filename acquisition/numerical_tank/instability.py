"""What is raised when a computation cannot go on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sloshlab.errors import SloshlabError

if TYPE_CHECKING:
    from acquisition.numerical_tank.simulation import WallForces


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
    valid : WallForces
        Forces of the completed steps of the call that failed.

    Examples
    --------
    >>> str(InstabilityError("a particle is too fast", 1.25, (0.1, 0.02), None))[:74]
    'numerical tank: a particle is too fast at 1.25 s, x = 0.1 m, z = 0.02 m; r'
    """

    def __init__(self, reason: str, time_s: float, place_m: tuple[float, float], valid: WallForces | None) -> None:
        self.reason, self.time_s, self.place_m, self.valid = reason, time_s, place_m, valid
        super().__init__(
            f"numerical tank: {reason} at {time_s:.6g} s, x = {place_m[0]:.4g} m, z = {place_m[1]:.4g} m; "
            "remedy: take a smaller courant_number or a larger speed of sound"
        )
