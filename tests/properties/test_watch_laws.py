"""Laws of a watch: however things pass, in the end it has shown what the store has."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from keyexpr_schema.limits import Limits
from keyexpr_schema.transport.watch import DOUBT_S
from tests.support.reached import Reached, reaches
from tests.support.virtual_time import lived, passing
from tests.support.watched_life import KEYS, QUIET_S, Life

WRITERS, SESSIONS = 3, 11
SOON_SHOWN_S = DOUBT_S + 1.5
"""Where two words cross, a watch asks after a while which of them holds."""
AHEAD_S = st.sampled_from([0.0, 0.0, 0.0, 0.4, -0.4, 3.0, -3.0, 60.0, -60.0])
SAID = ("confirm", "confirm", "put", "put", "late", "late put", "deleted", "delete", "delete tree",
        "again", "replace", "large")  # fmt: skip
HAPPENS = ("cut", "mend", "lossy", "slow", "stop", "start", "restart", "full", "room", "copy",
           "set back", "emptied", "set clock", "begin anew")  # fmt: skip
NEW = ("confirm", "put", "late", "late put", "deleted", "delete", "delete tree", "replace", "large")
SOON = ("put", "put", "deleted", "replace")
ACT = st.one_of(*map(st.sampled_from, (SAID, SAID, SAID, HAPPENS)))
PAUSE_S = st.sampled_from([0.0, 0.0, 0.01, 0.06, 0.3, 0.9, 2.0, 6.0, 20.0])
WHO, WHICH = st.integers(0, SESSIONS - 1), st.integers(0, len(KEYS) - 1)
FEW = st.lists(WHICH, min_size=1, max_size=3)
"""Of what most is said: what is said of one thing meets."""
ACTS = FEW.flatmap(
    lambda few: st.lists(
        st.tuples(ACT, WHO, st.sampled_from(few), PAUSE_S), min_size=5, max_size=40
    )
)
SOON_S = st.sampled_from([0.0, 0.0, 0.002, 0.01, 0.06])
TOLD = st.lists(st.tuples(st.sampled_from(NEW), WHO, WHICH, SOON_S), min_size=3, max_size=30)
TAKEN = FEW.flatmap(
    lambda few: st.lists(
        st.tuples(st.sampled_from(SOON), WHO, st.sampled_from(few), SOON_S), min_size=2, max_size=20
    )
)
LIMITS = st.sampled_from(
    [
        Limits(),
        Limits(value_kb=1),
        Limits(value_kb=1, goals=2, facts=2),
        Limits(value_kb=1, facts=1),
    ]
)


def act(life: Life, what: str, who: int, which: int) -> None:
    """Something is said, or happens."""
    router, writer = life.router, who % WRITERS
    link, number = router.links[who % len(router.links)], which + who
    match what:
        case "confirm":
            life.confirm(writer, which)
        case "put":
            life.put(writer, which)
        case "late":
            life.confirm(writer, which, age_s=float(who))
        case "late put":
            life.put(writer, which, age_s=float(who), deleted=who % 2 == 1)
        case "deleted":
            life.put(writer, which, deleted=True)
        case "delete":
            life.delete(writer, which)
        case "delete tree":
            life.delete_tree(writer, which)
        case "again":
            life.again(writer, which)
        case "replace":
            life.replace(writer, which)
        case "large":
            life.confirm(writer, which, size=1000)
        case "cut":
            link.cut = True
            link.lose()
        case "mend":
            link.cut = False
            link.find()
        case "lossy":
            link.loses = number % 5 / 5
        case "slow":
            router.slowest_s = (0.001, 0.05, 0.3)[number % 3]
        case "stop":
            router.stop()
        case "start":
            router.start()
        case "restart":
            router.stop()
            router.start()
        case "full" | "room":
            router.fill(what == "full")
        case "copy":
            router.copy()
        case "set back" | "emptied":
            router.go_back(to_nothing=what == "emptied")
        case "set clock":
            life.writers[writer].clock.ahead_s = (0.0, 2.0, -2.0, 90.0)[number % 4]
        case "begin anew":
            link.stamps.begin_anew(link.clock.now_s())


@reaches(*set(SAID), "not set back", least={"something happens": len(HAPPENS)})
@given(
    st.integers(0, 2**32),
    LIMITS,
    st.booleans(),
    st.lists(AHEAD_S, min_size=SESSIONS, max_size=SESSIONS),
    ACTS,
)
@settings(max_examples=80)
def test_a_watch_ends_with_what_the_store_has(
    reached: Reached,
    seed: int,
    limits: Limits,
    puts_back: bool,
    ahead_s: list[float],
    acts: list[tuple[str, int, int, float]],
) -> None:
    """Whatever is said, by whom, by which clock, and whatever happens to links and store. Until the
    store is set back nobody is shown an older word of somebody after a newer one that is stored."""

    async def life() -> None:
        with tempfile.TemporaryDirectory() as folder:
            began = Life(Path(folder), seed, limits, puts_back=puts_back)
            async with began.begun(ahead_s) as life:
                for what, who, which, pause_s in acts:
                    act(life, what, who, which)
                    reached[what] += 1
                    reached["something happens"] += what in HAPPENS
                    await passing(pause_s)
                reached["not set back"] += not life.router.set_back
                await life.come_to_rest()
                stored = life.stored()
                for watcher in life.watchers:
                    assert not watcher.odd, f"{watcher.name}: {watcher.odd}"
                    assert not watcher.differs(stored)

    lived(life, seed)


@reaches("by receipt", "of another key")
@given(st.integers(0, 2**32), TOLD)
@settings(max_examples=25)
def test_what_one_says_comes_in_order_whatever_it_is_about(
    reached: Reached, seed: int, acts: list[tuple[str, int, int, float]]
) -> None:
    """In a watch that is in order: what is a question later than it passes holds up the rest."""

    async def life() -> None:
        with tempfile.TemporaryDirectory() as folder:
            async with Life(Path(folder), seed, Limits()).begun([0.0] * SESSIONS) as life:
                life.router.slowest_s = 0.005
                await passing(QUIET_S)
                for what, who, which, pause_s in acts:
                    act(life, what, who, which)
                    await passing(pause_s)
                await life.come_to_rest()
                for watcher in life.watchers:
                    if "in order" in watcher.name:
                        assert not watcher.out_of_turn()
                        for _, change in watcher.all_shown:
                            by_receipt = change.key.by_receipt and change.received
                            kind = "by receipt" if by_receipt else "of another key"
                            reached[kind] += 1

    lived(life, seed)


@reaches("contradicted", "deleted")
@given(st.integers(0, 2**32), TAKEN)
@settings(max_examples=40)
def test_what_several_say_at_once_is_soon_shown_as_the_store_has_it(
    reached: Reached, seed: int, acts: list[tuple[str, int, int, float]]
) -> None:
    """By their clocks or against them, where each word passes once, and the store takes it in."""

    async def life() -> None:
        with tempfile.TemporaryDirectory() as folder:
            ahead_s = [0.0, 0.3, -0.3] + [0.0] * (SESSIONS - WRITERS)
            async with Life(Path(folder), seed, Limits()).begun(ahead_s) as life:
                await passing(QUIET_S)
                for what, who, which, pause_s in acts:
                    act(life, what, who, which)
                    await passing(pause_s)
                await life.at_rest()
                await passing(SOON_SHOWN_S)
                stored = life.stored()
                for watcher in life.watchers:
                    assert not watcher.differs(stored)
                    said = watcher.all_shown
                    reached["contradicted"] += len(said) > len({key for key, _ in said})
                    reached["deleted"] += any(change.value is None for _, change in said)

    lived(life, seed)
