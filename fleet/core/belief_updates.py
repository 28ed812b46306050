"""What is believed, and how it changes: facts, things, and robots that can be planned with.

These keep the indexes up, and note what they touched, as `fleet.core.state_updates` does.
"""

from __future__ import annotations

from collections.abc import Container, Iterable

import immutables
from msgspec.structs import replace

from fleet.core.effects import PLANNER_SOURCE
from fleet.core.indexes.fact_views import FactValues
from fleet.core.indexes.fleet_index import M, carrier_in, in_set, rest_in
from fleet.core.indexes.touches import Part, Touch, Touches
from fleet.core.model.derived import carriers, holds, written
from fleet.core.model.preconditions import made_true
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.core.own_waiting import tried_again, tried_again_after
from fleet.core.state import State
from keyexpr_schema.facts import AT, CHARGE, HOLDING, FactKey, Literal, Value
from keyexpr_schema.payloads.world import Fact, Object

AHEAD_S = 60.0
"""A fact from further ahead than this [s] was said in an earlier era, if there was one."""
COMPARED_SINCE_LOGIC = 1
"""Before this logic of the core, only facts in reports gave way to newer ones."""
RECEIVED_SINCE_LOGIC = 8
"""Before this logic of the core, the time that facts say, by their sources' clocks, told which of
two is newer."""
ONE_VARIABLE_SINCE_LOGIC = 3
"""Before this logic of the core, what something is on or in was no word about where it is."""
LET_GO_SINCE_LOGIC = 10
"""Before this logic of the core, what a hand was said to hold no more stayed with its robot."""


def believe(state: State, fact: Fact) -> State:
    """Believe a fact, unless a newer one is known: the newest word holds, on whatever way it came.

    The newest is what the store received last, where that is known; nobody's clock is asked. Else
    it goes by what facts say of their time, and one that says nothing (0) is said now. Of two that
    one party says of the same moment the finer one holds: in the kitchen, on the table there.
    """
    fact = as_written(state, fact)
    known = state.facts.get(fact.key)
    if known == fact:
        return state
    if known is not None and state.logic >= COMPARED_SINCE_LOGIC:
        if _is_older(state, fact, known):
            return state
        same_word = (known.source, known.time_s) == (fact.source, fact.time_s)
        if fact.time_s and same_word and known_finer(state, fact.literal) != fact.value:
            return state
    if state.logic >= ONE_VARIABLE_SINCE_LOGIC and fact.relation == AT:
        opened = _without_circle(state, fact)
        if opened is None:
            return state
        state = opened
    older = state.older_facts.without(fact.key)
    if _said_in_earlier_era(state, fact):
        older = older.set(fact.key, None)
    received = state.received
    if state.logic >= RECEIVED_SINCE_LOGIC and (last := state.receipt or state.last_received):
        received = received.set(fact.key, last)
    changed = _fact_changed(state, fact.key, known, fact)
    return replace(changed, older_facts=older, received=received)


def _is_older(state: State, fact: Fact, known: Fact) -> bool:
    """Whether it was said before what is known of the same variable."""
    received = state.received.get(fact.key, 0)
    if state.logic >= RECEIVED_SINCE_LOGIC and (received or state.receipt):
        return 0 < state.receipt < received
    if fact.time_s == 0.0:
        return False
    earlier, known_earlier = _said_in_earlier_era(state, fact), fact.key in state.older_facts
    return earlier > known_earlier or (earlier == known_earlier and fact.time_s < known.time_s)


def as_written(state: State, fact: Fact) -> Fact:
    """The fact of the one variable that says where a thing is, if it says what that is on or in."""
    if state.logic < ONE_VARIABLE_SINCE_LOGIC or rest_in(fact) is None:
        return fact
    literal = written(fact.literal, state)
    return replace(fact, relation=literal.variable.relation)


def known_finer(state: State, literal: Literal, *, aboard: bool = False) -> Value:
    """Its value, or the one believed where that says the same more finely: on a table in the
    kitchen, of what is said to be in the kitchen; `aboard`: or in a basket there."""
    variable, value = literal
    if variable.relation != AT or value is None or state.logic < ONE_VARIABLE_SINCE_LOGIC:
        return value
    facts = FactValues(state.facts)
    return facts.get(variable) if holds(literal, facts.get, state, aboard=aboard) else value


def _without_circle(state: State, fact: Fact) -> State | None:
    """The state in which the thing can be where the fact says: of what would be on or in the thing
    itself, what was said of the last is no longer believed. `None`: it cannot be there, since that
    is itself, or a part of it."""
    facts = FactValues(state.facts)
    if not isinstance(fact.value, str) or fact.value in state.places:
        return state
    below, said = fact.value, None
    for carrier in (*carriers(below, facts.get, state, aboard=True), None):
        if below == fact.subject:
            if said is None:
                return None
            unknown = replace(state.facts[said], value=None, source=fact.source, time_s=fact.time_s)
            return conclude(state, unknown)
        if facts.get(key := FactKey(AT, below)) == carrier is not None:
            said = key
        below = carrier or ""
    return state


def _said_in_earlier_era(state: State, fact: Fact) -> bool:
    return state.era > 0 and fact.time_s > state.time_s + AHEAD_S


def conclude(state: State, fact: Fact) -> State:
    """Believe what the planner concludes itself, and so publishes."""
    fact = as_written(state, fact)
    believed = believe(state, fact)
    if believed is state:
        return state
    return replace(believed, concluded=state.concluded.set(fact.key, fact))


