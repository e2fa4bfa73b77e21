"""What packages bring under a word of their own: found by entry points, imported only when it is asked for."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sloshlab.errors import SourceError


@dataclass(frozen=True)
class PlugIns:
    """Classes or functions of one group of entry points, each under the scheme of a URL.

    Attributes
    ----------
    group : str
        Name of the group of entry points.
    kind : str
        What messages call one of them.
    built_in : mapping of str to str
        Those of this package, scheme → ``module:name``, in the order in which messages list them. They are also
        declared in ``pyproject.toml``; an editable installation knows only what was declared when it was made.
    """

    group: str
    kind: str
    built_in: Mapping[str, str]

    def named(self, scheme: str, *, asked_for: str) -> Any:
        """What the entry point names.

        Parameters
        ----------
        scheme : str
        asked_for : str
            Beginning of messages: who wants it.

        Raises
        ------
        SourceError
            If there is none or more than one, or it cannot be imported.
        """
        offered = self._offered()
        # an editable and a plain installation side by side name the same one twice
        found = {entry.value: entry for entry in offered if entry.name == scheme}
        if len(found) != 1:
            names = list(dict.fromkeys(entry.name for entry in offered))
            raise SourceError(
                asked_for,
                got=f"scheme {scheme!r}, which is that of {len(found)} {self.kind}s" if found else repr(scheme),
                allowed=", ".join(names),
                remedy=f"check the word before the colon, or install the package that brings the {self.kind}",
            )
        (entry,) = found.values()
        try:
            return entry.load()
        except (ImportError, AttributeError) as error:
            raise SourceError(
                asked_for,
                got=f"{self.kind} {entry.value} that cannot be imported ({error})",
                remedy="install what it needs",
            ) from error

    def _offered(self) -> list[importlib.metadata.EntryPoint]:
        """Built-in ones in their order, then those of other packages by name."""
        built_in = [
            importlib.metadata.EntryPoint(name, value, self.group) for name, value in self.built_in.items()
        ]
        installed = importlib.metadata.entry_points(group=self.group)
        return [*built_in, *sorted(installed, key=lambda entry: entry.name)]
