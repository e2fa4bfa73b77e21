"""Ctrl-C arrives once, after a held block, and is not lost in the clean-up of an object."""

from __future__ import annotations

import signal
import threading
import time

import pytest

from sloshlab import interrupt
from sloshlab.errors import RecordingInterruptedError


def test_a_held_block_is_done_before_the_interrupt_arrives() -> None:
    steps = []

    def work() -> None:
        with interrupt.held():
            with interrupt.held():
                signal.raise_signal(signal.SIGINT)
                steps.append("inner")
            steps.append("outer")
        steps.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert steps == ["inner", "outer"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_held_block_without_interrupt_changes_nothing() -> None:
    with interrupt.held():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(OSError, match="its own"), interrupt.held():
        raise OSError("its own")


def test_another_thread_holds_nothing() -> None:
    seen = []

    def work() -> None:
        with interrupt.held():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_an_interrupt_in_the_clean_up_of_an_object_arrives_after_it() -> None:
    class Dying:
        def __del__(self) -> None:
            raise KeyboardInterrupt

    def work() -> None:
        Dying()
        for _ in range(5000):
            time.sleep(0.001)

    with pytest.raises(KeyboardInterrupt), interrupt.never_lost():
        work()


def test_whoever_handles_the_interrupt_already_goes_on_doing_so() -> None:
    """A command may run within a program that has its own handler, or ignores Ctrl-C."""
    for handler in (signal.SIG_IGN, lambda *told: None):
        before = signal.signal(signal.SIGINT, handler)
        try:
            with interrupt.never_lost():
                assert signal.getsignal(signal.SIGINT) is handler
                signal.raise_signal(signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is handler
        finally:
            signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("number", interrupt.TERMINATIONS)
def test_a_termination_is_an_exception_with_the_exit_code_of_shells(number: int) -> None:
    steps = []

    def work() -> None:
        with interrupt.never_lost():
            try:
                with interrupt.held():
                    signal.raise_signal(number)
                    steps.append("held")
                steps.append("never")
            finally:
                signal.raise_signal(number)  # a second one does not break off the clean-up
                steps.append("cleaned up")

    with pytest.raises(interrupt.Terminated) as ended:
        work()
    assert steps == ["held", "cleaned up"]
    assert ended.value.exit_code == 128 + number
    assert signal.getsignal(number) is signal.SIG_DFL


def test_a_hangup_that_is_ignored_stays_ignored() -> None:
    """So does nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupt.never_lost():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_termination_in_the_clean_up_of_an_object_arrives_after_it() -> None:
    class Dying:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    def work() -> None:
        Dying()
        for _ in range(5000):
            time.sleep(0.001)

    with pytest.raises(interrupt.Terminated), interrupt.never_lost():
        work()


def test_what_comes_up_after_a_signal_comes_of_it() -> None:
    """A library caught halfway may say anything; what was put away on purpose keeps its own words."""

    def failing(error: Exception, is_interrupted: bool) -> None:
        with interrupt.never_lost():
            try:
                if is_interrupted:
                    signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                pass
            raise error

    for error in (AttributeError("half a module"), ProcessLookupError(3, "No such process")):
        with pytest.raises(KeyboardInterrupt) as interrupted:
            failing(error, True)
        assert interrupted.value.__cause__ is error
        with pytest.raises(type(error)):
            failing(error, False)
    with pytest.raises(RecordingInterruptedError):
        failing(RecordingInterruptedError("what was recorded is kept"), True)
