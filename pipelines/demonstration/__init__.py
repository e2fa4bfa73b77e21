"""A demonstration of the diagnosis: physics is hidden, found by a process that does not know it, and shown."""
