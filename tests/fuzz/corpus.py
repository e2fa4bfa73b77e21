"""Files that once ended in anything but a result or one line, as they were found."""

from __future__ import annotations

import base64
import zlib

from tests.fuzz.campaign import content_of


def _unpacked(text: str) -> bytes:
    return zlib.decompress(base64.b85decode("".join(text.split())))


FOUND: dict[str, tuple[str, bytes]] = {
    # ZeroDivisionError in the search for the simplest rate
    "TRC log whose first frames have one time": (
        "can trc",
        b";$FILEVERSION=1.1\n;$STARTTIME=44548.6\n;\n"
        + b"".join(b"%6d)  %11.1f  Rx  0123  1  05 \n" % (n, t) for n, t in enumerate([0] * 6 + [900, 2000], 1)),
    ),
    # two gigabytes and more than ten seconds
    "DBC with a signal of enormous length": (
        "database",
        b'VERSION ""\nNS_ :\nBS_:\nBU_: rig\nBO_ 291 L: 8 rig\n SG_ F : 0|4000000000@1- (1,0) [0|0] "N" rig\n',
    ),
    # KeyError: 'data'
    "UFF set with a broken header": ("uff binary", content_of("uff binary", 64)),
}
"""What it was → target and content."""
