"""Simulated devices: they play a recording, the virtual rig or a test pattern as real ones would, faults included.

The sample counter is the master. A clock only decides when a frame may leave, never what it holds.
"""
