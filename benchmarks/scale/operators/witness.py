"""Who looks on from outside: what robots report, where things really are, who holds what.

From this it is judged whether anything was done twice, whether a goal that counts as reached is,
whether the reason for which one failed is true, and whether anybody is stranded.
"""

from __future__ import annotations

import asyncio
import re
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from benchmarks.scale.planner_news import until_news
from keyexpr_schema.keyspace import (
    CLOSURE,
    GOAL_STATUS,
    HOLD,
    ORDER,
    REPORT,
    ROBOT_SPEC,
    ROBOT_STATE,
    SIM_SENSES,
    SIM_TRUTH,
    STOP,
)
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalStatus
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanState
from keyexpr_schema.payloads.robots import FULL, RobotActivity, RobotState
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.tasks import Order, ReportState
from keyexpr_schema.transport.session import Change, Session

HELD_BY = {STOP: "stop", HOLD: "hold", CLOSURE: "closure"}
UNKNOWN = re.compile(r"nobody knows of (?P<thing>\w+)")
GIVEN_UP = re.compile(r"failed: (?P<reason>.*)$", re.DOTALL)


class Witness:
    """Kept up by `follow`."""

    def __init__(self) -> None:
        self.succeeded: defaultdict[tuple[str, str], set[int]] = defaultdict(set)
        """Attempts that succeeded, by plan and task."""
        self.failures: set[str] = set()
        """Why attempts have failed, as robots said."""
        self.truths: dict[str, Truth] = {}
        self.been: defaultdict[str, set[str | None]] = defaultdict(set)
        """Where things have been since `look_anew`; also in the basket of who drives there."""
        self.senses: dict[str, Senses] = {}
        self.states: dict[str, RobotState] = {}
        self.own: dict[str, GoalStatus] = {}
        """Goals of the planner's own that have not ended."""
        self.emptied: list[str] = []
        """Robots whose batteries have run empty, each time."""
        self._orders: dict[object, Order] = {}
        self._held: dict[object, str] = {}
        self._specs: set[str] = set()
        self._news = asyncio.Event()

    async def follow(self, session: Session) -> None:
        """Watch for ever."""
        keys = (REPORT, ORDER, ROBOT_STATE, ROBOT_SPEC, SIM_TRUTH, SIM_SENSES, GOAL_STATUS)
        async with session.watch(*keys, STOP, HOLD, CLOSURE) as watch:
            async for change in watch:
                self.see(change)
                self._news.set()

    def see(self, change: Change[Any, Any]) -> None:
        """Take a change in."""
        address, value = change.address, change.value
        if change.key in HELD_BY:
            self._held.pop(address, None)
            if value is not None:
                self._held[address] = f"{HELD_BY[change.key]} {value}"
        elif change.key is ORDER:
            self._orders.pop(address, None)
            if value is not None:
                self._orders[address] = value
        elif change.key is ROBOT_SPEC:
            (self._specs.discard if value is None else self._specs.add)(address.robot)
        elif change.key is GOAL_STATUS:
            self.own.pop(address.goal, None)
            if value is not None and value.own and value.state not in ENDED_GOALS:
                self.own[address.goal] = value
        elif value is None:
            return
        elif change.key is REPORT:
            if value.state is ReportState.SUCCEEDED:
                self.succeeded[value.plan, value.task].add(value.attempt)
            if value.reason is not None:
                self.failures.add(value.reason)
        elif change.key is ROBOT_STATE:
            self.states[value.robot] = value
        elif change.key is SIM_TRUTH:
            self.truths[value.object] = value
            if value.held_by is None:
                self.been[value.object].add(value.place)
        elif change.key is SIM_SENSES:
            before = self.senses.get(value.robot)
            if value.charge == 0.0 and (before is None or before.charge != 0.0):
                self.emptied.append(value.robot)
            self.senses[value.robot] = value

    def look_anew(self) -> None:
        """From now on it counts where things are."""
        self.been.clear()
        for thing, place in self.places.items():
            self.been[thing].add(place)

    @property
    def twice(self) -> list[tuple[str, str]]:
        """Tasks that were done twice."""
        return [task for task, attempts in self.succeeded.items() if len(attempts) > 1]

    @property
    def places(self) -> dict[str, str | None]:
        """Where everything really is; what somebody holds is nowhere."""
        return {o: None if t.held_by else t.place for o, t in self.truths.items()}

    @property
    def held(self) -> dict[str, str]:
        """What is really in a hand, and in whose."""
        return {o: t.held_by for o, t in self.truths.items() if t.held_by is not None}

    @property
    def full(self) -> set[str]:
        """Robots whose batteries are full."""
        return {robot for robot, s in self.senses.items() if (s.charge or 0.0) >= FULL - 1.0}

    @property
    def empty(self) -> list[str]:
        """Robots whose batteries are empty."""
        return [robot for robot, senses in self.senses.items() if senses.charge == 0.0]

    def holding(self) -> list[str]:
        """What holds or empties somebody now, and who is not there."""
        empty = [f"{robot} is empty" for robot in self.empty]
        gone = [f"{robot} is not registered" for robot in self.senses if robot not in self._specs]
        return [*self._held.values(), *empty, *gone]

    def stranded(self, plans: dict[str, PlanState], told: set[str]) -> list[str]:
        """Who still has something to do, or in a hand, where nothing is to be done any more; but
        not what somebody has `told` to be somewhere else."""
        orders = [
            f"{order.robot} has an order of {order.plan}/{order.task}"
            for order in self._orders.values()
            if plans.get(order.plan) not in ENDED_PLANS
        ]
        busy = [
            f"{robot} is {state.activity.value}"
            for robot, state in self.states.items()
            if state.activity is not RobotActivity.IDLE
        ]
        hands = [f"{robot} has {o} in its hand" for o, robot in self.held.items() if o not in told]
        own = [
            f"{goal} is {status.state.value}: {status.reason}" for goal, status in self.own.items()
        ]
        return [*self.holding(), *orders, *busy, *hands, *own]

    async def until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Wait for news that make a condition hold; whether it did within `limit_s`."""
        return await until_news(self._news, condition, limit_s)

    def is_true(self, reason: str, lost: set[str]) -> bool:
        """Whether a goal's reason to fail is what a robot has reported of a task, or that nobody
        knew of a thing which was `lost`."""
        said, unknown = GIVEN_UP.search(reason), UNKNOWN.search(reason)
        if said is not None:
            return said["reason"] in self.failures
        return unknown is not None and unknown["thing"] in lost
