"""From a case to fitted explanations: screening, fits, what stands in place of what, refinement, the ceiling."""

from sloshlab.diagnosis.search.other_baselines import redrawn
from sloshlab.diagnosis.search.whole_search import findings_of

__all__ = ["findings_of", "redrawn"]
