"""The core with its journal: events go in one after the other, and what went in is on disk.

The core is meant to be total. An event that it cannot handle all the same is set aside: what came
before it and what comes after it are handled as if it had not come.
"""

from __future__ import annotations

import asyncio
import logging
import traceback
from collections.abc import Callable, Iterable, Mapping

from fleet.core import events
from fleet.core.effects import Effect, Publish, Retract
from fleet.core.events import Event, encode_event
from fleet.core.model.skills import SkillModel
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from fleet.service.event_journal import EventJournal
from fleet.service.recovery import Recovered, recover
from fleet.service.snapshots import Snapshot
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import FactAddress

SNAPSHOT_EVERY = 1000
"""Events between two snapshots: replaying them takes some tenths of a second."""
SNAPSHOT_WHEN_IDLE = 100
"""After so many events a pause is used for a snapshot; replaying fewer takes no time."""

log = logging.getLogger(__name__)


class JournaledCore:
    """The planner's state, changed by events only.

    `on_set_aside` hears of each event that could not be handled, and why; also of one that could
    not be before, and has come again.
    """

    def __init__(self, journal: EventJournal, on_set_aside: Callable[[Event, str], None]) -> None:
        self._journal = journal
        self._on_set_aside = on_set_aside
        self._state = State()
        self._replayable = 0
        self._writing = False

    @property
    def state(self) -> State:
        """What the planner knows now."""
        return self._state

    @property
    def replayable(self) -> int:
        """How many events a start would have to replay now."""
        return self._replayable

    def recover(
        self,
        skills: Mapping[str, SkillModel],
        on_effects: Callable[[Iterable[Effect]], None],
        on_event: Callable[[Event], None] = lambda event: None,
    ) -> Recovered:
        """Come back to where the journal ends; `skills` are for journals that have none.

        `on_event` gets each event since the snapshot, `on_effects` what was to be done about it,
        and perhaps was not. What another logic of the core has led to is kept as a snapshot: this
        logic does not go over it again.

        Raises:
            JournalUnreadable: another version of the program wrote it.
        """
        recovered = recover(self._journal, skills, on_effects, on_event)
        self._state, self._replayable = recovered.state, recovered.replayed
        if recovered.state.logic != LOGIC:
            concluded = (Retract(FACT, FactAddress.of(key)) for key in recovered.concluded)
            self.keep_last_snapshot((*recovered.retracted, *concluded))
        return recovered

    def apply(self, event: Event) -> tuple[Effect, ...]:
        """Handle an event; what is to be done about it, once the event is on disk."""
        if self._journal.is_set_aside(event):
            self._on_set_aside(event, "it could not be handled before")
            return ()
        try:
            state, effects = step(self._state, event)
            if state is self._state:
                return ()
            line = encode_event(event)
        except Exception as error:
            return self.set_aside(event, error)
        self._journal.append_encoded(line)
        self._state = state
        self._replayable += 1
        return effects

    def set_aside(self, event: Event, error: Exception) -> tuple[Effect, ...]:
        """Keep an event that cannot be handled beside the journal; what is to be done about it."""
        reason = f"{type(error).__name__}: {error}"
        log.exception("%s cannot be handled: it is set aside", type(event).__name__)
        if not isinstance(event, events.TimerFired):  # one of those is like the other
            self._journal.set_aside(event, traceback.format_exc())
        self._on_set_aside(event, reason)
        if not isinstance(event, events.PlanningSucceeded):
            return ()
        # Nobody may wait for ever for a plan that cannot be taken over.
        return self.apply(
            events.PlanningFailed(
                job=event.job,
                reason=f"the plan that was made cannot be taken over ({reason})",
                time_s=event.time_s,
                wall_time_s=event.wall_time_s,
                monotonic_s=event.monotonic_s,
            )
        )

    # --- snapshots -------------------------------------------------------------------------------

    def snapshot_due(self, idle: bool) -> bool:
        """Whether it is time to keep a snapshot; `idle`: there is nothing else to do."""
        least = SNAPSHOT_WHEN_IDLE if idle else SNAPSHOT_EVERY
        return self._replayable >= least and not self._writing

    async def keep_snapshot(self, unconfirmed: Iterable[Publish | Retract]) -> None:
        """Write the state as it is now in a thread, and cut the journal below it.

        `unconfirmed` is what was sent, and the store may not have.
        """
        snapshot, replayable = self._snapshot(unconfirmed), self._replayable
        self._writing = True
        try:
            await asyncio.to_thread(self._journal.write_snapshot, snapshot)
        except OSError as error:
            log.warning("no snapshot could be kept, the next start takes longer: %s", error)
        else:
            self._journal.cut()
        finally:
            self._writing = False
            # After a failure not at once again, either.
            self._replayable -= replayable

    def keep_last_snapshot(self, unconfirmed: Iterable[Publish | Retract]) -> None:
        """Write the state at a clean end, so that the next start has nothing to replay."""
        if self._replayable:
            try:
                self._journal.write_snapshot(self._snapshot(unconfirmed))
            except OSError as error:
                log.warning("no snapshot could be kept, the next start takes longer: %s", error)
            else:
                self._replayable = 0
                self._journal.cut()

    def _snapshot(self, unconfirmed: Iterable[Publish | Retract]) -> Snapshot:
        keyexprs = (
            effect.key.build(effect.address)
            for effect in unconfirmed
            if isinstance(effect, Retract) or effect.key is FACT
        )
        return Snapshot(state=self._state, number=self._journal.last, unconfirmed=tuple(keyexprs))
