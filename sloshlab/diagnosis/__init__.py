"""What physics a simulation left out: where it misses recordings, what explains it, and whether that is unique.

`selection` searches the models that are worth a fit; `inference` holds their likelihood, their posterior and
the decision; `findings` are both for one case, `verdict` is what is said of them, and `examination` tells where
and how the baseline misses the recordings.
"""
