"""Judged from outside: by what robots report, by the simulation, by what the store still has."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import (
    REPORT,
    ROBOT_STATE,
    SIM_SENSES,
    SIM_TRUTH,
    STOP,
)
from keyexpr_schema.payloads.robots import RobotState
from keyexpr_schema.payloads.stops import Stop, StopAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import Change, Session

STAYS_M = 1e-3
CONFIRM_S = 2.0


class Judge:
    """Looks on all the time; `wrong` is what must not have been."""

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.checked: defaultdict[str, int] = defaultdict(int)
        self._rests: dict[str, tuple[float, tuple[float, ...], str]] = {}
        self._stop = ""
        self._states: dict[str, RobotState] = {}
        self._held_by: dict[str, str | None] = {}
        self._kept: dict[str, Stop] = {}
        self._deleted: set[str] = set()
        self._written = 0

    def see(self, change: Change[Any, Any]) -> None:
        """Take in what anybody has put."""
        value = change.value
        if value is None:
            return
        if change.key is SIM_SENSES and (rests := self._rests.get(value.robot)) is not None:
            since_s, pose, stop = rests
            moved_m = math.dist(pose[:2], value.pose_m_rad[:2])
            if value.time_s >= since_s:
                self.checked["poses of stopped robots"] += 1
                if moved_m > STAYS_M:
                    self._say(
                        f"{value.robot} moved {moved_m:.3f} m under the confirmed stop {stop}"
                    )
                    del self._rests[value.robot]
        elif change.key is ROBOT_STATE:
            self._states[value.robot] = value
            self._note_rest(value)
        elif change.key is SIM_TRUTH:
            before = self._held_by.get(value.object)
            if before and value.held_by and value.held_by != before:
                self._say(f"{value.object} went from the hand of {before} to {value.held_by}'s")
            self._held_by[value.object] = value.held_by
        elif change.key is REPORT and value.state is ReportState.STARTED:
            rests = self._rests.get(value.robot)
            if rests is not None and (value.started_s or 0.0) > rests[0]:
                self._say(f"{value.robot} began {value.plan}/{value.task} under stop {rests[2]}")

    def stopped(self, stop: str) -> None:
        """From now on whoever says that it rests by this stop stays there, until `released`."""
        self._stop = stop
        for state in self._states.values():
            self._note_rest(state)

    def _note_rest(self, state: RobotState) -> None:
        new = state.robot not in self._rests and self._stop and self._stop in state.stops
        if new and state.pose_m_rad is not None:
            self.checked["confirmed stops of a robot"] += 1
            self._rests[state.robot] = (state.time_s, state.pose_m_rad, self._stop)

    def released(self) -> None:
        """Stopped robots may move again."""
        self._stop = ""
        self._rests.clear()

    async def write(self, session: Session) -> None:
        """Write something that nothing comes of, and remember it if that was confirmed."""
        name = f"probe-{self._written}"
        self._written += 1
        stop = Stop(stop=name, robots=("nobody",), reason="does this last?")
        try:
            await session.confirm(STOP, StopAddress(name), stop, CONFIRM_S)
        except (SchemaError, TimeoutError):
            return
        self._kept[name] = stop

    async def look_for_writes(self, session: Session) -> None:
        """Whether all that was confirmed is there, and nothing that was deleted."""
        found = {address.stop: stop for address, stop in (await session.list(STOP)).items()}
        for name, stop in self._kept.items():
            self.checked["confirmed writes"] += 1
            if found.get(name) != stop:
                self._say(f"the confirmed write {name} is lost")
        for name in self._deleted & found.keys():
            self._say(f"{name} was deleted, and is back")
        for name in found:
            if name.startswith("probe-"):
                await session.delete(STOP, StopAddress(name))
                self._deleted.add(name)
        self._kept.clear()

    def _say(self, what: str) -> None:
        print(f"WRONG: {what}", flush=True)
        self.wrong.append(what)

    def add(self, *found: str) -> None:
        """What was found wrong elsewhere."""
        for what in found:
            self._say(what)
