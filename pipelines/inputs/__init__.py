"""What an analysis is given: recordings and rigs, each a file or in memory.

A pipeline takes both in the same way: `recordings` and `rigs` say what each is called, what it holds and what its
hash is. Nothing here changes what was handed over.
"""
