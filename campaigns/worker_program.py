"""The program of a worker process: a line of JSON with a task comes in, lines of JSON say how far it is and how it
ended.

Signals are for the process that started this one, which then terminates it: a task that is terminated gets a
`KeyboardInterrupt` and may save what it has. The same happens where that process is gone.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import queue
import signal
import sys
import threading
import time
from dataclasses import dataclass
from typing import IO, Any, Final, NoReturn

from sloshlab.errors import RecordingInterruptedError, SloshlabError
from sloshlab.interrupt import TERMINATIONS
from sloshlab.registry import loaded

PATIENCE_S: Final = 60.0
"""Time to save a checkpoint; a process that says nothing for so long is ended."""
_NO_SPACE: Final = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class ShareTeller:
    """What a function is given to say how far it is.

    Attributes
    ----------
    answers : file
    attempt : int
        How often the task has been begun, this time included.
    """

    answers: IO[bytes]
    attempt: int

    def __call__(self, share: float) -> None:
        """Say it; a process whose parent is gone saves and stops instead."""
        try:
            _send(self.answers, {"share": share})
        except OSError:
            raise KeyboardInterrupt from None


def main() -> int:
    """Work until there is no more, or nobody who asks."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # what a task prints must not come between the answers
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    for number in (signal.SIGINT, *TERMINATIONS):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _interrupt)
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(asked, waiting), daemon=True).start()
    with contextlib.suppress(KeyboardInterrupt, OSError):
        while line := waiting.get():
            answer = _answer(json.loads(line), answers)
            # the answer must not be cut off by a second signal
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            _send(answers, answer)
            if answer["status"] == "stopped":
                break
            signal.signal(signal.SIGTERM, _interrupt)
    return 0


def _read(asked: IO[bytes], waiting: queue.SimpleQueue[bytes]) -> None:
    """Take tasks as they come; at the end of the pipe nobody wants what is being done."""
    for line in asked:
        waiting.put(line)
    waiting.put(b"")
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE_S)
    os._exit(1)


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def _send(answers: IO[bytes], document: dict[str, Any]) -> None:
    answers.write(json.dumps(document).encode() + b"\n")
    answers.flush()


def _answer(asked: dict[str, Any], answers: IO[bytes]) -> dict[str, Any]:
    try:
        result = loaded(asked["function"])(asked["arguments"], ShareTeller(answers, asked["attempt"]))
        json.dumps(result)  # here, where what cannot be sent is the fault of the task
    except (KeyboardInterrupt, RecordingInterruptedError):
        return {"status": "stopped"}
    except (SloshlabError, OSError, MemoryError) as error:
        is_full = isinstance(error, OSError) and error.errno in _NO_SPACE
        line = " ".join(str(error).split()) or type(error).__name__
        return {"status": "full" if is_full else "failed", "line": line}
    except Exception as error:  # noqa: BLE001 - a defect of one task must not end the others
        return {"status": "failed", "line": " ".join(f"{type(error).__name__}: {error}".split())}
    return {"status": "done", "result": result}


if __name__ == "__main__":
    sys.exit(main())
