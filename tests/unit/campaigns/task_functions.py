"""Functions that tests let workers carry out."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from sloshlab.errors import InputError, RecordingInterruptedError


def squared(arguments, say_share):
    """The square; 3 is refused, 4 ends its process, 5 is a defect."""
    number = arguments["number"]
    say_share(0.5)
    if number == 3:
        raise InputError("task", got="3")
    if number == 4:
        os._exit(7)
    if number == 5:
        raise ZeroDivisionError("of a kind that nobody expects")
    return [number**2, os.getpid()]


def dies_once(arguments, say_share):
    """Kill this process the first time, with a child of it under way."""
    note = Path(arguments["note"])
    note.open("a").write("begun\n")
    if note.read_text().count("begun") < arguments["times"]:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], process_group=0)
        note.with_suffix(".child").write_text(str(child.pid))
        os.kill(os.getpid(), signal.SIGKILL)
    return say_share.attempt


def slow(arguments, say_share):
    """Take a minute."""
    time.sleep(60)


def full(arguments, say_share):
    """As where there is no space."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "somewhere")


def waiting(arguments, say_share):
    """Work until it is stopped, then leave a note."""
    try:
        while True:
            say_share(0.1)
            time.sleep(0.05)
    except KeyboardInterrupt:
        Path(arguments["note"]).write_text("saved", encoding="utf-8")
        raise RecordingInterruptedError("stopped") from None


def unheard(arguments, say_share):
    """Print to where answers go, and say nothing."""
    print("a line that is no answer", flush=True)
    return "heard"


def doubled(folder, files, arguments, say_share):
    """Write a file twice over, with the seconds asked for in between; some contents are refused."""
    content = files["recording"][0].read_bytes()
    time.sleep(arguments.get("wait_s", 0.0))
    if content.startswith(b"bad"):
        raise InputError(f"recording {files['recording'][0]}", got="bad\nand <b>hostile</b>\x1b[2J")
    if content.startswith(b"defect"):
        raise KeyError("defect")
    (folder / "parts").mkdir()
    (folder / "parts" / "twice.bin").write_bytes(2 * content)
    if arguments.get("more"):
        (folder / "more.txt").write_text(arguments["more"])
    return {"flags": ["seven is odd"] if content == b"7" else [], "numbers": {"bytes": 2 * len(content)}}


def slept_while(folder, files, arguments, say_share):
    """Note the process, and write once the file that is waited for is there."""
    (Path(arguments["notes"]) / f"{files['recording'][0].stem}.{os.getpid()}").touch()
    while not Path(arguments["until"]).exists():
        time.sleep(0.02)
    return doubled(folder, files, {}, say_share)


def nothing(folder, files, arguments, say_share):
    """A stub."""
    (folder / "result.txt").write_text("nothing")
    return {}


def written_full(folder, files, arguments, say_share):
    """Find no space after half of the result, as long as a file is there."""
    (folder / "half.txt").write_text("half")
    if Path(arguments["full"]).exists():
        full({}, say_share)
    return doubled(folder, files, {}, say_share)
