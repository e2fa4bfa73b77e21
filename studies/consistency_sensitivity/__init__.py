"""How much of what can be wrong with a recording the examination of consistency finds.

`damages` makes recordings wrong in known ways, `measurement` runs analysis and examination on them, `figures`
draws what `docs/consistency.md` shows. Nothing here is used by the analysis.
"""
