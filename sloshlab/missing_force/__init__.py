"""The force that a simulation lacks: where it acts, what it depends on, what kind of force it is.

`latent_force` inverts the residuals for it; `interface_cut` tells the side of a measured interface, and
`force_character` its kind, by what `force_regression` and `force_levels` find in it. All of it is read along the
measured motion, and therefore a picture and a proposal, never a judgement.
"""
