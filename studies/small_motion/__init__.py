"""Why networks of slow runs err where the motion is small: amplitude, zero crossings, or the liquid."""
