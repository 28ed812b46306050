"""Statements: the facts that can be read out of them."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import take_word
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.declarations import misfit
from fleet.core.state import State
from fleet.core.state_updates import (
    touch,
)
from fleet.errors import NotUnderstood
from fleet.language import statement_facts
from keyexpr_schema.payloads.world import Statement, StatementStatus


def statement_put(state: State, event: events.StatementPut) -> State:
    """Keep the statement, and believe the facts that can be read out of it.

    What was said once is read once: also by a planner without its journal, which finds what an
    earlier one has read.
    """
    statement = event.statement
    known = state.statements.get(statement.statement)
    if known == statement:
        return state
    state = replace(state, statements=state.statements.set(statement.statement, statement))
    status = state.statement_states.get(statement.statement)
    if known is None and status is not None and status.said_s == statement.said_s:
        return state
    return _read_statement(state, statement)


def statement_deleted(state: State, event: events.StatementDeleted) -> State:
    """Drop the statement. Facts once read out of it stay: they may have been confirmed since."""
    if event.statement not in state.statements and event.statement not in state.statement_states:
        return state
    state = replace(
        state,
        statements=state.statements.without(event.statement),
        statement_states=state.statement_states.without(event.statement),
    )
    return touch(state, Touch(Part.STATEMENT, event.statement))


def understand_again(state: State) -> State:
    """Read the statements again that were not understood, now that there are other names."""
    for name, status in state.statement_states.items():
        statement = state.statements.get(name)
        if status.reason is not None and statement is not None:
            state = _read_statement(state, statement)
    return state


def _read_statement(state: State, statement: Statement) -> State:
    name, said_s = statement.statement, statement.said_s
    try:
        words = state.vocabulary().spoken_by(statement.speaker)
        read = tuple(statement_facts(statement.text, words))
        for literal in read:
            if (wrong := misfit(literal, state.world())) is not None:
                raise NotUnderstood(wrong)
    except NotUnderstood as error:
        status = StatementStatus(statement=name, reason=str(error), said_s=said_s)
        return _set_status(state, status)
    state, facts = take_word(state, read, f"{PLANNER_SOURCE}:{name}", said_s or state.time_s)
    return _set_status(state, StatementStatus(statement=name, facts=facts, said_s=said_s))


def _set_status(state: State, status: StatementStatus) -> State:
    if state.statement_states.get(status.statement) == status:
        return state
    statement_states = state.statement_states.set(status.statement, status)
    state = replace(state, statement_states=statement_states)
    return touch(state, Touch(Part.STATEMENT, status.statement))
