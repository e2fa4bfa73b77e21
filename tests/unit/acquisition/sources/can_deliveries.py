"""What CAN devices deliver, and until when a test reads."""

import time

from can_by_hand import (
    ENDED,
    counts_of,
    status,
)

from acquisition.sources import Block, End, Trouble

PATIENCE_S = 60.0


def url_of(server, dbc, more=""):
    return f"can:socketcand?port={server.port}&channel=can1&dbc={dbc}{more}"


def read_until(source, is_enough):
    """Deliveries until there are enough."""
    found = []
    deadline = time.monotonic() + PATIENCE_S
    while not is_enough(found):
        assert time.monotonic() < deadline, found
        found += source.read(0.1)
    return found


def read_for_ever(source, deliveries):
    """Add to the deliveries until the source fails."""
    while True:
        deliveries += source.read(0.1)


def has_end(deliveries):
    return any(isinstance(delivery, End) for delivery in deliveries)


def has(kind):
    return lambda deliveries: any(isinstance(d, Trouble) and d.kind is kind for d in deliveries)


def troubles(deliveries):
    return [(d.kind, d.count) for d in deliveries if isinstance(d, Trouble)]


def delivered(deliveries):
    """Counter → counts, each once."""
    found = {}
    for block in deliveries:
        if isinstance(block, Block):
            for k, row in enumerate(block.counts.tolist()):
                assert block.counter + k not in found
                found[block.counter + k] = tuple(row)
    return found


def complete(n_samples):
    return {counter: counts_of(counter) for counter in range(n_samples)}


ENDING = [status(ENDED, 9, 200)] * 3
