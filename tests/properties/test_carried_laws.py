"""Laws of what is believed of carried things, from a hand's sensor to the planner's core.

Two limits are not drawn. What somebody gives into a hand is said at once: a word of that which
comes late is believed until the hand is looked at again. And a basket has a sensor: where it has
none, what others say to be with its robot, and was in its hand, may be in the basket.
"""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from hypothesis import given, note, settings
from hypothesis import strategies as st

from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.carried import BASKET, HAND, Carried, Run
from tests.support.carried_words import OTHER, PLACES, ROBOT, THINGS, WITH_BASKET, Clocks
from tests.support.reached import Reached, reaches
from workers.skill_context import SkillContext

HOW = ("", "", "held back", "flies")
STEP = st.tuples(st.integers(0, 999), st.integers(0, 1), st.integers(0, 1), st.integers(0, 3))
SENDS = (0, 1, 1000, 1000)
"""How many of its last run's words a worker sends before it looks."""
PASS_S = 0.5


def around(carried: Carried, thing: str) -> Iterator[str]:
    """What can be done with a thing, and be said, by others than the robot."""
    where, held = carried.body.where[thing], carried.body.held
    if where == HAND:
        yield from ("takes",) * 4
    if where in PLACES:
        yield "moves"
        if held is None and not carried.ana.waiting:
            yield "gives"
            if carried.run is not None and carried.run.ctx:
                yield "gives and takes back"
        if not carried.body.things_at(OTHER):
            yield "other picks"
    if where == BASKET:
        yield "unloads"
    if where == OTHER:
        yield "other puts"
        if carried.spec is WITH_BASKET:
            yield "other loads"
    if held is None:
        yield "hand is empty"
    if carried.ana.waiting:
        yield "ana tells"
    if carried.other.waiting:
        yield "other tells"
    yield "planner hears"
    if carried.planner.wanted:
        yield "planner publishes"


def by_worker(carried: Carried, thing: str) -> Iterator[str]:
    """What the worker can do, and what can become of it."""
    run, body = carried.run, carried.body
    where = body.where[thing]
    if run is None:
        yield from ("worker starts",) * 8
        return
    yield from ("link",) if carried.link else ("link again",) * 3
    if carried.link and run.journal.unsent() is not None:
        yield from ("sends",) * 3
    if run.ctx is None:
        yield from ("worker ends", *("begins",) * 12)
        return
    yield from ("worker dies", "worker ends", "calls", "looks", *("feels",) * 4)
    yield from ("says by itself", "succeeds", "fails", "is cancelled", "is stopped")
    if where in PLACES and body.held is None:
        yield from ("picks",) * 8
    if where == HAND:
        yield from ("puts",) * 3
        if carried.spec is WITH_BASKET:
            yield from ("stows",) * 3
    if where != body.place:
        yield from ("finds nothing",) * 4


async def done(carried: Carried, act: str, thing: str, place: str, how: int) -> None:
    """One step."""
    run, ana, other = carried.run, carried.ana, carried.other
    match act:
        case "takes" | "moves" | "unloads":
            carried.moves(thing, place)
            if how or act == "unloads":
                carried.says(ana, AT, thing, place, HOW[how])
        case "hand is empty":
            carried.says(ana, HOLDING, ROBOT, NOTHING, HOW[how])
        case "gives and takes back":
            # The robot has heard that and looks, before the store has heard it.
            assert run is not None and run.ctx is not None
            carried.moves(thing, HAND)
            carried.says(ana, AT, thing, ROBOT, "flies")
            carried.says(ana, HOLDING, ROBOT, thing, "flies")
            carried.moves(thing, place)
            await run.ctx.holding()
        case "gives":
            carried.moves(thing, HAND)
            if how:
                flies = "flies" if how % 2 else ""
                carried.says(ana, AT, thing, ROBOT, flies)
                carried.says(ana, HOLDING, ROBOT, thing, flies)
        case "other picks":
            carried.moves(thing, OTHER)
            carried.says(other, HOLDING, OTHER, thing, HOW[how])
            carried.says(other, AT, thing, OTHER, HOW[how])
        case "other puts" | "other loads":
            carried.moves(thing, place if act == "other puts" else BASKET)
            carried.says(other, HOLDING, OTHER, NOTHING, HOW[how])
            carried.says(other, AT, thing, carried.really(thing), HOW[how])
        case "ana tells":
            carried.tells(ana)
        case "other tells":
            carried.tells(other)
        case "link" | "link again":
            carried.connect(not carried.link)
        case "sends":
            await carried.send(1 + how)
        case "planner hears":
            carried.planner.hear()
        case "planner publishes":
            carried.planner.publish()
        case "worker starts":
            await carried.start(SENDS[how])
        case "worker ends" | "worker dies":
            await carried.stop(in_peace=act == "worker ends")
        case "begins":
            carried.begin(thing)
        case _:
            assert run is not None and run.ctx is not None
            await attempted(carried, run, run.ctx, act, thing, place, how)


