"""Recordings from files of other programs, through a TOML map from columns to channels.

`import_recording` makes one recording in the recording format; `describe_source` lists what a file
holds without a map, `starter_map` writes a map to begin with. One module per format reads that format
into a `Table`; nothing here guesses units, rates or signs.
"""

from acquisition.files.description import SourceDescription, describe_source
from acquisition.files.importing import import_recording
from acquisition.files.report import ImportReport, ImportResult, MappedChannel
from acquisition.files.starter_map import StarterMap, starter_map

__all__ = [
    "ImportReport",
    "ImportResult",
    "MappedChannel",
    "SourceDescription",
    "StarterMap",
    "describe_source",
    "import_recording",
    "starter_map",
]
