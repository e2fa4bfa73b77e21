"""A user's own twin, given as a Python module that defines ``TWIN``.

Four forms. `EquationTwin` is a function of state, inputs and parameters; `MechanicalTwin` describes masses,
springs, dampers, what drives and what is read. Both run in this package's own engine, which finds every contact
and every turn of dry friction. `FreeTwin` simulates by itself and adds the force that it is handed, `BlockTwin` by
itself with effects of its own.
"""

from sloshlab.user_twin.added_force import AddedForce
from sloshlab.user_twin.block_model import BlockTwinModel
from sloshlab.user_twin.description import (
    BlockTwin,
    Compared,
    EquationTwin,
    FreeTwin,
    MechanicalTwin,
    Parameter,
    Response,
    State,
    TwinRun,
)
from sloshlab.user_twin.extended import load_extended
from sloshlab.user_twin.known_drive import with_known_drive
from sloshlab.user_twin.loading import load_user_twin
from sloshlab.user_twin.mechanism import Mechanism, Reading
from sloshlab.user_twin.model import UserTwinModel

__all__ = [
    "AddedForce",
    "BlockTwin",
    "BlockTwinModel",
    "Compared",
    "EquationTwin",
    "FreeTwin",
    "MechanicalTwin",
    "Mechanism",
    "Parameter",
    "Reading",
    "Response",
    "State",
    "TwinRun",
    "UserTwinModel",
    "load_extended",
    "load_user_twin",
    "with_known_drive",
]
