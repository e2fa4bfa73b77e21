"""Channels and the samples that devices deliver: the words of wires, files, sources, devices and recorder."""
