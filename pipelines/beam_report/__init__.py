"""The report on a beam or a guided tank: `report.html` and every figure as a PNG.

`figures_*` compute and draw, `tables` and `summary` say the same in numbers and words, `sections` puts them in
order. Page, style and number formats are those of `pipelines.report`.
"""

from pipelines.beam_report.sections import write_beam_report

__all__ = ["write_beam_report"]
