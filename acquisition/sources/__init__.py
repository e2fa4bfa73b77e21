"""Sources of samples: files, serial and CAN devices, and the virtual laboratory live.

`open_source` turns a URL into a `Source`; backends are found by the entry-point group
``sloshlab.sources``, so that a plug-in can bring its own.
"""

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.sources.interface import Source, SourceInfo, SourceURL
from acquisition.sources.urls import URLOptions, open_source, parse_url

__all__ = [
    "Block",
    "Channel",
    "Delivery",
    "End",
    "Source",
    "SourceInfo",
    "SourceURL",
    "Trouble",
    "TroubleKind",
    "URLOptions",
    "open_source",
    "parse_url",
]
