"""What travels on the wire, byte by byte, as pure functions: no device, no clock, no state elsewhere."""
