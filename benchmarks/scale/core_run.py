"""The planner's core with everything that is outside it answered at once, in memory."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Any

from msgspec.structs import replace

from benchmarks.scale import errands
from benchmarks.scale.errands import Errands
from fleet.core import events
from fleet.core.effects import Effect, MakePlan, Publish
from fleet.core.events import Event
from fleet.core.planning_input import PlanningInput
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.keyspace import FACT, ORDER, PLAN_STATUS
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.tasks import Order, ReportState
from workers.orders.outbox import make_report

Timed = Callable[[Event, float, bool], None]


class CoreRun:
    """A fleet told to the core. Robots start and end what they are ordered as soon as it is heard.

    The planner's own facts come back to it, as they do by their keys. `watched` is called with
    every event, the seconds of CPU that its step took, and whether it changed the state.
    """

    def __init__(self, robots: int, watched: Timed | None = None, began_s: float = 0.0) -> None:
        self.robots = robots
        self.state = State()
        self.waiting: deque[Event] = deque()
        """Events that have not reached the core yet."""
        self.plans: dict[str, PlanState] = {}
        """How plans stand, as published."""
        self.orders: dict[str, Order] = {}
        """The newest order of each robot."""
        self.events = 0
        self.succeeded: Counter[str] = Counter()
        """Tasks of each plan reported as done."""
        self.given: list[PlanningInput] = []
        """The planning jobs that were wanted."""
        self.seen: set[tuple[str, str, int]] = set()
        """Attempts that robots have heard of."""
        self._watched = watched
        self.time_s = began_s
        self.begin_run(1)
        for place in errands.places():
            self.receive(events.PlacePut, place=place)
        for number in range(robots):
            spec = errands.robot(number)
            self.receive(events.RobotRegistered, spec=spec)
            self.receive(events.WorkerConnected, robot=spec.robot, incarnation="i1")
            for fact in errands.robot_facts(number):
                self.receive(events.FactPut, fact=fact)

    def begin_run(self, epoch: int) -> None:
        """The planner starts."""
        self.receive(
            events.PlannerStarted,
            epoch=epoch,
            incarnation="benchmark",
            skills=load_all_skills(),
            logic=LOGIC,
            lineage="benchmark",
        )

    def at(self) -> dict[str, Any]:
        """When the next event happens: time hardly passes."""
        self.time_s += 0.001
        return {"time_s": self.time_s, "wall_time_s": self.time_s}

    def wait(self, seconds: float) -> None:
        """Time passes."""
        self.time_s += seconds

    def receive(self, kind: type[Event], **fields: Any) -> tuple[Effect, ...]:
        """An event into the core; what it came to."""
        return self.apply(kind(**self.at(), **fields))

    def apply(self, event: Event) -> tuple[Effect, ...]:
        """An event into the core, as it is; what follows from it is put into `waiting`."""
        before, began_s = self.state, time.process_time()
        effects = self.handle(event)
        if self._watched is not None:
            self._watched(event, time.process_time() - began_s, self.state is not before)
        self.events += 1
        if isinstance(event, events.ReportReceived):
            self.succeeded[event.report.plan] += event.report.state is ReportState.SUCCEEDED
        for effect in effects:
            if isinstance(effect, MakePlan):
                self.given.append(effect.given)
            elif isinstance(effect, Publish):
                self.heard(effect)
        return effects

    def handle(self, event: Event) -> tuple[Effect, ...]:
        """An event into the core; what is to be done about it."""
        self.state, effects = step(self.state, event)
        return effects

    def tried(self, event: Event) -> None:
        """What an event would do, without a trace."""
        step(self.state, event)

    def heard(self, effect: Publish) -> None:
        """Something is published: robots, and who looks on, act on it."""
        if effect.key is ORDER:
            order = effect.payload
            assert isinstance(order, Order)
            attempt = (order.plan, order.task, order.attempt)
            if attempt not in self.seen:
                self.seen.add(attempt)
                self.orders[order.robot] = order
                self.waiting.append(self.reported(order, ReportState.STARTED))
                self.waiting.append(self.reported(order, ReportState.SUCCEEDED))
        elif effect.key is FACT:
            self.waiting.append(events.FactPut(fact=effect.payload, **self.at()))  # type: ignore[arg-type]
        elif effect.key is PLAN_STATUS:
            self.plans[effect.payload.plan] = effect.payload.state  # type: ignore[attr-defined]

    def reported(self, order: Order, state: ReportState) -> events.ReportReceived:
        """A worker's report on an order."""
        at = self.at()
        report = make_report(order, "i1", state, started_s=at["time_s"])
        if state is ReportState.SUCCEEDED:
            report = replace(report, ended_s=at["time_s"] + errands.DURATION_S)
        return events.ReportReceived(report=report, **at)

    def put_cups(self, numbers: Sequence[int]) -> None:
        """The things that goals are about are told."""
        for number in numbers:
            self.receive(events.ObjectPut, object=errands.cup(number))
            self.receive(events.FactPut, fact=errands.cup_fact(number))

    def put_goals(
        self, numbers: Sequence[int], sentences: bool = False, cups: int | None = None
    ) -> None:
        """Goals are told."""
        for number in numbers:
            self.receive(events.GoalPut, goal=errands.goal(number, sentences, cups))

    def ask(self, wanted: Errands) -> events.PlanningSucceeded:
        """A plan is asked for; the job's answer, which the core has not got yet."""
        goals = tuple(f"g{number}" for number in wanted.numbers)
        request = PlanRequest(request=f"ask-{wanted.plan}", plan=wanted.plan, goals=goals)
        self.receive(events.PlanRequested, request=request)
        return wanted.made(self.given[-1].job.job, self.at())

    def begin(self, plan: str, numbers: Sequence[int]) -> Errands:
        """Everything up to a running plan; its first orders are given."""
        wanted = Errands(plan, numbers, self.robots)
        self.put_cups(numbers)
        self.put_goals(numbers)
        self.apply(self.ask(wanted))
        return wanted

    def work(self, limit_s: float = float("inf"), tasks: int | None = None) -> float:
        """Everything that follows, for so long or until so many tasks are done; seconds of CPU."""
        began_s = time.process_time()
        until_s = began_s + limit_s
        until_tasks = None if tasks is None else sum(self.succeeded.values()) + tasks
        while self.waiting and time.process_time() < until_s:
            if until_tasks is not None and sum(self.succeeded.values()) >= until_tasks:
                break
            self.apply(self.waiting.popleft())
        return time.process_time() - began_s

    def live(self, plans: int, first: int, goals: int = 1) -> None:
        """Plans of so many goals each are begun and ended, one after the other."""
        for number in range(plans):
            start = first + number * goals
            name = f"past-{first + number}"
            self.begin(name, range(start, start + goals))
            self.work()
            if self.plans[name] is not PlanState.SUCCEEDED:
                raise SystemExit(f"{name} did not succeed: it is {self.plans[name].value}")
