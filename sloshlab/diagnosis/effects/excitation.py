"""Effects of the excitation: what the base does beyond the motion that is measured at it."""

from __future__ import annotations
