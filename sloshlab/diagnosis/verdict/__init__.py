"""From findings to an answer: comparison, alternatives, gates, words, and the content of ``verdict.json``."""

from sloshlab.diagnosis.verdict.facts import verdict_facts
from sloshlab.diagnosis.verdict.gates import Verdict, verdict_of, with_place

__all__ = ["Verdict", "verdict_facts", "verdict_of", "with_place"]
