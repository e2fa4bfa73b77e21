"""Gusts on aircraft and wings whose tanks slosh as trained models, and what the source shows of them."""
