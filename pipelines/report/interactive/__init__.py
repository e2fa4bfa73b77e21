"""Figures that can be touched: zoomed, switched, and linked with each other, in the one file of a report.

`contents` says what such a figure shows, `envelope` and `packed` make it small, `script` has the drawing library
and our own script (`*.js`), and `policy` allows a page nothing else. Every such figure belongs to one that stands
still, which is printed, and shown where no script runs.
"""