async def attempted(
    carried: Carried, run: Run, ctx: SkillContext, act: str, thing: str, place: str, how: int
) -> None:
    """What is done in an attempt, a part of which may be all that it comes to, and its end."""
    body = carried.body
    match act:
        case "succeeds":
            run.end(ReportState.SUCCEEDED)
        case "fails" | "is cancelled":
            await run.left()
            run.end(ReportState.FAILED if act == "fails" else ReportState.CANCELLED)
        case "is stopped":
            await run.crashed()
            run.end(ReportState.INTERRUPTED)
        case "calls":
            run.called()
        case "feels":
            await ctx.holding()
        case "says by itself":
            ctx.observe(HOLDING, ROBOT, body.held or NOTHING)
        case "looks":
            body.place = place
            await ctx.be_in(place)
            await ctx.look()
        case "picks":
            body.place = body.where[thing]
            carried.moves(thing, HAND)
            if how:
                ctx.observe_taken(thing, await ctx.holding(), f"in {place}")
        case "puts":
            body.place = place
            carried.moves(thing, place)
            if how:
                await ctx.holding()
                seen = {each.object: each for each in await ctx.look()}
                ctx.observe(AT, thing, ctx.world.whereabouts(seen[thing]))
        case "stows":
            carried.moves(thing, BASKET)
            if how:
                await ctx.holding()
        case "finds nothing":
            if await ctx.holding() is None:
                ctx.observe_missing(thing, body.place)
                ctx.observe(HOLDING, ROBOT, NOTHING)
        case _:
            raise AssertionError(act)


async def scenario(
    reached: Reached,
    clocks: Clocks,
    folder: Path,
    steps: Steps,
    ahead: Ahead,
    basket: bool,
    ending: Ending,
) -> None:
    """All steps, and the end: the hand is looked at once more, and all is delivered."""
    carried = Carried(folder, clocks, ahead, basket)
    await carried.start()
    by_itself = False
    try:
        for number, which, where, how in steps:
            clocks.pass_by(PASS_S)
            thing, place = THINGS[which], PLACES[where]
            can = (*around(carried, thing), *by_worker(carried, thing))
            act = can[number % len(can)]
            note(f"{act}: {thing} {place} {how}")
            await done(carried, act, thing, place, how)
            carried.lands()
            reached[act] += 1
            by_itself |= act == "says by itself"
        settled_first, by_attempt, in_peace, cut_off, sends = ending
        clocks.pass_by(PASS_S)
        if settled_first:
            await carried.settle()
            if carried.run is not None and carried.looked() and not by_itself:
                holds(carried, reached, looked_at=(HAND,))
                reached["looked at already"] += 1
        carried.connect(True)
        if carried.run is not None and by_attempt:
            if carried.run.ctx is None:
                carried.begin(THINGS[0])
            await carried.run.left()
            carried.run.end(ReportState.FAILED)
        else:
            if cut_off:
                await picked_unheard(carried, clocks)
            if carried.run is not None:
                await carried.stop(in_peace=in_peace)
            await carried.start(sends)
        await carried.settle()
        holds(carried, reached)
        if (thing := carried.body.held) is not None:
            # Somebody takes that, too, and says no more than that the hand is empty.
            clocks.pass_by(PASS_S)
            carried.moves(thing, PLACES[1])
            carried.says(carried.ana, HOLDING, ROBOT, NOTHING)
            await carried.settle()
            holds(carried, reached)
            reached["let go of in the end"] += 1
    finally:
        if carried.run is not None:
            await carried.run.close()


