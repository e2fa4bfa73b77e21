"""The vocabulary of what a simulation may lack: effects, their equations, their numbers with priors, their places.

`effects` holds the vocabulary, one module per block; `candidate` is an effect at a place of a rig; `extension`
what it adds to a simulation and its readings; `prior` what is believed of its numbers.
"""
