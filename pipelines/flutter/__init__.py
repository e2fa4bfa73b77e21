"""Flutter of a wing from a model file: root locus, flutter table, report."""
