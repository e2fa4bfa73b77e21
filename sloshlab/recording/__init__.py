"""The recording format: one run is one netCDF-4 file.

Readers accept exactly the format; variables and attributes that it does not know are kept. Units
are converted to SI once, on reading. Sizes are checked before anything is allocated.

``attributes`` of runs and channels · ``channel_access`` channels in memory · ``quality_bits`` flags of
samples · ``time_axis`` the uniform time · ``validation`` what every recording must hold · ``reading``
and ``decoding`` from a file · ``writing`` to one.
"""

from sloshlab.recording.attributes import (
    FORMAT,
    ChannelAttributes,
    Configuration,
    RecordedExperiment,
    RunAttributes,
    run_attributes,
)
from sloshlab.recording.channel_access import channels, with_values
from sloshlab.recording.decoding import MAXIMUM_DECODED_BYTES
from sloshlab.recording.quality_bits import CLIPPED, CRC_REPAIRED, LOST, OUT_OF_ORDER, STUCK, quality_attributes
from sloshlab.recording.reading import read_attributes, read_attributes_of_many, read_recording
from sloshlab.recording.time_axis import JITTER_ALLOWED_STEPS, largest_jitter
from sloshlab.recording.validation import validate_recording
from sloshlab.recording.writing import write_recording

__all__ = [
    "CLIPPED",
    "CRC_REPAIRED",
    "FORMAT",
    "JITTER_ALLOWED_STEPS",
    "LOST",
    "MAXIMUM_DECODED_BYTES",
    "OUT_OF_ORDER",
    "STUCK",
    "ChannelAttributes",
    "Configuration",
    "RecordedExperiment",
    "RunAttributes",
    "channels",
    "largest_jitter",
    "quality_attributes",
    "read_attributes",
    "read_attributes_of_many",
    "read_recording",
    "run_attributes",
    "validate_recording",
    "with_values",
    "write_recording",
]
