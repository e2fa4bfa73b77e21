"""What a Python program uses: the functions behind the commands, with data sets in and data sets out.

``import sloshlab as sl`` offers all of it by name. Each function does what the command of its name does and writes
nothing: what it returns holds the results as xarray, draws them on given axes, and writes them when asked to.
"""
