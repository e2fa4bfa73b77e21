"""Whether a recording agrees with itself, with the runs beside it, with what it states, and with physics.

`examination.examined` examines one run, `between_runs` runs of one rig together. What is found is a
`finding.Finding`; what could not be examined is said as well.
"""
