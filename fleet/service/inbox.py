"""Events on their way to the core: whoever writes much holds up himself, and nobody else."""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Collection

from fleet.core.events import Event, GoalDeleted, GoalPut
from fleet.service.event_translation import address_of
from keyexpr_schema.limits import in_force

OWN = ""
"""Whose events are no change of a key: timers, answers, workers that come and go."""


class Inbox:
    """Waiting events, one writer after the other in turn, those of each in their order.

    So are those of one key, whoever wrote them. A goal beyond the most that may be `open_goals`, or
    beyond half of that of one writer, waits until others have ended: it costs nothing meanwhile,
    and `tell` hears how many do, in a sentence, and None when none does any more. `known` are the
    goals that the planner has: another object whenever that changes.
    """

    def __init__(
        self, known: Callable[[], Collection[str]], tell: Callable[[str | None], None]
    ) -> None:
        self._known, self._tell = known, tell
        self._queues: OrderedDict[str, deque[tuple[Event, str]]] = OrderedDict()
        self._where: dict[str, tuple[str, int]] = {}
        """Of each key that something waits of: in whose queue, and how many."""
        self._later: dict[str, OrderedDict[str, Event]] = {}
        """Goals that wait until others have ended, by writer and name."""
        self._writers: dict[str, str] = {}
        """Who wrote the goals that the planner has."""
        self._counted: tuple[object, Counter[str]] = (None, Counter())
        self._told = 0
        self._filled = asyncio.Event()

    def put_nowait(self, event: Event, writer: str = OWN) -> None:
        """Take in an event that `writer` has led to."""
        found = address_of(event)
        keyexpr = found[0].build(found[1]) if found is not None else ""
        if keyexpr:
            writer, waiting = self._where.get(keyexpr, (writer, 0))
            self._where[keyexpr] = (writer, waiting + 1)
        self._queues.setdefault(writer, deque()).append((event, keyexpr))
        self._filled.set()

    def empty(self) -> bool:
        """Whether nothing can be had now."""
        return not self._queues and not self._next_later()

    async def get(self) -> Event:
        """The next event, as soon as there is one; whatever waits, others come to their turn."""
        await asyncio.sleep(0)
        while (event := self._pop()) is None:
            self._filled.clear()
            await self._filled.wait()
        return event

    def get_nowait(self) -> Event | None:
        """The next event; None: those that wait are not to be had yet."""
        return self._pop()

    def _pop(self) -> Event | None:
        if (writer := self._next_later()) is not None:
            goal, event = self._later[writer].popitem(last=False)
            self._writers[goal] = writer
            self._drop_later(writer, goal)
            return event
        while self._queues:
            writer, queue = self._queues.popitem(last=False)
            event, keyexpr = queue.popleft()
            if queue:
                self._queues[writer] = queue
            if keyexpr:
                _, waiting = self._where.pop(keyexpr)
                if waiting > 1:
                    self._where[keyexpr] = (writer, waiting - 1)
            if not self._put_off(event, writer):
                return event
        return None

    def _next_later(self) -> str | None:
        return next((writer for writer in self._later if self._has_room(writer)), None)

    def _has_room(self, writer: str) -> bool:
        """Whether one more goal of this writer is looked at: nobody has more than half of them."""
        most, known = in_force().open_goals, self._known()
        if self._counted[0] is not known:
            self._writers = {goal: who for goal, who in self._writers.items() if goal in known}
            self._counted = (known, Counter(self._writers.values()))
        return len(known) < most and self._counted[1][writer] < max(1, most // 2)

    def _put_off(self, event: Event, writer: str) -> bool:
        """Whether an event is about a goal that has to wait, and waits with it."""
        if isinstance(event, GoalDeleted):
            for each in [who for who, goals in self._later.items() if event.goal in goals]:
                self._drop_later(each, event.goal)
        elif isinstance(event, GoalPut):
            goal = event.goal.goal
            waits = next((who for who, goals in self._later.items() if goal in goals), None)
            if waits is not None or not (goal in self._known() or self._has_room(writer)):
                self._later.setdefault(waits or writer, OrderedDict())[goal] = event
                self._tell_of_later()
                return True
            self._writers[goal] = writer
        return False

    def _drop_later(self, writer: str, goal: str) -> None:
        self._later[writer].pop(goal, None)
        if not self._later[writer]:
            del self._later[writer]
        self._tell_of_later()

    def _tell_of_later(self) -> None:
        """Say so at the first, each time that they have doubled, and when there are none left."""
        waiting = sum(map(len, self._later.values()))
        if waiting >= 2 * self._told or not waiting:
            self._told = waiting
            self._tell(
                f"{waiting} goals or so are not looked at before others have ended: there are "
                f"{in_force().open_goals}, which is the most at a time"
                if waiting
                else None
            )
