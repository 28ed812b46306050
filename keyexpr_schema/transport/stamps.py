"""Time stamps of Zenoh as integers that order them; nothing of Zenoh itself is needed for that."""

from __future__ import annotations

from functools import lru_cache

_TICKS = 1 << 32
"""In a second: times are NTP64, counted from 1970."""
_ID_BITS = 128
_ID_MASK = (1 << _ID_BITS) - 1


def stamp_of_text(text: str) -> int:
    """The integer that orders a Zenoh timestamp `<NTP64 decimal>/<id hexadecimal>`.

    Time in the upper 64 bits, id in the lower 128: comparing these integers is comparing the
    timestamps as Zenoh does, which a float or a datetime cannot (they lose the lowest bits).
    Zenoh prints an id as a little-endian number and orders ids by their bytes, hence the swap.

    Raises:
        ValueError: `text` is not such a timestamp.
    """
    ticks, _, source = text.partition("/")
    return stamp_of(int(ticks), _source_number(source))


def text_of_stamp(stamp: int) -> str:
    """The timestamp whose integer is `stamp`, as Zenoh prints it."""
    return f"{ticks_of_stamp(stamp)}/{_source_text(source_of_stamp(stamp))}"


def source_of_stamp(stamp: int) -> int:
    """Which session's clock it is from."""
    return stamp & _ID_MASK


def same_session(stamp: int, other: int) -> bool:
    """Whether both are from the clock of one session: only then do they say which write is later,
    whatever the clocks of hosts show."""
    return source_of_stamp(stamp) == source_of_stamp(other)


def time_s_of_stamp(stamp: int) -> float:
    """Seconds since 1970 by the clock of its writer."""
    return ticks_of_stamp(stamp) / _TICKS


def stamp_of(ticks: int, source: int) -> int:
    """The stamp of that time, from the clock of that session."""
    return ticks << _ID_BITS | source


def ticks_of_stamp(stamp: int) -> int:
    """Its time, as NTP64."""
    return stamp >> _ID_BITS


def ticks_of_time(time_s: float) -> int:
    """Seconds since 1970 as NTP64."""
    return int(time_s * _TICKS)


# There are many stamps of few sources.
@lru_cache(maxsize=4096)
def _source_number(text: str) -> int:
    try:
        return _swap(int(text, 16))
    except OverflowError:
        raise ValueError(f"{text!r} is not the source of a timestamp") from None


@lru_cache(maxsize=4096)
def _source_text(source: int) -> str:
    return f"{_swap(source):x}"


def _swap(source: int) -> int:
    return int.from_bytes(source.to_bytes(16, "little"), "big")
