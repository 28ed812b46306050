"""What was signed before is no news, and nobody makes anybody forget that."""

from __future__ import annotations

from keyexpr_schema.transport.heard import Heard
from keyexpr_schema.transport.stamps import stamp_of, ticks_of_time

NOW_S = 1_800_000_000.0


def stamp(at_s: float, session: int = 7) -> int:
    return stamp_of(ticks_of_time(NOW_S + at_s), session)


def test_one_session_says_a_thing_of_a_key_once() -> None:
    heard = Heard(3600.0)
    heard.note("ana", "home/k", stamp(0.0))
    assert heard.before("ana", "home/k", stamp(0.0))
    assert heard.before("ana", "home/k", stamp(-1.0))
    assert not heard.before("ana", "home/k", stamp(1.0))
    assert not heard.before("ana", "home/k", stamp(0.0, session=8))
    assert not heard.before("ana", "home/other", stamp(0.0))
    assert not heard.before("bob", "home/k", stamp(0.0))


def test_who_makes_up_sessions_is_forgotten_himself_and_then_nothing_old_of_his_is_taken() -> None:
    heard = Heard(3600.0, most=1000)
    heard.note("ana", "home/k", stamp(0.0))
    for number in range(5000):
        heard.note("bob", "home/k", stamp(1.0 + number / 1000, session=100 + number))
    assert len(heard) <= 1000
    assert heard.before("ana", "home/k", stamp(0.0))
    assert not heard.before("ana", "home/k", stamp(0.5, session=8))
    for number in range(5000):
        assert heard.before("bob", "home/k", stamp(1.0 + number / 1000, session=100 + number))
    assert not heard.before("bob", "home/k", stamp(6.1, session=5))


def test_what_is_too_old_to_be_taken_in_is_not_remembered() -> None:
    heard = Heard(60.0)
    for number in range(1000):
        heard.note("ana", f"home/{number}", stamp(float(number)))
    assert len(heard) <= 122
    assert heard.before("ana", "home/999", stamp(999.0))


def test_what_could_not_be_stored_may_be_said_again() -> None:
    heard = Heard(3600.0)
    heard.note("ana", "home/k", stamp(0.0))
    heard.begin()
    heard.note("ana", "home/k", stamp(1.0))
    heard.note("ana", "home/k", stamp(2.0))
    heard.note("ana", "home/new", stamp(2.0))
    heard.take_back()
    assert heard.before("ana", "home/k", stamp(0.0))
    assert not heard.before("ana", "home/k", stamp(1.0))
    assert not heard.before("ana", "home/new", stamp(2.0))
    assert len(heard) == 1