def take_word(
    state: State, said: Iterable[Literal], source: str, time_s: float
) -> tuple[State, tuple[Fact, ...]]:
    """Believe what a person says, in one sentence; where the same is known more finely, that."""
    facts = tuple(as_written(state, Fact.of(literal, source, time_s)) for literal in said)
    for fact in facts:
        before = state
        state = conclude(state, replace(fact, value=known_finer(state, fact.literal, aboard=True)))
        state, _ = let_go(state, before, fact)
    return state, facts


def let_go(state: State, before: State, fact: Fact) -> tuple[State, Fact | None]:
    """What a robot held `before`, of which somebody else says that it does not, is where nobody
    knows; and the fact that says so, if that was not known. With the robot it would count as in its
    basket. A robot says itself where a thing is that it has let go of, in facts that come singly.
    """
    held = before.facts.get(fact.key)
    if (
        state.logic < LET_GO_SINCE_LOGIC
        or fact.relation != HOLDING
        or fact.source == fact.subject
        or held is None
        or held.value == fact.value
        or not isinstance(held.value, str)
        or (where := state.fact(AT, held.value)) is None
        or where.value != fact.subject
    ):
        return state, None
    gone = replace(where, value=None, source=fact.source, time_s=fact.time_s, by=fact.by)
    return conclude(state, gone), gone


def believe_effects(
    state: State,
    action: Action,
    world: WorldModel,
    *,
    source: str,
    time_s: float,
    by: str = "",
    of_program: bool = False,
    reported: Container[FactKey] = frozenset(),
) -> tuple[State, tuple[Fact, ...]]:
    """Believe what an action that was done in `world` has made true, as of `time_s`, but for what
    is `reported`; and those facts."""
    facts = []
    for literal in made_true(action, world.facts, world):
        if of_program and literal.value is None:
            continue  # what a program leaves open, its calls have told
        fact = as_written(state, replace(Fact.of(literal, source, time_s), by=by))
        if fact.key not in reported:
            state = conclude(state, replace(fact, value=known_finer(state, fact.literal)))
            facts.append(fact)
    return state, tuple(facts)


def forget_fact(state: State, key: FactKey) -> State:
    """No longer believe anything of a variable."""
    known = state.facts.get(key)
    if known is None:
        return state
    older, received = state.older_facts.without(key), state.received.without(key)
    state = replace(state, older_facts=older, received=received)
    return _fact_changed(state, key, known, None)


def _fact_changed(state: State, key: FactKey, old: Fact | None, new: Fact | None) -> State:
    index, touches = state.index, state.touches.and_(Touch(Part.FACT, key))
    was, now = carrier_in(old), carrier_in(new)
    if was != now:
        touches = touched_carriers(state, key.subject, touches)
        index = replace(index, things_at=_moved(index.things_at, key.subject, was, now))
    before, after = rest_in(old), rest_in(new)
    if before != after:
        index = replace(index, said_on=_moved(index.said_on, key, before, after))
    facts = state.facts.without(key) if new is None else state.facts.set(key, new)
    state = replace(state, facts=facts, index=index, touches=touches)
    if was != now:
        state = replace(state, touches=touched_carriers(state, key.subject, touches))
        # A robot that is being drained is planned with until it carries nothing more.
        for carrier in (was, now):
            if carrier is not None and carrier in state.robots:
                state = robot_changed(state, carrier)
    state = tried_again_after(state, key, old, new)
    return robot_changed(state, key.subject) if key.relation in (HOLDING, CHARGE) else state


def _moved(
    sets: immutables.Map[str, immutables.Map[M, None]], member: M, was: str | None, now: str | None
) -> immutables.Map[str, immutables.Map[M, None]]:
    if was is not None:
        sets = in_set(sets, was, member, False)
    return sets if now is None else in_set(sets, now, member, True)


def touched_carriers(state: State, subject: str, touches: Touches) -> Touches:
    """Whoever carries it, directly or with what it is on or in, may be reserved or free now."""
    for carrier in carriers(subject, FactValues(state.facts).get, state, aboard=True):
        touches = touches.and_(Touch(Part.ROBOT, carrier))
    return touches


def set_object(state: State, thing: Object) -> State:
    """Keep a thing; what was said to be on or in it was said of where that is."""
    name = thing.object
    if thing.part_of is not None:
        whole = Literal(FactKey(AT, name), thing.part_of)
        state = _without_circle(state, Fact.of(whole, PLANNER_SOURCE, state.time_s)) or state
    state = _part_changed(state, name, thing.part_of)
    state = _said_on_known(replace(state, objects=state.objects.set(name, thing)), name)
    return tried_again(state, (name,))


def forget_object(state: State, name: str) -> State:
    """Drop a thing."""
    state = _part_changed(state, name, None)
    return replace(state, objects=state.objects.without(name))


def _part_changed(state: State, name: str, whole: str | None) -> State:
    known = state.objects.get(name)
    parts = _moved(state.index.parts, name, None if known is None else known.part_of, whole)
    return replace(state, index=replace(state.index, parts=parts))


def _said_on_known(state: State, name: str) -> State:
    """A name stands for something now: facts that say `on` or `in` it are of where things are."""
    for key in sorted(state.index.said_on.get(name, ())):
        fact = state.facts[key]
        if as_written(state, fact) != fact:
            state = believe(forget_fact(state, key), fact)
    return state


def robot_changed(state: State, robot: str) -> State:
    """Look again at whether a robot is there and can be planned with."""
    state = replace(state, touches=state.touches.and_(Touch(Part.ROBOT, robot)))
    ready, team = state.ready(robot), state.index.team
    if ready == (robot in team):
        return state
    team = team.set(robot, None) if ready else team.delete(robot)
    state = replace(state, index=replace(state.index, team=team))
    if not ready:
        return state
    touches = state.touches.and_(Touch(Part.TEAM))
    return replace(state, team_number=state.team_number + 1, touches=touches)
