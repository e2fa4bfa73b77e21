"""Clocks that stand still unless somebody sleeps."""


class SteppedClock:
    """A clock that only sleeping moves; it remembers every sleep."""

    def __init__(self):
        self.now_ns = 5_000_000_000
        self.slept_s = []

    def monotonic_ns(self):
        return self.now_ns

    def utc_ns(self):
        return self.now_ns + 1_700_000_000_000_000_000

    def sleep(self, duration_s):
        assert duration_s >= 0
        self.slept_s.append(duration_s)
        self.now_ns += round(duration_s * 1e9)

    def arguments(self):
        return {"monotonic_ns": self.monotonic_ns, "utc_ns": self.utc_ns, "sleep": self.sleep}
