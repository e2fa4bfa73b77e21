"""Blocks of a source that follow one another become one block of the journal."""

from fake_source import block

from acquisition.recorder.block_joining import BlockJoiner
from acquisition.samples.delivery import Block, End, Trouble, TroubleKind


class Written:
    """Stands for the journal."""

    def __init__(self) -> None:
        self.order: list[tuple] = []

    def append_blocks(self, source: int, blocks: list[Block], /) -> None:
        self.order.append((source, blocks[0].group, [block.counter for block in blocks]))

    def append(self, source: int, delivery, /) -> None:
        self.order.append((source, delivery))


def test_blocks_are_joined_until_a_gap_or_a_quarter_of_a_second() -> None:
    written, now = Written(), [0]
    joiner = BlockJoiner(written, lambda: now[0], lambda source, blocks: None)
    for counter in (0, 10, 20, 35):
        joiner.add(0, block(counter))
    assert written.order == [(0, 0, [0, 10, 20])]
    joiner.add(0, block(45, stream=2))
    assert written.order[1:] == [(0, 0, [35])]
    now[0] = 249_999_999
    joiner.write_due()
    assert len(written.order) == 2
    now[0] = 250_000_000
    joiner.write_due()
    assert written.order[2:] == [(0, 0, [45])]
    joiner.add(0, block(55, stream=2))
    joiner.add(1, block(7))
    joiner.add(0, End(2, 65))
    assert written.order[3:] == [(0, 0, [55]), (0, End(2, 65))]
    joiner.write_all()
    assert written.order[5:] == [(1, 0, [7])]


def test_joining_is_bounded_by_bytes() -> None:
    written = Written()
    joiner = BlockJoiner(written, lambda: 0, lambda source, blocks: None)
    for k in range(9):
        joiner.add(0, block(k * 20_000, 20_000))
    # 160 kB each: the seventh makes a MiB full
    assert [len(counters) for _, _, counters in written.order] == [7]


def test_a_flood_of_troubles_is_summed() -> None:
    written, now = Written(), [0]
    joiner = BlockJoiner(written, lambda: now[0], lambda source, blocks: None)
    for number in range(1000):
        joiner.add(0, Trouble(TroubleKind.GARBAGE, f"{number}", 3, number))
    joiner.add(0, Trouble(TroubleKind.OVERRUN, "o", 1, 5))
    now[0] = 250_000_000
    joiner.write_due()
    assert written.order == [
        (0, Trouble(TroubleKind.GARBAGE, "0", 3000, 0)),
        (0, Trouble(TroubleKind.OVERRUN, "o", 1, 5)),
    ]
