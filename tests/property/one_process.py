"""Many damaged files read within one limited process, where a process for each would take most of the time."""

from __future__ import annotations

from collections.abc import Callable

from sloshlab.errors import InputError
from sloshlab.limited_process import CAN_FORK, ReadingLimits, UntrustedFile

_LIMITS = ReadingLimits(memory_bytes=3 << 29, computing_s=60.0)


def in_one_process(check: Callable[[], None]) -> None:
    """Run a check in a fork, within which reading makes no other.

    Where a file ends that process, the check is run here, so that each reading has its own, as usual: what ends
    one is then a refusal of its file. What the check raises is raised here, too.

    Raises
    ------
    RuntimeError
        If the check fails, with its traceback.
    """
    if CAN_FORK:
        try:
            UntrustedFile("damaged files", _LIMITS).read(check)
        except InputError:
            pass
        else:
            return
    check()
