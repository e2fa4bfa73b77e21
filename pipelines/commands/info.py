"""The command `info`: what a report of a fault has to say about the installation."""

from __future__ import annotations

from pipelines.commands.application import Json, app, finish


@app.command()
def info(as_json: Json = False) -> None:
    """Version, commit, Python, platform, versions of dependencies, and which extras are there."""
    from pipelines.report.installation import installation

    found = installation()
    finish({"lines": found.lines(), **found.facts()}, as_json)
