"""Whether planner, store and workers agree when nothing is to be done: by what each of them says
on its keys, by what the planner answers when it is asked, and by the simulation."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Any

from msgspec.structs import astuple

from cli.client.fleet_view import FleetView
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_STATUS,
    QUESTION,
    REPORT,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import ENDED_GOALS
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanStatus
from keyexpr_schema.payloads.questions import QuestionQuery, QuestionReply
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.tasks import (
    ENDED_TASKS,
    FINAL_REPORTS,
    Order,
    Report,
    ReportState,
    TaskRecord,
    TaskState,
)
from keyexpr_schema.transport.session import Session

WATCHED: dict[Any, Callable[[FleetView], dict[Any, Any]]] = {
    GOAL_SPEC: lambda view: view.goals,
    GOAL_STATUS: lambda view: view.goal_status,
    PLAN_STATUS: lambda view: view.plan_status,
    TASK_RECORD: lambda view: view.tasks,
    FACT: lambda view: view.facts,
}
"""What the store has, and where whoever watches since the beginning has it."""
ASK_S = 5.0


async def disagreements(
    session: Session, view: FleetView, things: dict[str, str]
) -> tuple[list[str], int]:
    """Who says something else than another, in sentences, and how much was compared; `things` are
    objects with what people call them.

    Raises:
        SchemaError: the store or the planner did not answer.
    """
    stored = {key: await session.list(key) for key in WATCHED}
    wrong: list[str] = []
    compared = 0
    for key, table in WATCHED.items():
        seen = table(view)
        there = {_name(key, address): value for address, value in stored[key].items()}
        compared += len(there)
        wrong += [
            f"{key.name} {name}: the store has {there.get(name)}, and watchers {seen.get(name)}"
            for name in sorted({*there, *seen}, key=str)
            if there.get(name) != seen.get(name)
        ]
    wrong += _goals_and_plans(stored)
    orders, reports = await session.list(ORDER), await session.list(REPORT)
    records, plans = stored[TASK_RECORD].values(), stored[PLAN_STATUS].values()
    wrong += contradictions(records, plans, orders.values(), reports.values())
    facts = {fact.key: fact.value for fact in stored[FACT].values()}
    wrong += _robots(view, facts)
    for thing, words in things.items():
        compared += 1
        wrong += await _question(session, thing, words, facts.get((AT, thing)))
    return wrong, compared + len(orders) + len(reports)


def _name(key: Any, address: Any) -> Any:
    at = address.key if key is FACT else astuple(address)
    return at if len(at) > 1 else at[0]


def _goals_and_plans(stored: dict[Any, dict[Any, Any]]) -> list[str]:
    status = {address.goal: each for address, each in stored[GOAL_STATUS].items()}
    wanted = {address.goal for address in stored[GOAL_SPEC]}
    wrong = [f"of goal {goal} the planner says nothing" for goal in wanted - status.keys()]
    for goal, each in status.items():
        if not each.own and goal not in wanted:
            wrong.append(f"goal {goal} is {each.state.value} for the planner, and nobody wants it")
        if each.state not in ENDED_GOALS:
            wrong.append(f"goal {goal} is still {each.state.value}: {each.reason}")
    wrong += [
        f"plan {address.plan} is still {each.state.value}: {each.reason}"
        for address, each in stored[PLAN_STATUS].items()
        if each.state not in ENDED_PLANS
    ]
    return wrong


def contradictions(
    records: Iterable[TaskRecord],
    plans: Iterable[PlanStatus],
    orders: Iterable[Order],
    reports: Collection[Report],
) -> list[str]:
    """The planner's records against the robots' last words of the same attempts."""
    wrong = [
        f"{report.robot} is still at {report.plan}/{report.task}, by its report"
        for report in reports
        if report.state not in FINAL_REPORTS
    ]
    wrong += [
        f"{order.robot} still has an order of {order.plan}/{order.task}"
        for order in orders
        if not order.cancelled
    ]
    ended = {each.plan for each in plans if each.state in ENDED_PLANS}
    last: dict[object, Report] = {(r.robot, r.plan, r.task, r.attempt): r for r in reports}
    for record in records:
        what = f"{record.plan}/{record.task}"
        if record.plan in ended and record.state not in ENDED_TASKS:
            wrong.append(f"{what} is {record.state.value}, and its plan has ended")
        report = last.get((record.robot, record.plan, record.task, record.attempt))
        if record.state is TaskState.SUCCEEDED and record.attempt and record.reason is None:
            # With a reason it counts as done without a robot that says so: it was so already.
            said = None if report is None else report.state
            if said is not ReportState.SUCCEEDED:
                wrong.append(f"{what} has succeeded, and {record.robot} says {said} of it")
        succeeded = report is not None and report.state is ReportState.SUCCEEDED
        if succeeded and record.state is not TaskState.SUCCEEDED:
            wrong.append(f"{record.robot} has done {what}, which is {record.state.value}")
    return wrong


def _robots(view: FleetView, facts: dict[Any, Any]) -> list[str]:
    """What is believed of robots and things, what robots say of themselves, and what is true."""
    wrong = []
    for robot, state in view.robot_states.items():
        believed = facts.get((HOLDING, robot), NOTHING)
        if (state.holding or NOTHING) != believed:
            wrong.append(f"{robot} holds {state.holding}, and it is believed that {believed}")
        if (at := facts.get((AT, robot))) != state.place and state.place is not None:
            wrong.append(f"{robot} is in {state.place}, and it is believed that in {at}")
    for thing, truth in view.truths.items():
        holders = [r for r, state in view.robot_states.items() if state.holding == thing]
        if holders != ([truth.held_by] if truth.held_by else []):
            wrong.append(f"{thing} is held by {truth.held_by}, and by what robots say {holders}")
    return wrong


async def _question(session: Session, thing: str, words: str, at: Any) -> list[str]:
    """Whether the planner itself knows what stands on the fact's key."""
    asked = QuestionQuery(text=f"Where is {words}?")
    reply: QuestionReply = await session.query(QUESTION, PlannerAddress(), asked, ASK_S)
    known = [f.value for f in reply.facts if (f.relation, f.subject) == (AT, thing)]
    if known == [at]:
        return []
    return [f"asked for {thing}, the planner says {reply.answer or reply.reason}; its key: {at}"]
