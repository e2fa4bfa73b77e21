"""Model search: forward selection by free-running fits, restarts, nested and nesting models, the ceiling."""

from sloshlab.diagnosis.search.model_search import findings_of
from sloshlab.diagnosis.search.randomised_baselines import with_randomised_baselines

__all__ = ["findings_of", "with_randomised_baselines"]
