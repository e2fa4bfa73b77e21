"""One function per command: it checks its options, calls a pipeline and hands over a summary."""
