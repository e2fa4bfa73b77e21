"""The report on a diagnosis: one sentence on top, then the fit on held-out runs, where, and the evidence."""

from pipelines.diagnosis_report.sections import page_of

__all__ = ["page_of"]
