"""A vocabulary that stands once: entries by name, from which models, messages and lists are derived.

Built-in entries are added where the registry stands or by a decorator; other packages add theirs as entry points
of its group. Names are known without importing anything; an entry point is loaded when its entry is asked for.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from sloshlab.errors import InputError, SloshlabError

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries of one kind by name, in the order in which messages list them.

    Parameters
    ----------
    kind : str
        What an entry is, for messages.
    group : str
        Entry-point group in which other packages declare entries; empty for none.
    error : type
        What is raised for a name that is unknown, or whose entry cannot be imported.
    remedy : str
        What to do about an unknown name.

    Examples
    --------
    >>> shapes = Registry("shape")
    >>> @shapes.register("box")
    ... def volume_m3(a_m, b_m, c_m):
    ...     return a_m * b_m * c_m
    >>> "box" in shapes, shapes["box"](2, 3, 4), shapes.names
    (True, 24, ('box',))
    """

    def __init__(
        self, kind: str, *, group: str = "", error: Callable[..., SloshlabError] = InputError, remedy: str = ""
    ) -> None:
        self.kind = kind
        self.group, self._error, self._remedy = group, error, remedy
        self._entries: dict[str, T] = {}
        self._references: dict[str, str] = {}

    def add(self, name: str, entry: T) -> T:
        """Make an entry known; one of that name is replaced."""
        self._entries[name] = entry
        return entry

    def register(self, name: str) -> Callable[[T], T]:
        """Decorator that makes a function or a class known by a name."""
        return functools.partial(self.add, name)

    def declare(self, name: str, reference: str) -> None:
        """Make the entry ``module:attribute`` known without importing its module before it is asked for."""
        self._references[name] = reference

    @property
    def declared(self) -> dict[str, str]:
        """What was declared here: name → ``module:attribute``."""
        return dict(self._references)

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the entries that were added, or registered, here."""
        return tuple(self._entries)

    def withdraw(self, name: str) -> None:
        """Forget an entry that was added."""
        del self._entries[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Known names: what was declared here, what was added, what other packages declare."""
        return tuple(dict.fromkeys((*self._references, *self._entries, *self._offered)))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[T]:
        return (self[name] for name in self.names)

    def __getitem__(self, name: str) -> T:
        return self.named(name, asked_for=self.kind)

    def named(self, name: str, *, asked_for: str) -> T:
        """The entry of a name.

        Parameters
        ----------
        name : str
        asked_for : str
            Beginning of messages: who wants it.

        Raises
        ------
        InputError
            Or the error of this registry, if the name is unknown, more than one package brings an entry of it,
            or the entry cannot be imported.
        """
        if name in self._entries:
            return self._entries[name]
        # an editable and a plain installation side by side name the same one twice
        found = dict.fromkeys(filter(None, (self._references.get(name), *self._offered.get(name, ()))))
        if len(found) != 1:
            raise self._error(
                asked_for,
                got=f"{name!r}, which is that of {len(found)} {self.kind}s" if found else repr(name)[:80],
                allowed=", ".join(self.names),
                remedy=self._remedy,
            )
        (reference,) = found
        try:
            entry: T = loaded(reference)  # Python keeps what it has imported
        except (ImportError, AttributeError) as error:
            raise self._error(
                asked_for,
                got=f"{self.kind} {reference} that cannot be imported ({error})",
                remedy="install what it needs",
            ) from error
        return entry

    @property
    def _offered(self) -> dict[str, list[str]]:
        return _offered_by_packages(self.group, tuple(sys.path)) if self.group else {}


@functools.lru_cache(maxsize=64)
def _offered_by_packages(group: str, search_path: tuple[str, ...]) -> dict[str, list[str]]:
    """References of a group by name: those of other packages, and of this one, which declares its own, too.

    Looking through all installed packages takes milliseconds; it is done again when the search path changes.
    """
    offered: dict[str, list[str]] = {}
    for point in sorted(importlib.metadata.entry_points(group=group), key=lambda point: point.name):
        offered.setdefault(point.name, []).append(point.value)
    return offered


def loaded(reference: str) -> Any:
    """What ``module:attribute`` names, its module imported.

    Examples
    --------
    >>> loaded("math:sqrt")(9.0)
    3.0
    """
    module, _, attribute = reference.partition(":")
    return getattr(importlib.import_module(module), attribute)


def one_of(names: Callable[[], Sequence[str]]) -> Any:
    """Validator of a pydantic field that takes the names of a vocabulary, whatever it holds by then.

    A wrong value is refused in the words that pydantic has for a ``Literal`` of the same names.
    """
    from pydantic import PlainValidator
    from pydantic_core import PydanticCustomError

    def checked(value: object) -> object:
        allowed = names()
        if isinstance(value, str) and value in allowed:
            return value
        quoted = [repr(name) for name in allowed]
        expected = " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))
        raise PydanticCustomError("literal_error", "Input should be {expected}", {"expected": expected})

    return PlainValidator(checked)
