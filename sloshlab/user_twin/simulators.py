"""Which simulator runs each form of a user's twin."""

from __future__ import annotations

from sloshlab.errors import InputError
from sloshlab.user_twin.description import (
    BlockTwin,
    EquationTwin,
    FreeTwin,
    UserTwin,
)
from sloshlab.user_twin.equation_simulators import EquationSimulator, PrescribedMotionSimulator
from sloshlab.user_twin.mechanism_simulator import MechanismSimulator
from sloshlab.user_twin.own_code_simulators import BlockSimulator, OwnCodeSimulator
from sloshlab.user_twin.raised_errors import require_no_raise
from sloshlab.user_twin.simulator import (
    MOST_EXCITATIONS,
    KeptExcitations,
    Simulator,
)


def simulator_of(twin: UserTwin, name: str, n_runs: int) -> Simulator:
    """What simulates a twin.

    Parameters
    ----------
    twin : UserTwin
    name : str
        For messages.
    n_runs : int
        For how many runs inputs are kept.

    Raises
    ------
    InputError
        If its equations cannot be compiled, or raise errors.
    """
    excitations = KeptExcitations(max(MOST_EXCITATIONS, 2 * n_runs))
    if isinstance(twin, EquationTwin):
        require_no_raise(twin.equations, name)
        of = PrescribedMotionSimulator if twin.is_prescribed else EquationSimulator
        try:
            return of(twin, name, excitations)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error
    if isinstance(twin, FreeTwin):
        return OwnCodeSimulator(twin, name)
    if isinstance(twin, BlockTwin):
        return BlockSimulator(twin, name)
    return MechanismSimulator(twin, name, excitations)
