"""One thread per source: start it together with the others, read it until told to stop, let it go."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from acquisition.recorder.delivery_queue import DeliveryQueue
from acquisition.recorder.journal_format import is_in_file_range
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import Source
from sloshlab.errors import SloshlabError, SourceError

READ_TIMEOUT_S: Final = 0.1
_PAUSE_S: Final = 0.01
_START_TIMEOUT_S: Final = 30.0


class ReaderThread:
    """Reads one opened source into the queue; every way to end is told to the queue.

    Parameters
    ----------
    number : int
        Of the source.
    source : Source
        Opened; the thread closes it.
    queue : DeliveryQueue
    start_together : threading.Barrier
        Where the readers wait for each other before they start their devices.
    failed : callable
        Told number and reason at once, ahead of everything that waits in the queue.
    sleep : callable
        Takes seconds; given by tests.
    """

    def __init__(
        self,
        number: int,
        source: Source,
        queue: DeliveryQueue,
        start_together: threading.Barrier,
        failed: Callable[[int, str], None],
        *,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.number, self._source, self._queue = number, source, queue
        self._start_together, self._failed, self._sleep = start_together, failed, sleep
        self._is_stopping = False
        name = f"reader of {source.info.device}"
        # a driver that never returns must not keep the process alive
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin; the device starts when all readers are there."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end after the read it is in."""
        self._is_stopping = True

    def join(self, timeout_s: float) -> bool:
        """Wait for the end; False if it did not come in time."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        error = self._reason_of(self._read_until_stopped)
        if error is not None:
            # told before the source is closed and past the queue: closing may take long, and samples may wait
            # there
            self._failed(self.number, error)
        close_error = self._reason_of(self._source.close)
        if error is None and close_error is not None:
            self._failed(self.number, close_error)
        self._queue.finish(self.number, error or close_error)

    def _read_until_stopped(self) -> None:
        # so that all devices start at the same time, however long each took to open
        self._start_together.wait(_START_TIMEOUT_S)
        if not self._is_stopping:
            self._source.start()
        while not self._is_stopping:
            if not self._read_once(READ_TIMEOUT_S):
                return
        # what had arrived when the stop came, and what the source itself holds back (a CAN device is asked to stop
        # and the end that it announces proves its last frames)
        if self._read_once(0.0):
            self._put(self._source.finish())

    def _put(self, deliveries: Sequence[Delivery]) -> bool:
        for delivery in deliveries:
            if isinstance(delivery, Block):
                self._check(delivery)
        return self._queue.put(self.number, deliveries) if deliveries else True

    def _read_once(self, timeout_s: float) -> bool:
        deliveries = self._source.read(timeout_s)
        if deliveries:
            return self._put(deliveries)
        if timeout_s:
            # a source that has nothing more may return at once
            self._sleep(_PAUSE_S)
        return True

    def _check(self, block: Block) -> None:
        """Refuse what no source may deliver, before it reaches the journal that all sources share."""
        groups = self._source.info.groups
        is_group = 0 <= block.group < len(groups)
        expected = len(groups[block.group]) if is_group else 0
        is_samples = block.counts.ndim == 2 and block.counts.dtype == np.int32
        if not is_group or not is_samples or block.counts.shape[1] != expected:
            raise SourceError(
                f"source {self._source.url}",
                got=f"{block.counts.dtype} samples of shape {block.counts.shape} in group {block.group}",
                allowed="int32 samples with one column per channel of the group",
            )
        if not is_in_file_range(block.stream, block.counter, block.counter + len(block.counts)):
            raise SourceError(
                f"source {self._source.url}", got=f"sample counter {block.counter}", allowed="< 2^63"
            )

    def _reason_of(self, action: Callable[[], None]) -> str | None:
        """Why `action` failed, in one line; a reader never dies silently."""
        try:
            action()
        except SloshlabError as error:
            return str(error)
        except threading.BrokenBarrierError:
            return f"source {self._source.url}: the sources did not start together"
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything; the others go on
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
            return f"source {self._source.url}: got an error inside its driver ({reason})"
        return None
