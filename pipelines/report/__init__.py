"""The shell of every report: one self-contained HTML file, and every figure as a PNG.

`page` puts sections of figures and tables together and writes them; `figure`, `sections` and `tables` are what
it takes; `style`, `axes` and `numbers` give all reports one look. `outputs` writes results as netCDF, `progress`
shows how long work takes. What the report of one experiment shows stands in the room of that experiment.
"""
