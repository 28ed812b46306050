"""How a planner that starts comes back to where it was: its newest snapshot, and what followed.

The effects of the events that followed may not have been carried out. What the state says is
published anew anyway; what it says no more, it cannot tell: keys that were to be deleted, and facts
that the planner concluded. Those are carried along from snapshot to snapshot until the store has
confirmed them.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from fleet.core.effects import Archive, Effect, Publish, Retract
from fleet.core.events import Event
from fleet.core.model.skills import SkillModel
from fleet.core.state import State
from fleet.core.step import step
from fleet.service.event_journal import EventJournal
from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.facts import FactKey
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import FACT

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recovered:
    """A state, and what may not have been done about it.

    `retracted` are deletions that may not have been carried out, `concluded` the planner's own
    facts that may not have been published.
    """

    state: State
    replayed: int
    retracted: tuple[Retract, ...] = ()
    concluded: frozenset[FactKey] = frozenset()


def recover(
    journal: EventJournal,
    skills: Mapping[str, SkillModel],
    on_effects: Callable[[Iterable[Effect]], None] = lambda effects: None,
    on_event: Callable[[Event], None] = lambda event: None,
) -> Recovered:
    """The state that a journal leads to; events that the core cannot handle are set aside.

    `on_event` gets each event, `on_effects` what was to be done about it, and perhaps was not.

    Raises:
        JournalUnreadable: another version of the program wrote it.
    """
    snapshot = journal.snapshot()
    state = snapshot.state
    if not state.skills:  # in journals of earlier versions no event brings them
        state = replace(state, skills=dict(skills)).reindexed()
    pending = Unconfirmed(snapshot.unconfirmed)
    replayed = 0
    on_effects([Archive(record) for record in state.over])
    for number, event in journal.events(snapshot.number):
        try:
            state, effects = step(state, event)
        except Exception:
            log.exception("event %d cannot be handled: it is set aside", number)
            journal.set_aside(event, traceback.format_exc())
            journal.drop(number)
            continue
        replayed += 1
        pending.note(effects)
        on_event(event)
        on_effects(effects)
    return Recovered(state, replayed, tuple(pending.retracted()), pending.concluded())


class Unconfirmed:
    """Deletions and own facts that the store may not have, by key expression."""

    def __init__(self, keyexprs: Iterable[str] = ()) -> None:
        self._effects: dict[str, Publish | Retract] = {}
        for keyexpr in keyexprs:
            try:
                key = key_of(keyexpr)
            except ForeignKey:
                continue  # a key of another version
            self._effects[keyexpr] = Retract(key, key.parse(keyexpr))

    def note(self, effects: Iterable[Effect]) -> None:
        """Take in what was wanted later."""
        for effect in effects:
            if isinstance(effect, Retract) or (isinstance(effect, Publish) and effect.key is FACT):
                self._effects[effect.key.build(effect.address)] = effect
            elif isinstance(effect, Publish):
                self._effects.pop(effect.key.build(effect.address), None)

    def retracted(self) -> Iterable[Retract]:
        """What was to be deleted."""
        return (e for e in self._effects.values() if isinstance(e, Retract) and e.key is not FACT)

    def concluded(self) -> frozenset[FactKey]:
        """Variables whose facts the planner concluded."""
        return frozenset(e.address.key for e in self._effects.values() if e.key is FACT)  # type: ignore[attr-defined]
