"""Get a recording: from files of other systems, from devices, from the virtual laboratory."""
