"""Effects of a user's own, out of a Python module that registers them. Never loaded unless its file is named."""

from __future__ import annotations

from pathlib import Path

from sloshlab.errors import InputError
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Effect, known_effects, withdraw
from sloshlab.missing_physics.user_module import user_module

assert effects.__all__  # names that are taken are known before a module asks for one

_LOADED: dict[str, tuple[Effect, ...]] = {}


def load_user_effects(path: str | Path) -> tuple[Effect, ...]:
    """Run a module and return the effects that it registers; they are candidates from then on.

    Loading the same file again replaces what it registered before. A module that fails registers nothing.

    Parameters
    ----------
    path : path
        Of a file that ends with ``.py``. Its code is run.

    Raises
    ------
    InputError
        If it cannot be run, or registers no effect; one line that says why.
    """
    file = str(Path(path).resolve())
    # Names of effects are taken once; a file that is loaded again would find its own names taken.
    for effect in _LOADED.pop(file, ()):
        withdraw(effect)
    before = known_effects()
    try:
        user_module(path, "effects")
    except InputError:
        for effect in known_effects():
            if effect not in before:
                withdraw(effect)
        raise
    found = tuple(effect for effect in known_effects() if effect not in before)
    if not found:
        raise InputError(
            f"effects {path}",
            got="no effect",
            allowed="one or more",
            remedy="register(Effect(…)) or force_effect(…)",
        )
    _LOADED[file] = found
    return found
