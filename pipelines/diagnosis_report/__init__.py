"""The report on a diagnosis: one sentence on top, then where, the evidence, and the fit on held-out runs."""

from pipelines.diagnosis_report.sections import page_of

__all__ = ["page_of"]
