"""The wing with eight tanks: stability, gusts, limit cycles, energy maps, landing."""
