"""Models of one search that differ by an effect: what they are called, and one with an effect less or simpler."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.missing_physics.units import named_and_units


def keys_of(candidates: Iterable[Candidate]) -> frozenset[str]:
    """What tells a model from others: the keys of its effects.

    Parameters
    ----------
    candidates : iterable of Candidate
    """
    return frozenset(candidate.key for candidate in candidates)


def own_numbers(fit: FreeRunFit, effect: Candidate) -> dict[str, float]:
    """Numbers of one effect of a fit.

    Parameters
    ----------
    fit : FreeRunFit
    effect : Candidate
    """
    own = effect.names
    return {name: value for name, value in fit.values.items() if name in own}


def without(fit: FreeRunFit, effect: Candidate) -> FreeRunFit:
    """A fit without one of its effects, at the numbers of the others; its cost is not known.

    Parameters
    ----------
    fit : FreeRunFit
    effect : Candidate
        The same object as in the fit.
    """
    rest = tuple(candidate for candidate in fit.candidates if candidate is not effect)
    own = own_numbers(fit, effect)
    return FreeRunFit(rest, {name: value for name, value in fit.values.items() if name not in own}, 0.0, 0.0)


def best_form(candidate: Candidate, among: Iterable[Candidate], left: Callable[[Candidate], float]) -> Candidate:
    """What leaves least of an effect and the forms that reduce to it.

    Parameters
    ----------
    candidate : Candidate
    among : iterable of Candidate
        Where these forms are looked for.
    left : callable
        What each leaves.
    """
    return min((candidate, *(other for other in among if other.reduces_to(candidate))), key=left)


def reduced(fit: FreeRunFit, wider: Candidate, simpler: Candidate) -> dict[str, float]:
    """Numbers of what an effect of a fit reduces to: those of the same name, sizes as they are in mean.

    Parameters
    ----------
    fit : FreeRunFit
    wider, simpler : Candidate
        The effect of the fit, and another of its place.
    """
    own = own_numbers(fit, wider)
    found = {}
    for name, start in simpler.starts()[0].items():
        number = name.removeprefix(f"{simpler.key}.")
        unit = named_and_units(number)[1]
        alike = [own[f"{wider.key}.{size}"] for size in wider.sizes if named_and_units(size)[1] == unit]
        mean = float(np.mean(alike)) if number in simpler.sizes and alike else start
        found[name] = own.get(f"{wider.key}.{number}", mean)
    return found


def widened(fit: FreeRunFit, simpler: Candidate, wider: Candidate) -> list[dict[str, float]]:
    """Numbers of what reduces to an effect of a fit, about where it does: the other way round than `reduced`.

    Parameters
    ----------
    fit : FreeRunFit
    simpler, wider : Candidate
        The effect of the fit, and another of its place.

    Returns
    -------
    list of dict
        One for each different start of the numbers that the effect of the fit has none for.
    """
    own = {name.removeprefix(f"{simpler.key}."): value for name, value in own_numbers(fit, simpler).items()}
    found: list[dict[str, float]] = []
    for start in wider.starts():
        begun = {}
        for name, value in start.items():
            number = name.removeprefix(f"{wider.key}.")
            unit = named_and_units(number)[1]
            alike = [own[size] for size in simpler.sizes if size in own and named_and_units(size)[1] == unit]
            begun[name] = own.get(number, float(np.mean(alike)) if number in wider.sizes and alike else value)
        if begun not in found:
            found.append(begun)
    return found
