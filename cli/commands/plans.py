"""`robotctl plan`, `robotctl replan`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, command
from cli.commands.plan_files import check, diff, propose
from cli.parsing import FactWords, Group

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.payloads.goals import Goal, GoalStatus
    from keyexpr_schema.payloads.plans import PlanStatus
    from keyexpr_schema.payloads.requests import Control
    from keyexpr_schema.transport.session import Session

app = typer.Typer(cls=Group, no_args_is_help=True, rich_markup_mode=None, add_completion=False)
replan_app = typer.Typer(rich_markup_mode=None, add_completion=False)
PlanArgument = Annotated[str, typer.Argument(metavar="PLAN", help="Its name.")]
HOW_TO_PLAN = "make one with `robotctl plan create`"


@app.callback()
def plan() -> None:
    """Make, look at, check, compare, start and cancel plans."""


@command(app, "create")
async def create(
    call: Call,
    strategy: Annotated[
        str, typer.Argument(metavar="[STRATEGY]", help="How goals come together.")
    ] = "big-dag",
    allocator: Annotated[
        str, typer.Argument(metavar="[ALLOCATOR]", help="Who chooses the robots.")
    ] = "makespan",
    goals: Annotated[
        list[str] | None,
        typer.Argument(metavar="GOAL", help="Which goals; else every goal that waits."),
    ] = None,
    planner: Annotated[str, typer.Option("--planner", help="Who plans.")] = "symbolic",
    name: Annotated[str | None, typer.Option("--id", help="Name of the plan.")] = None,
    no_start: Annotated[
        bool, typer.Option("--no-start", help="Do not carry it out; see `plan start`.")
    ] = False,
    fallback: Annotated[
        bool,
        typer.Option(
            "--fallback-round-robin", help="With milp: where it finds nothing, take turns instead."
        ),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only show the plan; leave nothing behind.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="With --dry-run: write the plan as YAML or JSON, to edit, check and propose.",
        ),
    ] = None,
) -> None:
    """Have goals turned into a plan and, unless told otherwise, carried out."""
    from cli.asking import ask_planner
    from cli.errors import BadArgument, check_known
    from cli.naming import request_name
    from cli.plans.files import check_suffix, write_plan
    from cli.telling import planner_status
    from keyexpr_schema.ids import check_id
    from keyexpr_schema.keyspace import GOAL_SPEC
    from keyexpr_schema.payloads.requests import PlanRequest

    if fallback and allocator != "milp":
        raise BadArgument("--fallback-round-robin goes with the allocator milp")
    allocator = "milp-or-round-robin" if fallback else allocator
    if out is not None and not dry_run:
        raise BadArgument("--out goes with --dry-run; see a plan that was made with `plan show`")
    if out is not None:
        check_suffix(out)
    if name is not None:
        check_id(name, "plan")
    async with call.session() as session:
        known = [address.goal for address in await session.list(GOAL_SPEC)]
        for goal in goals or ():
            check_known("goal", goal, known, "say one with `robotctl goal add`")
        can = await planner_status(session)
        if can is not None:
            # A planner that lists nothing has not said what it offers; then its answer decides.
            for what, asked, offered in (
                ("strategy", strategy, can.strategies),
                ("allocator", allocator, can.allocators),
                ("planner", planner, can.planners),
            ):
                if offered:
                    check_known(what, asked, offered, "")
        answer = await ask_planner(
            session,
            PlanRequest(
                request=request_name(),
                plan=name,
                goals=tuple(dict.fromkeys(goals or ())),
                strategy=strategy,
                planner=planner,
                allocator=allocator,
                start=not no_start,
                dry_run=dry_run,
            ),
        )
        if dry_run:
            specs, status = await _goals(session)
    if answer.preview is not None and out is not None:
        write_plan(out, answer.preview)
        call.warn(f"wrote the plan to {out}")

    def draw() -> RenderableType:
        if answer.preview is None:
            return answer.sentence
        from rich.console import Group

        from cli.show.plan_page import plan_page

        page = plan_page(answer.preview, answer.preview_status, {}, specs, status)
        return Group(answer.sentence, "", page)

    call.show(answer, draw)


@command(app, "list")
async def list_(call: Call) -> None:
    """Every plan and how it stands."""
    from cli.board import following
    from cli.show.fleet_tables import plans_table
    from keyexpr_schema.keyspace import PLAN_SPEC, PLAN_STATUS

    async with call.session() as session, following(session, PLAN_SPEC, PLAN_STATUS) as board:
        plans, status = board.plans, board.plan_status
    names = sorted(set(plans) | set(status))
    call.show(
        [{"plan": name, "spec": plans.get(name), "status": status.get(name)} for name in names],
        lambda: plans_table(plans, status) if names else "No plans.",
    )


@command(app, "show")
async def show(
    call: Call,
    plan: Annotated[
        str | None, typer.Argument(metavar="PLAN", help="Its name; else the latest plan.")
    ] = None,
    dot: Annotated[
        bool, typer.Option("--dot", help="Only the graph, in Graphviz' language (`| dot -Tsvg`).")
    ] = False,
    analyze_idle: Annotated[
        bool,
        typer.Option("--analyze-idle", help="How long robots stand idle, predicted and measured."),
    ] = False,
) -> None:
    """One plan: its tasks and who does them, what waits for what, how it was made and changed."""
    from cli.board import FLEET, following
    from cli.errors import BadArgument, Unknown, check_known
    from cli.plans.idle import idle_report
    from cli.show.idle_page import idle_page

    if dot and call.json:
        raise BadArgument("--dot and --json are two forms of the same: choose one")
    if dot and analyze_idle:
        raise BadArgument("--dot draws only the graph; --analyze-idle does not go with it")

    async with call.session() as session, following(session, *FLEET) as board:
        pass
    names = set(board.plans) | set(board.plan_status)
    if plan is None:
        if not names:
            raise Unknown(f"there is no plan yet; {HOW_TO_PLAN}")
        plan = max(names, key=lambda n: (board.changed_s(n), n))
    check_known("plan", plan, names, HOW_TO_PLAN)
    name = plan
    records = {task: record for (of, task), record in board.tasks.items() if of == name}
    spec, status = board.plans.get(name), board.plan_status.get(name)
    idle = idle_report(spec, status, records.values(), board.specs.values()) if spec else None

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.show.fleet_tables import plans_table
        from cli.show.plan_graph import plan_dot
        from cli.show.plan_page import plan_page, violations_table

        if spec is None and dot:
            raise Unknown(f"plan {name} has no tasks to draw: it is {_state(status)}")
        if spec is None:
            table = plans_table({}, {name: status} if status else {})
            if status is None or not status.violations:
                return table
            return Group(table, "", violations_table(status.violations))
        if dot:
            return plan_dot(spec, status, records)
        page = plan_page(spec, status, records, board.goals, board.goal_status, board.now_s)
        return Group(page, "", idle_page(idle)) if analyze_idle and idle else page

    told = {"plan": spec, "status": status, "tasks": list(records.values())}
    call.show({**told, "idle": idle} if analyze_idle else told, draw)


command(app, "check", FactWords)(check)
command(app, "propose")(propose)
command(app, "diff")(diff)


@command(app, "start")
async def start(call: Call, plan: PlanArgument) -> None:
    """Carry out a plan that was made with --no-start."""
    from keyexpr_schema.payloads.requests import Control

    await _control(call, Control.START, plan)


@command(app, "approve")
async def approve(call: Call, plan: PlanArgument) -> None:
    """Let a plan be carried out that waits for a person (`robotctl planner --approval`)."""
    from keyexpr_schema.payloads.requests import Control

    await _control(call, Control.APPROVE, plan)


@command(app, "cancel")
async def cancel(call: Call, plan: PlanArgument) -> None:
    """Stop a plan: running tasks are told to stop, no further one begins."""
    from keyexpr_schema.payloads.requests import Control

    await _control(call, Control.CANCEL, plan)


@command(app, "delete")
async def delete(call: Call, plan: PlanArgument) -> None:
    """Forget a plan and its tasks."""
    from keyexpr_schema.payloads.requests import Control

    await _control(call, Control.DELETE, plan)


@command(replan_app, "replan")
async def replan(
    call: Call,
    plan: PlanArgument,
    reason: Annotated[
        str, typer.Option("--reason", help="Why; it is shown with the plan.")
    ] = "a person asked for it",
    goals: Annotated[
        list[str] | None,
        typer.Option("--goal", metavar="GOAL", help="Take this goal in, too; repeatable."),
    ] = None,
) -> None:
    """Plan again from what is known now; what is done or running is kept."""
    from cli.asking import ask_planner
    from cli.errors import check_known
    from cli.naming import request_name
    from keyexpr_schema.keyspace import GOAL_SPEC
    from keyexpr_schema.payloads.requests import ReplanRequest

    async with call.session() as session:
        await check_plan(session, plan)
        known = [address.goal for address in await session.list(GOAL_SPEC)]
        for goal in goals or ():
            check_known("goal", goal, known, "say one with `robotctl goal add`")
        answer = await ask_planner(
            session,
            ReplanRequest(
                request=request_name(), plan=plan, reason=reason, goals=tuple(goals or ())
            ),
        )
    call.show(answer, lambda: answer.sentence)


async def _goals(session: Session) -> tuple[dict[str, Goal], dict[str, GoalStatus]]:
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS

    specs = {a.goal: spec for a, spec in (await session.list(GOAL_SPEC)).items()}
    return specs, {a.goal: each for a, each in (await session.list(GOAL_STATUS)).items()}


def _state(status: PlanStatus | None) -> str:
    return status.state.value if status else "not there"


async def check_plan(session: Session, plan: str) -> None:
    """Raise `Unknown` unless there is a plan of that name."""
    from cli.errors import check_known
    from keyexpr_schema.keyspace import PLAN_SPEC, PLAN_STATUS

    known = {address.plan for address in await session.list(PLAN_SPEC)}
    known |= {address.plan for address in await session.list(PLAN_STATUS)}
    check_known("plan", plan, known, HOW_TO_PLAN)


async def _control(call: Call, control: Control, plan: str) -> None:
    from cli.asking import ask_planner
    from cli.naming import request_name
    from keyexpr_schema.keyspace import PLAN_PROPOSAL
    from keyexpr_schema.payloads.plans import PlanAddress
    from keyexpr_schema.payloads.requests import Control, ControlRequest

    async with call.session() as session:
        await check_plan(session, plan)
        if control is Control.DELETE:
            # First: a proposal that still stands when a planner starts is taken up.
            await session.delete(PLAN_PROPOSAL, PlanAddress(plan))
        answer = await ask_planner(
            session, ControlRequest(request=request_name(), control=control, plan=plan)
        )
    call.show(answer, lambda: answer.sentence)
