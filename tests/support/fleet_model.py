"""A model of everything outside the planner's core, for tests of its laws: robots that carry out
orders, fail, crash and come back, and planning jobs that are answered at once, or late and in any
order. No key, no clock, no process.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import msgspec

from fleet.allocators.makespan import MakespanAllocator
from fleet.core import events
from fleet.core.closed_ways import kept_from
from fleet.core.effects import Archive, Effect, MakePlan, Publish, Retract, effects_of
from fleet.core.events import Event, decode_event, encode_event
from fleet.core.holds import paused, plan_paused
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.programs import program_action
from fleet.core.model.skills import SkillModel
from fleet.core.plan_entry import PlanEntry, PlanOutcome
from fleet.core.planning_input import PlanningInput
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import step
from fleet.core.table import Table
from fleet.service.composition import Composition, compose
from fleet.service.planning.planning_job import run_planning_job
from keyexpr_schema.facts import Value
from keyexpr_schema.keyspace import ORDER
from keyexpr_schema.payloads import requests
from keyexpr_schema.payloads.goals import OVER_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.history import Ended, GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Order, Report, ReportState, TaskState
from keyexpr_schema.payloads.world import Fact
from tests.support.derived import check_derived
from tests.support.household import PLACES, SKILLS, bring, carrier, cup, manipulator

Answer = events.PlanningSucceeded | events.PlanningFailed
_ALL = compose()
COMPOSITION: Composition = replace(
    _ALL,
    # What is searched for as long as there is time would differ from run to run.
    allocators={**_ALL.allocators, "makespan": MakespanAllocator(deadline_s=0.0, exact=False)},
)


BOTH = (bring(1, "hallway"), bring(2, "living_room"))


@lru_cache(4096)
def planned(given: bytes) -> Answer:
    """What a job comes to depends on nothing but its input, and examples begin alike."""
    return run_planning_job(msgspec.msgpack.decode(given, type=PlanningInput), COMPOSITION)


CHECK_EVERY = 5
"""Events between two looks at what the core keeps up: each derives everything anew."""


class FleetModel:
    """Feeds events to the core and keeps what it publishes; checks the laws on the way.

    With `late` answers, what planning jobs came to waits in `answers` until `answer` is called.
    """

    def __init__(
        self,
        robots: tuple[RobotSpec, ...],
        cups: int,
        late: bool = False,
        logic: int = LOGIC,
        skills: Mapping[str, SkillModel] = SKILLS,
    ) -> None:
        self._logic = logic
        self._skills = skills
        self.late = late
        self.answers: list[Answer] = []
        self.given_answers: list[Answer] = []
        self.met: Counter[str] = Counter()
        """How often answers came in ways that matter."""
        self.state = State()
        self.journal: list[bytes] = []
        self.documents: dict[str, Any] = {}
        self.effects: list[Effect] = []
        self.time_s = 0.0
        self.wall_s = 1000.0
        self.given: dict[tuple[str, str, int], str] = {}
        """Robot of every attempt ever ordered."""
        self.started: dict[tuple[str, str, int], float] = {}
        """When each attempt was started."""
        self.reports: list[Report] = []
        self.past: list[Ended] = []
        """What is over."""
        self._truth: dict[tuple[str, str], Value] = {}
        self._start(epoch=1, incarnation="one")
        for place in PLACES:
            self.receive(events.PlacePut, place=place)
        for number in range(1, cups + 1):
            self.receive(events.ObjectPut, object=cup(number))
            self.learn(f"cup_{number}", "at", "kitchen")
        for spec in robots:
            self.receive(events.RobotRegistered, spec=spec)
            self.receive(events.WorkerConnected, robot=spec.robot, incarnation="i1")
            self.learn(spec.robot, "holding", "nothing")

    def _start(self, epoch: int, incarnation: str) -> None:
        self.receive(
            events.PlannerStarted,
            epoch=epoch,
            incarnation=incarnation,
            skills=dict(self._skills),
            logic=self._logic,
            lineage=incarnation,
        )

    # --- what happens to the planner -------------------------------------------------------------

    def receive(self, kind: type[Event], **fields: Any) -> None:
        """One event into the core; its effects are carried out."""
        if kind is events.PlannerStarted:
            fields.setdefault("logic", LOGIC)
        self.time_s += 1.0
        self.wall_s += 0.01
        self.apply(kind(time_s=self.time_s, wall_time_s=self.wall_s, **fields))

    def apply(self, event: Event) -> None:
        """An event into the core, as it is."""
        before = self.state
        self.state, effects = step(before, event)
        if self.state is before:
            assert effects == ()
            return
        if len(self.journal) % CHECK_EVERY == 0:
            check_derived(before, self.state, effects)
        self.journal.append(encode_event(event))
        for plan, entry in self.state.plans.items():
            old = before.plans.get(plan)
            if old is not None and entry.plan.revision > old.plan.revision:
                check_revision(old, entry)
                self.met["ordered meanwhile, and goes on"] += check_given_out(old, entry)
            self.met["discarded"] += old is not None and entry.discarded > old.discarded
        self._take(effects)

    def _take(self, effects: tuple[Effect, ...]) -> None:
        self.effects.extend(effects)
        # All of a step's effects are meant to hold together: what ends makes room for what begins.
        for effect in sorted(effects, key=lambda e: not isinstance(e, Retract)):
            if isinstance(effect, Publish):
                keyexpr = effect.key.build(effect.address)
                if effect.key is ORDER:
                    self._check_order(effect.payload)
                self.documents[keyexpr] = effect.payload
            elif isinstance(effect, Retract):
                self.documents.pop(effect.key.build(effect.address), None)
        self.past += [effect.record for effect in effects if isinstance(effect, Archive)]
        for effect in effects:
            if isinstance(effect, MakePlan):
                answer = self.run(effect.given)
                if self.late:
                    self.answers.append(answer)
                else:
                    self.apply(answer)

    def run(self, given: PlanningInput) -> Answer:
        """What a planning job comes to."""
        return planned(msgspec.msgpack.encode(given))

    def answer(self, pick: int = 0) -> None:
        """One of the planning jobs under way is answered."""
        answer = self.answers.pop(pick % len(self.answers))
        self.given_answers.append(answer)
        self.met["in another order"] += any(other.job < answer.job for other in self.answers)
        self._count(answer)
        self.apply(answer)

    def answer_again(self, pick: int) -> None:
        """An answer comes a second time."""
        answer = self.given_answers[pick % len(self.given_answers)]
        self.met["a second time"] += 1
        before = self.state.plans
        self.apply(answer)
        assert self.state.plans == before, "a job was answered twice"

    def _count(self, answer: Answer) -> None:
        entries = [e for e in self.state.plans.values() if e.job and e.job.job == answer.job]
        self.met["superseded"] += not entries
        for entry in entries:
            assert entry.job is not None
            ended = [t for t in entry.job.under_way if entry.records[t].state not in OUTSTANDING]
            self.met["work ended meanwhile"] += bool(ended)
            new = [r for r in entry.open_reasons if r.number not in entry.job.takes_up]
            self.met["another reason meanwhile"] += bool(new)

    def _check_order(self, order: Any) -> None:
        assert isinstance(order, Order)
        attempt = (order.plan, order.task, order.attempt)
        new = attempt not in self.given
        assert self.given.setdefault(attempt, order.robot) == order.robot, (
            "an attempt changed hands"
        )
        entry = self.state.plans[order.plan]
        record = entry.records[order.task]
        if new:
            self.met["programs"] += order.program is not None
            self.met["ordered while a plan was made"] += entry.job is not None
            assert record.goal in (None, *self.state.goals), "ordered for a goal that is no more"
            stopped = [r for r in _robots(order, self.state) if self.state.stopped(r)]
            assert not stopped, f"{stopped} got an order during an emergency stop"
            held = [r for r in _robots(order, self.state) if paused(self.state, r)]
            assert not held and not plan_paused(self.state, order.plan), "ordered during a pause"
            assert not kept_from(self.state, record, self.state.world()), (
                "ordered where it is closed"
            )
        for before in (*record.after, *record.behind):
            if before in entry.records:
                assert entry.records[before].state.value == "succeeded", "ordered before its time"
        busy = [
            other
            for other in self.orders()
            if {other.robot, *other.args.values()} & {order.robot, *_robots(order, self.state)}
            and _robots(other, self.state) & _robots(order, self.state)
            and (other.plan, other.task) != (order.plan, order.task)
        ]
        assert not busy, f"{order.robot} is in two places"

    def learn(self, subject: str, relation: str, value: Value) -> None:
        """Something becomes true, and everybody hears of it."""
        self._truth[relation, subject] = value
        fact = Fact(
            subject=subject, relation=relation, value=value, source="test", time_s=self.time_s
        )
        self.receive(events.FactPut, fact=fact)

    def plan(self, *goals: Goal, **more: Any) -> None:
        """Put goals and ask for a plan for all that wait."""
        for goal in goals:
            self.receive(events.GoalPut, goal=goal)
        number = sum(b"PlanRequested" in line for line in self.journal)
        request = PlanRequest(**{"request": f"r{number}", **more})
        self.receive(events.PlanRequested, request=request)

    # --- what robots do --------------------------------------------------------------------------

    def orders(self) -> list[Order]:
        """Orders that stand, in a fixed order."""
        return [d for _, d in sorted(self.documents.items()) if isinstance(d, Order)]

    def wanted(self) -> list[Order]:
        """Orders that stand and are not cancelled."""
        return [order for order in self.orders() if not order.cancelled]

    def goal_state(self, goal: str) -> GoalState:
        """How a goal stands."""
        return self.goal_states[goal].state

    @property
    def plans(self) -> dict[str, PlanEntry]:
        """Every plan there ever was, those that are over as they were in the end."""
        past = (record for record in self.past if isinstance(record, PlanRecord))
        return {**{record.spec.plan: _entry(record) for record in past}, **self.state.plans}

    @property
    def goal_states(self) -> dict[str, GoalStatus]:
        """How every goal stands, or stood when it was over, unless it was deleted."""
        over: list[GoalRecord] = []
        for record in self.past:
            over += record.goals if isinstance(record, PlanRecord) else ()
            over += (record,) if isinstance(record, GoalRecord) and not record.deleted else ()
        past = {goal.spec.goal: goal.status for goal in over if goal.status.state in OVER_GOALS}
        return {**past, **self.state.goal_states}

    @property
    def replies(self) -> dict[str, requests.Answer]:
        """The planner's answers, by request."""
        past = (record.answer for record in self.past if isinstance(record, RequestRecord))
        return {**{answer.request: answer for answer in past}, **self.state.answers}

    def report(self, order: Order, state: ReportState, **more: Any) -> None:
        """A worker reports on an order."""
        more = {"planner": order.planner, **more}
        report = Report(
            robot=order.robot,
            plan=order.plan,
            revision=order.revision,
            task=order.task,
            attempt=order.attempt,
            epoch=order.epoch,
            incarnation="i1",
            state=state,
            **more,
        )
        self.reports.append(report)
        self.receive(events.ReportReceived, report=report)

    def start(self, order: Order) -> None:
        """A worker starts an attempt; nobody may ever start it again."""
        attempt = (order.plan, order.task, order.attempt)
        if attempt not in self.started:
            self.started[attempt] = self.time_s
            self.report(order, ReportState.STARTED, started_s=self.time_s)

    def facts_after(self, order: Order) -> tuple[Fact, ...]:
        """The facts that hold once the order has been carried out."""
        if order.program is None:
            action = self._skills[order.skill].ground(order.args)
        else:
            whole = program_action(order.program, order.args, self._skills)
            assert whole is not None
            action = whole
        return tuple(
            Fact(
                subject=literal.variable.subject,
                relation=literal.variable.relation,
                value=literal.value,
                source=order.robot,
                time_s=self.time_s,
            )
            for literal in action.after
        )

    def succeed(self, order: Order) -> None:
        """A robot carries an order out."""
        self.start(order)
        facts = self.facts_after(order)
        for fact in facts:
            self._truth[fact.relation, fact.subject] = fact.value
        begun_s = self.started[order.plan, order.task, order.attempt]
        self.report(
            order, ReportState.SUCCEEDED, facts=facts, started_s=begun_s, ended_s=self.time_s
        )

    def fail(self, order: Order, reason: str = "it slipped", retryable: bool = True) -> None:
        """A robot has tried, and failed for good."""
        self.start(order)
        failed = {"reason": reason, "retryable": retryable, "ended_s": self.time_s}
        self.report(order, ReportState.FAILED, **failed)

    def cancelled(self, order: Order) -> None:
        """A robot confirms that it does no more about an order."""
        self.report(order, ReportState.CANCELLED)

    def interrupt(self, order: Order, done: bool, stops: tuple[str, ...] = ()) -> None:
        """A worker crashed, or was stopped, in the middle and is back; the work was done, or it
        was not."""
        self.start(order)
        facts = self.facts_after(order) if done else ()
        ended = {"facts": facts, "stops": stops, "ended_s": self.time_s}
        self.report(order, ReportState.INTERRUPTED, **ended)

    def lose(self, robot: str) -> None:
        """A robot goes away for so long that it counts as lost."""
        self.receive(events.WorkerDisconnected, robot=robot, incarnation="i1")
        self.wall_s += Policy().lost_after_s + 1.0
        self.receive(events.TimerFired)

    def return_(self, robot: str) -> None:
        """A robot comes back."""
        self.receive(events.WorkerConnected, robot=robot, incarnation="i1")

    def finish(self, limit: int = 500) -> None:
        """Jobs are answered and orders carried out, until there are none left for robots there."""
        for _ in range(limit):
            if self.answers:
                self.answer()
            elif orders := [o for o in self.orders() if self.state.connected.get(o.robot)]:
                self.succeed(orders[0])
            else:
                return
        raise AssertionError("the plan does not come to an end")

    def finish_cancelling(self, limit: int = 500) -> None:
        """As `finish`, but what is cancelled is stopped and not carried out."""
        for _ in range(limit):
            if self.answers:
                self.answer()
            elif stopped := [order for order in self.orders() if order.cancelled]:
                self.cancelled(stopped[0])
            elif orders := self.orders():
                self.succeed(orders[0])
            else:
                return
        raise AssertionError("the plan does not come to an end")

    # --- the planner crashes ---------------------------------------------------------------------

    def crash(self) -> None:
        """The planner is killed, and its jobs with it; its journal is replayed by a new run."""
        self.answers.clear()
        state = State()
        for line in self.journal:
            state, _ = step(state, decode_event(line))
        assert state == self.state, "the journal replays to another state"
        self.state = state
        self._start(epoch=state.epoch + 1, incarnation="again")
        self._take(effects_of(self.state))


