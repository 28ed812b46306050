"""`robotctl plan check`, `propose`, `diff`: plans that people have in their hands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call

if TYPE_CHECKING:
    from rich.console import RenderableType

    from fleet.core.model.world import WorldModel
    from keyexpr_schema.payloads.plans import Plan
    from keyexpr_schema.transport.session import Session

PROPOSAL_S = 120.0
"""How long the planner may take to check and allocate a proposed plan."""

FileArgument = Annotated[
    Path, typer.Argument(metavar="FILE", help="A plan as YAML or JSON; see `plan create --out`.")
]


async def check(
    call: Call,
    file: FileArgument,
    connected: Annotated[
        bool,
        typer.Option("--connected", help="Only robots that are connected; else all registered."),
    ] = False,
    world: Annotated[
        Path | None,
        typer.Option("--world", metavar="WORLD.yaml", help="Ask no fleet: this is the world."),
    ] = None,
    robots: Annotated[
        list[Path] | None,
        typer.Option("--robots", metavar="ROBOT.yaml", help="With --world: a robot; repeatable."),
    ] = None,
    facts: Annotated[
        list[str] | None,
        typer.Option(
            "--fact",
            metavar="RELATION SUBJECT VALUE",
            help="With --world: what is known, such as at cup_1 kitchen; repeatable.",
        ),
    ] = None,
    skills: Annotated[
        list[Path] | None,
        typer.Option("--skills", metavar="FILE", help="Models of more skills; repeatable."),
    ] = None,
) -> None:
    """Check a plan in a file as the planner would; exit code 0 if nothing speaks against it.

    Without --world the world is what the fleet is told now, and the goals that the plan names
    count with what they were understood to mean.
    """
    from cli.plans.files import read_plan
    from cli.plans.worlds import world_of_files, world_of_fleet
    from fleet.core.checker.plan_checker import check_plan
    from fleet.service.skill_models import load_all_skills

    _only_with_world(world, connected, robots, facts)
    plan = read_plan(file)
    models = load_all_skills(tuple(skills or ()))
    if world is not None:
        model = world_of_files(world, robots or (), facts or (), models)
    else:
        async with call.session() as session:
            model = await world_of_fleet(session, models, connected)
            plan = await _with_goals(session, plan)
    checked = check_plan(plan, model)

    def draw() -> RenderableType:
        from cli.views.plans import violations_table

        if not checked.violations:
            return f"plan {plan.plan} is valid: {_size(plan, model)}"
        return violations_table(checked.violations)

    call.show(checked.violations, draw)
    if checked.violations:
        count = len(checked.violations)
        call.warn(
            f"Error: {file}: {count} {'thing speaks' if count == 1 else 'things speak'} "
            f"against the plan; {checked.violations[0].sentence}"
        )
        raise typer.Exit(1)


def _only_with_world(
    world: Path | None, connected: bool, robots: list[Path] | None, facts: list[str] | None
) -> None:
    from cli.errors import BadArgument

    if world is None and (robots or facts):
        raise BadArgument(
            "--robots and --fact go with --world; without it the fleet's own are taken"
        )
    if world is not None and connected:
        raise BadArgument("--connected asks the fleet, and with --world no fleet is asked")
    if world is not None and not robots:
        raise BadArgument("name who could do it: --robots FILE, such as configs/robots/hsr.yaml")


async def _with_goals(session: Session, plan: Plan) -> Plan:
    """The plan, answering for its goals, too: as the planner takes it."""
    from msgspec.structs import replace

    from keyexpr_schema.keyspace import GOAL_STATUS

    understood = {a.goal: status for a, status in (await session.list(GOAL_STATUS)).items()}
    wanted = [
        condition
        for goal in plan.goals
        if goal in understood
        for condition in understood[goal].conditions
    ]
    return replace(plan, conditions=tuple(dict.fromkeys([*plan.conditions, *wanted])))


def _size(plan: Plan, world: WorldModel) -> str:
    tasks, actors = len(plan.tasks), len({task.actor for task in plan.tasks})
    size = f"{tasks} task{'s' * (tasks != 1)}, {actors} actor{'s' * (actors != 1)}"
    return f"{size}, for {' and '.join(world.team) or 'nobody'}"


async def propose(
    call: Call,
    file: FileArgument,
    name: Annotated[
        str | None, typer.Option("--id", help="Name of the plan; else the one in the file.")
    ] = None,
    no_start: Annotated[
        bool, typer.Option("--no-start", help="Do not carry it out; see `plan start`.")
    ] = False,
) -> None:
    """Give the planner a plan of your own: it checks and allocates it like any other."""
    from msgspec.structs import replace

    from cli.client.fleet_view import fleet_view
    from cli.client.names import TakenMeanwhile, put_if_unchanged
    from cli.client.planner_requests import check_planner
    from cli.errors import BadArgument, Refused
    from cli.plans.files import read_plan
    from cli.views.text import outcome
    from keyexpr_schema.ids import check_id
    from keyexpr_schema.keyspace import (
        GOAL_SPEC,
        GOAL_STATUS,
        PLAN_PROPOSAL,
        PLAN_SPEC,
        PLAN_STATUS,
    )
    from keyexpr_schema.payloads.plans import PlanAddress, PlanState

    plan = read_plan(file)
    plan = replace(
        plan,
        plan=check_id(name) if name else plan.plan,
        revision=1,
        autostart=plan.autostart and not no_start,
        proposed_by=call.by,
    )
    if not plan.tasks:
        raise BadArgument(f"{file}: the plan has no tasks")
    of, address = {"plan": plan.plan}, PlanAddress(plan.plan)
    async with call.session() as session:
        await check_planner(session)
        left = await session.get(PLAN_PROPOSAL, address)
        keys = ((PLAN_SPEC, of), (PLAN_STATUS, of), GOAL_SPEC, GOAL_STATUS)
        async with fleet_view(session, *keys) as view:
            if view.plans or view.plan_status:
                raise BadArgument(f"there is a plan {plan.plan} already; give yours another --id")
            # A proposal that no plan was made of may lie there still; one that is new may not.
            try:
                await put_if_unchanged(session, PLAN_PROPOSAL, address, plan, left)
            except TakenMeanwhile:
                raise BadArgument(
                    f"somebody else has just proposed a plan {plan.plan}; give yours another --id"
                ) from None
            await view.until(
                lambda: (
                    plan.plan in view.plan_status
                    and view.plan_status[plan.plan].state is not PlanState.PLANNING
                ),
                PROPOSAL_S,
                f"the planner to check plan {plan.plan} (it is stored)",
            )
            status = view.plan_status[plan.plan]
            taken = view.plans.get(plan.plan, plan)
            goals, goal_status = dict(view.goals), dict(view.goal_status)
    if status.state is PlanState.REJECTED:
        raise Refused(f"plan {plan.plan} is rejected: {outcome(status) or 'no reason given'}")

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.views.plan_tree import plan_tree

        hint = {
            PlanState.PROPOSED: f"; approve it with `robotctl plan approve {plan.plan}`",
            PlanState.READY: f"; start it with `robotctl plan start {plan.plan}`",
        }.get(status.state, "")
        return Group(
            f"plan {plan.plan} is {status.state.value}{hint}",
            plan_tree(taken, status, {}, goals, goal_status),
        )

    call.show({"plan": taken, "status": status}, draw)


async def diff(
    call: Call,
    a: Annotated[str, typer.Argument(metavar="A", help="A plan's name, PLAN@REVISION, or a file.")],
    b: Annotated[str, typer.Argument(metavar="B", help="The same.")],
) -> None:
    """What plan B has that A has not: tasks kept, changed, dropped, added.

    Earlier revisions come from the store's journal. Tasks are the same if they have the same name
    and skill, or else are the same call.
    """
    from cli.plans.comparison import compare
    from cli.plans.sources import finished_tasks, plan_in_file, plan_named

    before, now = plan_in_file(a), plan_in_file(b)
    finished: list[str] = []
    if before is None or now is None:
        async with call.session() as session:
            before = before or await plan_named(session, a)
            now = now or await plan_named(session, b)
            if before.plan.plan == now.plan.plan:
                finished = await finished_tasks(session, now.plan.plan)
    found = compare(before, now, finished)

    def draw() -> RenderableType:
        from cli.views.plans import diff_page

        return diff_page(found)

    call.show(found, draw)
