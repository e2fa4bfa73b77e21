"""Workers of one run wait for each other's compiled loops and load them, instead of compiling each its own.

numba keeps loops beside the source, but two processes that call one at the same time compile it twice: in a fresh
checkout every worker of pytest-xdist would spend minutes on loops that another is just compiling.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows: every worker compiles
    fcntl = None  # type: ignore[assignment]


def compile_once(folder: Path) -> None:
    """Let this process wait, before it compiles a loop, for others that do; `folder` is for all of them."""
    if fcntl is None:
        return
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    folder.mkdir(exist_ok=True)
    compiled = Dispatcher.compile
    held: set[str] = set()

    def compiled_once(self: Any, signature: Any) -> Any:
        name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        # the lock of the threads of this process comes first, as within numba, or two could wait for each other;
        # among processes none can, since callers wait for what they call and nothing waits for its callers
        with global_compiler_lock:
            if name in held or not _is_kept(self):
                return compiled(self, signature)
            with (folder / name.replace("<", "_").replace(">", "_")).open("w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                held.add(name)
                try:
                    return compiled(self, signature)
                finally:
                    held.discard(name)

    Dispatcher.compile = compiled_once


def _is_kept(dispatcher: Any) -> bool:
    """Whether numba keeps what it compiles of a function, so that another process can load it."""
    return type(getattr(dispatcher, "_cache", None)).__name__ == "FunctionCache"