def _entry(record: PlanRecord) -> PlanEntry:
    """What a plan that is over looked like, as far as it is kept."""
    status = record.status
    return PlanEntry(
        plan=record.spec,
        state=status.state,
        records=Table({task.task: task for task in record.tasks}),
        outcome=msgspec.convert(status, PlanOutcome, from_attributes=True),
        change=status.change,
        reason=status.reason,
        violations=status.violations,
    )


def fleet() -> FleetModel:
    """One robot with a hand, one with a basket, and two cups in the kitchen."""
    return FleetModel((manipulator(), carrier()), cups=2)


def check_revision(old: PlanEntry, new: PlanEntry) -> None:
    """What a revision says of itself is so, and what it keeps of running work is left alone."""
    assert new.change is not None
    names = {task.task for task in new.plan.tasks}
    unfinished = {n for n, r in old.records.items() if r.state in {TaskState.WAITING, *OUTSTANDING}}
    done_already = {n for n in names if new.records[n].reason == "it is so already"}
    assert new.change.dropped == len(unfinished - names), "dropped"
    assert new.change.added == len(names - old.records.keys() - done_already), "added"
    for name in names & old.records.keys():
        was, now = old.records[name], new.records[name]
        if was.state in OUTSTANDING and now.state in OUTSTANDING:
            assert (was.robot, was.attempt) == (now.robot, now.attempt), "running work disturbed"


def check_given_out(old: PlanEntry, new: PlanEntry) -> bool:
    """What was ordered while the revision was made is part of it; says whether there was any."""
    asked_for = set(old.job.under_way if old.job is not None else ())
    given_out = [
        name
        for name in old.given_out.keys() - asked_for - set(old.unwanted)
        if old.records[name].state in {TaskState.SUCCEEDED, *OUTSTANDING}
    ]
    names = {task.task for task in new.plan.tasks}
    assert names.issuperset(given_out), "done, and not in the plan: it would be done again"
    assert not set(given_out) & set(new.unwanted), "given out, and cancelled at once"
    return bool(given_out)


def _robots(order: Order, state: State) -> set[str]:
    return {order.robot} | {value for value in order.args.values() if value in state.robots}
