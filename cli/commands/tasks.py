"""`robotctl task`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import (
    AnyPlanArgument,
    GoalArgument,
    PlanArgument,
    TaskArgument,
    WhyOption,
    plan_and_task,
)
from cli.command import Call, command, group

if TYPE_CHECKING:
    from rich.console import RenderableType

app = group("Look at tasks; add one to a plan, or say that one is done.")


@command(app, "list")
async def list_(
    call: Call,
    plan: AnyPlanArgument = None,
) -> None:
    """Tasks and how they stand."""
    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.errors import check_known
    from cli.views.tasks import tasks_table
    from keyexpr_schema.ids import natural_order

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS)
    if plan is not None:
        check_known("plan", plan, view.plans.keys() | view.plan_status)
    records = sorted(
        (record for (of, _), record in view.tasks.items() if plan in (None, of)),
        key=lambda record: (natural_order(record.plan), natural_order(record.task)),
    )
    call.show(records, lambda: tasks_table(records, view.now_s) if records else "No tasks.")


@command(app, "show")
async def show(
    call: Call,
    plan: PlanArgument,
    task: TaskArgument = None,
) -> None:
    """One task: its orders, every try of every attempt, and what was learned on the way."""
    from cli.client.planner_requests import check_plan
    from cli.errors import check_known
    from keyexpr_schema.keyspace import ORDER, REPORT, TASK_RECORD

    plan, task = plan_and_task(plan, task)
    async with call.session() as session:
        await check_plan(session, plan)
        records = {a.task: r for a, r in (await session.list(TASK_RECORD, plan=plan)).items()}
        check_known(f"task of plan {plan}", task, records, "the plan has no tasks yet")
        orders = list((await session.list(ORDER, plan=plan, task=task)).values())
        reports = list((await session.list(REPORT, plan=plan, task=task)).values())
    record = records[task]
    reports.sort(key=lambda report: report.attempt)

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.views.programs import program_lines
        from cli.views.tasks import reports_table, tasks_table

        parts: list[RenderableType] = [tasks_table([record])]
        if reports:
            parts += ["", reports_table(reports)]
        parts += program_lines(record, reports)
        return Group(*parts)

    call.show({"task": record, "orders": orders, "reports": reports}, draw)


@command(app, "add")
async def add(
    call: Call,
    plan: PlanArgument,
    skill: Annotated[str, typer.Argument(metavar="SKILL", help="Such as navigate.")],
    args: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME=VALUE", help="Its parameters, such as place=kitchen."),
    ] = None,
    after: Annotated[
        list[str] | None,
        typer.Option(
            "--after",
            metavar="TASK",
            help="Only when this is done; repeatable.",
            autocompletion=completion.tasks,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            help="Who shall do it; else it is allocated.",
            autocompletion=completion.robots,
        ),
    ] = None,
) -> None:
    """Add a task to a plan; the planner checks it like any other.

    With `do robot=hsr text="bring cup 1 to the hallway"` a sentence for a robot: it is carried out
    by a program.
    """
    from cli.client.planner_requests import (
        acting_planner,
        ask_planner,
        check_plan,
        check_robot,
        request_name,
    )
    from cli.errors import check_known
    from keyexpr_schema.keyspace import PLAN_SPEC
    from keyexpr_schema.payloads.plans import PlanAddress
    from keyexpr_schema.payloads.programs import DO
    from keyexpr_schema.payloads.requests import Control, ControlRequest

    given = parse_args(args or [])
    async with call.session() as session:
        await check_plan(session, plan)
        spec = await session.get(PLAN_SPEC, PlanAddress(plan))
        for name in after or ():
            check_known("task", name, (t.task for t in spec.tasks) if spec else ())
        if robot is not None:
            await check_robot(session, robot)
        can = await acting_planner(session)
        if can is not None and can.skills:
            check_known("skill", skill, (DO, *can.skills))
        answer = await ask_planner(
            session,
            ControlRequest(
                request=request_name(),
                control=Control.ADD_TASK,
                plan=plan,
                skill=skill,
                args=given,
                after=tuple(after or ()),
                robot=robot,
                by=call.by,
            ),
        )
    call.show(answer, lambda: answer.sentence)


@command(app, "done")
async def done(
    call: Call,
    plan: PlanArgument,
    task: TaskArgument = None,
    why: WhyOption = "",
) -> None:
    """Say that somebody has done a task by hand: what it brings about is believed.

    A robot that is at it leaves off. The rest of the plan is checked, and planned again where it no
    longer works.
    """
    from cli.client.planner_requests import ask_planner, check_plan, request_name
    from cli.errors import check_known
    from keyexpr_schema.keyspace import TASK_RECORD
    from keyexpr_schema.payloads.requests import Control, ControlRequest

    plan, task = plan_and_task(plan, task)
    async with call.session() as session:
        await check_plan(session, plan)
        records = {address.task for address in await session.list(TASK_RECORD, plan=plan)}
        check_known(f"task of plan {plan}", task, records, "the plan has no tasks yet")
        answer = await ask_planner(
            session,
            ControlRequest(
                request=request_name(),
                control=Control.TASK_DONE,
                plan=plan,
                task=task,
                by=call.by,
                reason=why,
            ),
        )
    call.show(answer, lambda: answer.sentence)


@command(app, "explain")
async def explain(
    call: Call,
    text: Annotated[str, typer.Argument(metavar="TEXT", help='Such as "set the table for two".')],
    speaker: Annotated[
        str | None,
        typer.Option(
            "--speaker", metavar="PERSON", help='Who says it, of the people in the world: "me".'
        ),
    ] = None,
) -> None:
    """Say what a task that goals can name would mean here, and by which method; do nothing.

    Exit code 1 where it means nothing here, with every method and why it cannot be taken.
    """
    from cli.client.planner_requests import ask_about_tasks
    from cli.errors import Refused
    from cli.views.named_tasks import explanation
    from keyexpr_schema.payloads.methods import TasksQuery

    async with call.session() as session:
        reply = await ask_about_tasks(session, TasksQuery(text=text, speaker=speaker))
    if reply.understood is not None or call.json:
        call.show(reply, lambda: explanation(reply))
    elif reply.called:
        call.warn(explanation(reply))
    if reply.understood is None:
        raise Refused(reply.reason or "it was not understood")


@command(app, "keep")
async def keep(
    call: Call,
    goal: GoalArgument,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of tasks; made if need be.")],
) -> None:
    """Keep what a language model has made of a goal as a task, which then needs no model.

    Only where it has proposed one, and the goal was confirmed. `planner --tasks FILE` reads it.
    """
    from cli.errors import Refused, check_known
    from fleet.errors import BadTaskFile
    from fleet.service.task_files import add_task
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import GoalState

    async with call.session() as session:
        known = {a.goal: status for a, status in (await session.list(GOAL_STATUS)).items()}
    check_known("goal", goal, known)
    status = known[goal]
    if status.teaches is None:
        raise Refused(f"no language model has proposed a task for goal {goal}")
    if status.state is GoalState.REJECTED:
        raise Refused(
            f"nobody has said yet that goal {goal} is meant so: `robotctl goal answer {goal} yes`"
        )
    try:
        task = add_task(file, status.teaches)
    except BadTaskFile as error:
        raise Refused(str(error)) from None
    call.show(
        {"task": task.name, "file": str(file)},
        lambda: (
            f"task {task.name} is kept in {file}; the planner knows it once it is started with "
            f"--tasks {file} (or `tasks` under `planner` in robotctl.yaml)"
        ),
    )


def parse_args(written: list[str]) -> dict[str, str]:
    """`["place=kitchen"]` as `{"place": "kitchen"}`.

    Raises:
        BadArgument: an entry is not NAME=VALUE, or a name comes twice.
    """
    from cli.errors import BadArgument

    given: dict[str, str] = {}
    for entry in written:
        name, equals, value = entry.partition("=")
        if not (name and equals and value):
            raise BadArgument(f"{entry!r} is not NAME=VALUE, such as place=kitchen")
        if name in given:
            raise BadArgument(f"parameter {name!r} is given twice")
        given[name] = value
    return given
