"""The one lock around the netCDF library, which lets go of the interpreter's lock but is not made for threads,
and what it raises.

Whoever reads or writes netCDF where another thread may do so too holds it; without it the process dies.
"""

from __future__ import annotations

import threading
from typing import Final

# Two threads that read at once could end in a segmentation fault.
NETCDF_LOCK: Final = threading.RLock()

NETCDF_ERRORS: Final = (
    OSError,
    RuntimeError,
    UnicodeError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
    OverflowError,
)
"""What the library raises on damaged files."""
