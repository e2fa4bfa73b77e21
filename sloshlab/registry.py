"""A vocabulary that stands once: entries by name, from which models, messages and lists are derived.

Built-in entries are added where the registry stands or by a decorator; other packages add theirs as entry points
of its group. Names are known without importing anything; an entry point is loaded when its entry is asked for.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

from sloshlab.errors import InputError

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries of one kind by name, in the order in which messages list them.

    Parameters
    ----------
    kind : str
        What an entry is, for messages.
    group : str
        Entry-point group in which other packages declare entries; empty for none.

    Examples
    --------
    >>> shapes = Registry("shape")
    >>> @shapes.register("box")
    ... def volume_m3(a_m, b_m, c_m):
    ...     return a_m * b_m * c_m
    >>> "box" in shapes, shapes["box"](2, 3, 4), shapes.names
    (True, 24, ('box',))
    """

    def __init__(self, kind: str, *, group: str = "") -> None:
        self.kind = kind
        self._group = group
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

    def withdraw(self, name: str) -> None:
        """Forget an entry that was added."""
        del self._entries[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Known names: what was declared here, what was added, what other packages declare."""
        return tuple(dict.fromkeys((*self._references, *self._entries, *self._declared)))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[T]:
        return (self[name] for name in self.names)

    def __getitem__(self, name: str) -> T:
        if name in self._entries:
            return self._entries[name]
        if name in self._references:
            entry: T = loaded(self._references[name])
        elif name in self._declared:
            entry = self._declared[name].load()
        else:
            raise InputError(self.kind, got=repr(name)[:80], allowed=", ".join(self.names))
        return self._entries.setdefault(name, entry)

    @functools.cached_property
    def _declared(self) -> dict[str, importlib.metadata.EntryPoint]:
        found = importlib.metadata.entry_points(group=self._group) if self._group else ()
        return {point.name: point for point in sorted(found, key=lambda point: point.name)}


def loaded(reference: str) -> Any:
    """What ``module:attribute`` names, its module imported.

    Examples
    --------
    >>> loaded("math:sqrt")(9.0)
    3.0
    """
    module, _, attribute = reference.partition(":")
    return getattr(importlib.import_module(module), attribute)


def one_of(names: Callable[[], Sequence[str]]) -> PlainValidator:
    """Validator of a pydantic field that takes the names of a vocabulary, whatever it holds by then.

    A wrong value is refused in the words that pydantic has for a ``Literal`` of the same names.
    """

    def checked(value: object) -> object:
        allowed = names()
        if isinstance(value, str) and value in allowed:
            return value
        quoted = [repr(name) for name in allowed]
        expected = " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))
        raise PydanticCustomError("literal_error", "Input should be {expected}", {"expected": expected})

    return PlainValidator(checked)
