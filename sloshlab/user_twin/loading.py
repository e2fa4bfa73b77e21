"""Loading a user's module. That runs its code, so it is done only where the user names the file."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from sloshlab.errors import InputError, SloshlabError
from sloshlab.missing_physics.user_module import user_module
from sloshlab.user_twin.description import UserTwin, require_sound

NAME: Final = "TWIN"


def load_user_twin(path: str | Path) -> UserTwin:
    """The ``TWIN`` of a Python module.

    Parameters
    ----------
    path : path
        Of a file that ends with ``.py``. Its code is run.

    Raises
    ------
    InputError
        If it cannot be loaded or defines no twin; one line that says why.
    """
    file = Path(path)
    twin = getattr(user_module(file, "twin"), NAME, None)
    if twin is None:
        raise InputError(
            f"twin {file}", got=f"no {NAME}", allowed=f"{NAME} = EquationTwin(…), MechanicalTwin(…) or FreeTwin(…)"
        )
    if not isinstance(twin, UserTwin):
        allowed = "EquationTwin, MechanicalTwin or FreeTwin"
        raise InputError(f"twin {file}: {NAME}", got=type(twin).__name__, allowed=allowed)
    try:
        require_sound(twin)
    except SloshlabError as error:
        raise InputError(f"twin {file}: {error}") from error
    return twin
