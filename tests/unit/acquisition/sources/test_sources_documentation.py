"""docs/sources.md names the options that the backends take, and no others."""

import re

import pytest

from acquisition.sources import open_source
from sloshlab.errors import SourceError

URLS = {
    "file": ["file:run.nc"],
    "serial": ["serial:/dev/ttyUSB0"],
    "can": ["can:socketcand", "can:slcan?channel=/dev/ttyUSB0", "can:udp_multicast", "can:virtual"],
    "sim": ["sim:shaker_sweep"],
}


def documented_options(page, scheme):
    section = re.search(rf"^## {scheme}$(.*?)(?=^## )", page, re.MULTILINE | re.DOTALL).group(1)
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)} - {"bus.NAME"}


def known_options(url):
    """The options that an error about an unknown one names."""
    with pytest.raises(SourceError) as caught:
        open_source(f"{url}{'&' if '?' in url else '?'}no_such_option=1")
    return set(re.search(r"allowed: options (.*?)(;|$)", str(caught.value)).group(1).split(", "))


@pytest.mark.parametrize("scheme", URLS)
def test_the_options_are_those_of_the_backend(repository, scheme):
    page = (repository / "docs" / "sources.md").read_text(encoding="utf-8")
    known = set().union(*(known_options(url) for url in URLS[scheme]))
    assert documented_options(page, scheme) == known


def test_the_example_is_short(repository):
    page = (repository / "docs" / "sources.md").read_text(encoding="utf-8")
    example = re.search(r"^class RampSource.*?(?=^```)", page, re.MULTILINE | re.DOTALL).group(0)
    assert len(example.strip().splitlines()) <= 40
