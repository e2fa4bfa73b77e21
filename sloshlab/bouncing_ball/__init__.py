"""A ball that bounces in the tank in place of the liquid: what it dissipates, and its parameters by measurement.

`ball` states the parameters and their non-dimensional form, `harmonic_response` and `decaying_motion` shake the
tank with the ball inside, `free_decay` lets a structure with it decay. `identification` searches the parameters,
`from_free_decay` by ζ(a), `from_work_line` by W̄ at one frequency; `frequency_error` tells how wrong a ball tuned
there is elsewhere. All motion is integrated by `sloshlab.twin`.
"""
