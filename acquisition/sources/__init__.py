"""Sources of samples: files, serial and CAN devices, and the virtual laboratory live.

`open_source` turns a URL into a `Source`; backends are found by the entry-point group
``sloshlab.sources``, so that a plug-in can bring its own.
"""