async def picked_unheard(carried: Carried, clocks: Clocks) -> None:
    """The robot has something in its hand while nobody hears it, and loses it when its worker has
    gone: that has still to say so when it is started again."""
    run, body = carried.run, carried.body
    thing = next((thing for thing in THINGS if body.where[thing] in PLACES), None)
    if run is None or run.ctx is not None or body.held is not None or thing is None:
        return
    carried.begin(thing)
    carried.connect(False)
    assert run.ctx is not None
    carried.moves(thing, HAND)
    run.ctx.observe_taken(thing, await run.ctx.holding(), "somewhere")
    await carried.stop(in_peace=True)
    clocks.pass_by(PASS_S)
    carried.moves(thing, PLACES[1])


def holds(carried: Carried, reached: Reached, looked_at: tuple[str, ...] = (HAND, BASKET)) -> None:
    """Nothing is believed falsely of the robot, nothing known is lost, and worker and planner
    agree."""
    planner, body, run = carried.planner, carried.body, carried.run
    assert run is not None
    assert planner.believes(HOLDING, ROBOT) == (body.held or NOTHING)
    for thing in THINGS:
        believed, really = planner.believes(AT, thing), carried.really(thing)
        assert believed != ROBOT or really == ROBOT, f"{thing} is not with the robot"
        if known := body.where[thing] in looked_at or carried.known(thing):
            assert believed == really, f"{thing} is lost"
        assert run.cache.value_of(AT, thing) == believed, "worker and planner do not agree"
        reached["known"] += known
        reached["held in the end"] += body.where[thing] == HAND
        reached["unknown"] += believed is None
    reached.update(carried.met)


Steps = list[tuple[int, int, int, int]]
Ahead = tuple[float, float]
Ending = tuple[bool, bool, bool, bool, int]
GIVEN = (
    st.lists(STEP, min_size=6, max_size=40),
    st.tuples(*[st.sampled_from([0.0, -90.0, 90.0])] * 2),
    st.booleans(),
    st.tuples(*[st.booleans()] * 4, st.sampled_from(SENDS)),
)


@reaches(
    "takes", "gives", "gives and takes back", "other picks", "other loads", "unloads",
    "hand is empty", "ana tells", "other tells",
    "picks", "puts", "stows", "feels", "says by itself", "finds nothing", "calls",
    "is stopped", "is cancelled", "worker ends", "worker dies", "link again", "overtaken",
    "denied meanwhile", "let go of in the end", "known", "unknown", "held in the end",
    "looked at already", least={"has still to say what is so no more": 10},
)  # fmt: skip
@given(*GIVEN)
@settings(max_examples=600, deadline=None)
def test_nothing_is_believed_falsely_of_a_hand_and_nothing_known_is_lost(
    reached: Reached, steps: Steps, ahead: Ahead, basket: bool, ending: Ending
) -> None:
    """Whatever is done, said and not said, and however long words are on their way: once the hand
    was looked at and all words have come.

    What somebody has said of a thing last, and nothing has moved it since, is believed; but for
    words that come late: before one of those, the robot may have heard of something older, and
    found it wrong (so it counts as of then), or the planner that the hand is empty.
    """
    clocks = Clocks()
    clock = SimpleNamespace(monotonic=clocks.now_s)
    with tempfile.TemporaryDirectory() as folder, patch("workers.host_clock.time", clock):
        asyncio.run(scenario(reached, clocks, Path(folder), steps, ahead, basket, ending))
