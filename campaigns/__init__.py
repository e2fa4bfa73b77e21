"""Tasks by the hundred: shared out to processes or a cluster, their results kept, gone on with where they stopped.

Nothing in here knows what a task does: it is the name of a function, its arguments as JSON, and where its
results go.
"""
