"""The recorder: any number of sources into a crash-safe journal, and from the journal into one recording."""
