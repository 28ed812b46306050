"""How far two clocks are apart, as far as the time of an answer lets one say."""

from __future__ import annotations

import asyncio
import time

import pytest

from keyexpr_schema.errors import ClockSkewed
from keyexpr_schema.transport.clock_skew import ClockSkew, ClockWatch

NOW_S = 1_000_000.0


class Store:
    """A store whose clock is `behind_s` behind this one; each answer takes as long as `takes_s`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, behind_s: float, *takes_s: float) -> None:
        self._behind_s, self._takes_s, self._passed_s = behind_s, list(takes_s), 0.0
        self.asked = 0
        monkeypatch.setattr(time, "time", lambda: NOW_S + self._passed_s)
        monkeypatch.setattr(time, "monotonic", lambda: self._passed_s)

    async def clock_s(self, _: float) -> float | None:
        """Its time, as of the middle of the answer."""
        self.asked += 1
        takes_s = self._takes_s.pop(0)
        there_s = NOW_S + self._passed_s + takes_s / 2 - self._behind_s
        self._passed_s += takes_s
        return there_s


async def test_clocks_that_agree_are_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(monkeypatch, 0.0, 0.002)
    watch = ClockWatch(store.clock_s)
    await watch.check()
    assert watch.latest is not None
    assert not watch.latest.worth_saying
    assert store.asked == 1


@pytest.mark.parametrize(
    ("behind_s", "said"),
    [
        (600.0, "600 s|10 min ahead of that of the router's host"),
        (-600.0, "10 min behind that of the router's host"),
        (0.6, "0.6 s ahead of that"),
        (86_400.0 * 3, "3 days ahead of that"),
    ],
)
async def test_one_that_is_off_is_refused_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, behind_s: float, said: str
) -> None:
    store = Store(monkeypatch, behind_s, 0.5, 0.004, 0.9)
    right = rf"the clock of this host is ({said}).*, and may be 0\.4 s off"
    with pytest.raises(ClockSkewed, match=right):
        await ClockWatch(store.clock_s).check()


async def test_an_answer_that_took_long_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(monkeypatch, 0.6, 1.0, 0.9, 0.8)
    watch = ClockWatch(store.clock_s)
    await watch.check()
    assert watch.latest == ClockSkew(pytest.approx(0.6), pytest.approx(0.4))


async def test_who_waits_goes_on_when_the_clock_is_right(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.WRONG_AGAIN_S", 0.0)
    off = [600.0, 600.0, 0.0]

    async def clock_s(_: float) -> float | None:
        return time.time() - (off[0] if len(off) == 1 else off.pop(0))

    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.MEASUREMENTS", 1)
    await ClockWatch(clock_s).until_right()
    assert [record.getMessage().split(",")[0] for record in caplog.records] == [
        "the clock of this host is 10 min ahead of that of the router's host",
        "the clock of this host is right again",
    ]


async def test_without_a_store_of_ours_nothing_is_known() -> None:
    async def clock_s(_: float) -> float | None:
        return None

    watch = ClockWatch(clock_s)
    await watch.check()
    assert watch.latest is None


class Clocks:
    """The clock of a host, which somebody sets, and stamps that do not go back with it; the clock
    that nobody sets goes on by a second at each look of a watch."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *ahead_s: float) -> None:
        self._ahead_s, self._passed_s, self._stamp_s = list(ahead_s), 0.0, 0.0
        self.begun: list[float] = []
        self.wrong_stamps: list[float] = []
        monkeypatch.setattr(time, "monotonic", lambda: self._passed_s)
        monkeypatch.setattr(time, "time", lambda: NOW_S + self._passed_s + self._ahead_s[0])
        monkeypatch.setattr("keyexpr_schema.transport.clock_skew.asyncio.sleep", self._look)

    async def _look(self, pause_s: float) -> None:
        self.wrong_stamps.append(self.now_s() - NOW_S - self._passed_s)
        if len(self._ahead_s) == 1:
            raise asyncio.CancelledError
        self._passed_s += pause_s
        self._ahead_s.pop(0)

    async def store_s(self, _: float) -> float | None:
        """The store's clock is right."""
        return NOW_S + self._passed_s

    def now_s(self) -> float:
        """A stamp that is made now."""
        self._stamp_s = max(self._stamp_s, time.time())
        return self._stamp_s

    def begin_anew(self, at_least_s: float) -> None:
        """Back with the host's."""
        assert at_least_s == pytest.approx(NOW_S + self._passed_s)
        self.begun.append(self._passed_s)
        self._stamp_s = at_least_s


@pytest.mark.parametrize(
    ("ahead_s", "begun"),
    [
        ([0.0, 600.0, 600.0, 0.0, 0.0, 0.0], [3.0]),
        ([0.0, 600.0, 0.0, 0.0, 0.0, 600.0, 0.0, 0.0, 0.0], [2.0, 6.0]),
        ([0.0, 600.0, 600.0, 600.0, 600.0], []),
        ([0.0, -600.0, -600.0, 0.0, 0.0], []),
        ([0.0, 0.3, 0.0, 0.0, 0.0], []),
    ],
)
async def test_stamps_begin_anew_when_a_clock_that_was_ahead_is_right_again(
    monkeypatch: pytest.MonkeyPatch, ahead_s: list[float], begun: list[float]
) -> None:
    """Not at the first look: what was stamped right before might be stored."""
    clocks = Clocks(monkeypatch, *ahead_s)
    with pytest.raises(asyncio.CancelledError):
        await ClockWatch(clocks.store_s, clocks).watch()
    assert clocks.begun == begun
    assert bool(begun) == (clocks.wrong_stamps[-1] < 1.0 and max(clocks.wrong_stamps) > 1.0)
