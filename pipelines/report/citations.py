"""The papers that the methods of a report rest on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Citation:
    """A publication and what is taken from it; `doi` is empty where none is known."""

    purpose: str
    text: str
    doi: str = ""


THESIS_REMARK: Final = (
    "After the number of a figure stands its counterpart in the thesis that experiment and methods are from, if "
    "it has one; numbers of equations, tables and figures in parentheses are those of the thesis, too: "
    "Experimental data-driven reduced-order modeling of nonlinear vertical sloshing for aeroelastic analyses."
)
SOURCE: Final = Citation(
    "experiment, work per cycle, maps, effective mass (1.7–1.30)",
    "F. Saltari, M. Pizzoli, G. Coppotelli, F. Gambioli, J. E. Cooper, F. Mastroddi: Experimental "
    "characterisation of sloshing tank dissipative behaviour in vertical harmonic excitation. Journal of "
    "Fluids and Structures 109, 103478 (2022).",
)
_FREE_SURFACE: Final = Citation(
    "modes of the free surface and their parametric response",
    "T. B. Benjamin, F. Ursell: The stability of the plane free surface of a liquid in vertical periodic "
    "motion. Proceedings of the Royal Society A 225, 505–515 (1954).",
    "10.1098/rspa.1954.0218",
)
_FARADAY: Final = Citation(
    "subharmonic waves under vertical vibration",
    "M. Faraday: On a peculiar class of acoustical figures; and on certain forms assumed by groups of "
    "particles upon vibrating elastic surfaces. Philosophical Transactions of the Royal Society 121, "
    "299–340 (1831).",
    "10.1098/rstl.1831.0018",
)
_SLOSHING: Final = Citation(
    "liquid sloshing",
    "R. A. Ibrahim: Liquid Sloshing Dynamics: Theory and Applications. Cambridge University Press (2005).",
    "10.1017/CBO9780511536656",
)
_SPLINES: Final = Citation(
    "radial basis function of the maps (thin-plate spline)",
    "J. Duchon: Splines minimizing rotation-invariant semi-norms in Sobolev spaces. Constructive Theory of "
    "Functions of Several Variables, Lecture Notes in Mathematics 571, 85–100 (1977).",
    "10.1007/BFb0086566",
)
_CROSS_VALIDATION: Final = Citation(
    "cross-validated error of the maps",
    "M. Stone: Cross-validatory choice and assessment of statistical predictions. Journal of the Royal "
    "Statistical Society B 36, 111–133 (1974).",
    "10.1111/j.2517-6161.1974.tb00994.x",
)
_ALPHA_SHAPE: Final = Citation(
    "measured region of the maps",
    "H. Edelsbrunner, D. Kirkpatrick, R. Seidel: On the shape of a set of points in the plane. IEEE "
    "Transactions on Information Theory 29, 551–559 (1983).",
    "10.1109/TIT.1983.1056714",
)
SCIPY: Final = Citation(
    "numerical routines",
    "P. Virtanen et al.: SciPy 1.0: fundamental algorithms for scientific computing in Python. Nature "
    "Methods 17, 261–272 (2020).",
    "10.1038/s41592-019-0686-2",
)
XARRAY: Final = Citation(
    "labelled arrays",
    "S. Hoyer, J. Hamman: xarray: N-D labeled arrays and datasets in Python. Journal of Open Research "
    "Software 5, 10 (2017).",
    "10.5334/jors.148",
)

_ALWAYS: Final = (SOURCE, _SPLINES, _CROSS_VALIDATION, _ALPHA_SHAPE, SCIPY, XARRAY)


def citation(kind: str = "shaker") -> tuple[Citation, ...]:
    """What to cite with a result of an experiment.

    Parameters
    ----------
    kind : str
        ``"shaker"`` or ``"work"``.

    Examples
    --------
    >>> citation("work")[0].text[:10]
    'F. Saltari'
    """
    if kind == "work":
        return _ALWAYS
    return (SOURCE, _FREE_SURFACE, _FARADAY, _SLOSHING, *_ALWAYS[1:])
