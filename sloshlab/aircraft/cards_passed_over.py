"""Cards that change neither masses nor stiffnesses nor surfaces."""

from __future__ import annotations

from typing import Final

_ANALYSES: Final = (
    "EIGB", "EIGC", "EIGP", "FREQ", "FREQ1", "FREQ2", "FREQ3", "FREQ4", "FREQ5", "TSTEP",
    "TSTEPNL", "NLPARM", "MKAERO1", "MKAERO2", "FLFACT", "FLUTTER", "PAERO1", "AEROS", "CSSCHD",
)  # fmt: skip
_TRIM_AND_CONTROLS: Final = (
    "TRIM", "AESTAT", "AESURF", "AESURFS", "AELINK", "AEPARM", "AECOMP", "DIVERG", "MONPNT1", "MONPNT2", "MONPNT3",
    "MONDSP1", "UXVEC",
)  # fmt: skip
_LOADS: Final = (
    "FORCE", "FORCE1", "FORCE2", "MOMENT", "MOMENT1", "MOMENT2", "GRAV", "RFORCE", "LOAD", "PLOAD1", "SLOAD",
    "TEMP", "TEMPD", "TEMPRB", "DEFORM", "SPCD", "DLOAD", "RLOAD1", "RLOAD2", "TLOAD1", "TLOAD2", "DAREA",
    "DELAY", "DPHASE", "GUST", "RANDPS", "RANDT1",
)  # fmt: skip
_TABLES: Final = (
    "TABDMP1", "TABLED1", "TABLED2", "TABLED3", "TABLED4", "TABLEM1", "TABLEM2", "TABRND1", "TABRNDG",
)  # fmt: skip
_DAMPERS: Final = ("CDAMP1", "CDAMP2", "PDAMP", "CVISC", "PVISC")
_OUTPUT: Final = ("PLOTEL", "CBARAO", "ECHOON", "ECHOOFF", "USET", "USET1")

PASSED_OVER: Final = frozenset((*_ANALYSES, *_TRIM_AND_CONTROLS, *_LOADS, *_TABLES, *_DAMPERS, *_OUTPUT))
"""Choices of an analysis, trim and control surfaces, loads, tables, dampers (real modes have none), and output."""
