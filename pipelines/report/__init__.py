"""One self-contained HTML file per experiment, and every figure as a PNG.

`selection` computes what a figure shows, `axes` arranges, the `figures_*` modules draw; `tables` and
`summary` say the same in numbers and words, and `writing` puts the page together.
"""

from pipelines.report.writing import write_report

__all__ = ["write_report"]
