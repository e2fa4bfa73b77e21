"""Simulated devices: a recording or the virtual rig played as a serial or CAN device, with faults on demand."""
