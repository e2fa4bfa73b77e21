"""Everything that sloshlab raises on purpose.

Each class is also the builtin that a caller would expect, so that ``except ValueError`` still
works. A message says what is wrong, what was got, what is allowed and what to do about it.
"""

from __future__ import annotations


class SloshlabError(Exception):
    """Root of the tree: catch it to catch every error that sloshlab raises on purpose."""


def _one_line(what: str, got: str, allowed: str, remedy: str) -> str:
    parts = [
        f"got {got}" if got else "",
        f"allowed: {allowed}" if allowed else "",
        f"remedy: {remedy}" if remedy else "",
    ]
    # one line, whatever the text of a library's own error contains: a command tells every refusal in one line
    details = "; ".join(part for part in parts if part)
    return " ".join((f"{what}: {details}" if details else what).split())


class InputError(SloshlabError, ValueError):
    """An input cannot be used as it is.

    Parameters
    ----------
    what : str
        The thing that is wrong, with the file and channel it belongs to.
    got : str, optional
        What was found.
    allowed : str, optional
        What would have been accepted.
    remedy : str, optional
        What the reader of the message can do about it.

    Examples
    --------
    >>> print(InputError("tank.height_m", got="-1", allowed="> 0", remedy="measure the inside height"))
    tank.height_m: got -1; allowed: > 0; remedy: measure the inside height
    """

    def __init__(self, what: str, *, got: str = "", allowed: str = "", remedy: str = "") -> None:
        self.what, self.got, self.allowed, self.remedy = what, got, allowed, remedy
        super().__init__(_one_line(what, got, allowed, remedy))


class RecordingError(InputError):
    """A recording breaks the recording format or holds data that no analysis can use."""


class RigError(InputError):
    """A rig description is incomplete or impossible."""


class UnitsError(InputError):
    """Units are missing, unknown, or of another quantity."""


class ChannelMapError(InputError):
    """The map from a foreign file's columns to channels is incomplete or contradictory."""


class FileFormatError(InputError):
    """A foreign file cannot be read by the reader of its format."""


class AnalysisError(InputError):
    """A recording is well formed, but the analysis asked for is not possible with it."""


class MissingExtraError(SloshlabError, ImportError):
    """An optional dependency is not installed.

    Examples
    --------
    >>> print(MissingExtraError("nptdms", extra="formats", purpose="reading TDMS files"))
    reading TDMS files needs nptdms, which is not installed; remedy: pip install 'sloshlab[formats]'
    """

    def __init__(self, package: str, *, extra: str, purpose: str) -> None:
        self.package, self.extra, self.purpose = package, extra, purpose
        super().__init__(
            f"{purpose} needs {package}, which is not installed; remedy: pip install 'sloshlab[{extra}]'"
        )


class SourceError(SloshlabError, OSError):
    """A device cannot be opened, stopped answering, or sends what no device may send.

    Parameters are those of `InputError`.

    Examples
    --------
    >>> print(SourceError("serial:/dev/ttyUSB0", got="no such port", remedy="plug the device in"))
    serial:/dev/ttyUSB0: got no such port; remedy: plug the device in
    """

    def __init__(self, what: str, *, got: str = "", allowed: str = "", remedy: str = "") -> None:
        self.what, self.got, self.allowed, self.remedy = what, got, allowed, remedy
        super().__init__(_one_line(what, got, allowed, remedy))


class JournalError(InputError):
    """A journal cannot be read, or holds nothing that can be recovered."""


class RecordingInterruptedError(SloshlabError):
    """A person interrupted a recording whose samples are safe in the journal and whose file is not complete.

    The message says so, and how to get the recording.
    """


class FaultsError(InputError):
    """A description of faults to simulate is malformed."""
