"""`robotctl plan`, `robotctl replan`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import (
    AnyPlanArgument,
    GoalsOption,
    PlanArgument,
    PlansArgument,
    WhyOption,
    one_line,
)
from cli.command import Call, command, group, single
from cli.command_line import FactWords
from cli.commands.ended import OlderOption, delete_ended, named
from cli.commands.plan_files import check, diff, propose

if TYPE_CHECKING:
    from rich.console import RenderableType

app = group("Make, look at, check, compare, start and cancel plans.")
ProgramsOption = Annotated[
    bool, typer.Option("--programs", help="Robots carry out programs of several calls.")
]


@command(app, "create")
async def create(
    call: Call,
    strategy: Annotated[
        str,
        typer.Argument(
            metavar="STRATEGY",
            help="How goals come together.",
            autocompletion=completion.strategies,
        ),
    ] = "big-dag",
    allocator: Annotated[
        str,
        typer.Argument(
            metavar="ALLOCATOR",
            help="Who chooses the robots.",
            autocompletion=completion.allocators,
        ),
    ] = "makespan",
    goals: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="GOAL",
            help="Which goals; else every goal that waits.",
            autocompletion=completion.goals,
        ),
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
    programs: ProgramsOption = False,
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
    from cli.client.fleet_view import FleetView, snapshot
    from cli.client.planner_requests import acting_planner, ask_planner, check_goals, request_name
    from cli.errors import BadArgument, check_known
    from cli.plans.files import check_suffix, write_plan
    from keyexpr_schema.ids import check_id
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS
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
        await check_goals(session, goals or ())
        can = await acting_planner(session)
        if can is not None:
            # A planner that lists nothing has not said what it offers; then its answer decides.
            for what, asked, offered in (
                ("strategy", strategy, can.strategies),
                ("allocator", allocator, can.allocators),
                ("planner", planner, can.planners),
            ):
                if offered:
                    check_known(what, asked, offered)
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
                programs=programs,
                by=call.by,
            ),
        )
        view = await snapshot(session, GOAL_SPEC, GOAL_STATUS) if dry_run else FleetView()
    if answer.preview is not None and out is not None:
        write_plan(out, answer.preview)
        call.warn(f"wrote the plan to {out}")

    def draw() -> RenderableType:
        if answer.preview is None:
            return answer.sentence
        from rich.console import Group

        from cli.views.plans import plan_page

        preview, status = answer.preview, answer.preview_status
        return Group(
            answer.sentence, "", plan_page(preview, status, {}, view.goals, view.goal_status)
        )

    call.show(answer, draw)


@command(app, "list")
async def list_(call: Call) -> None:
    """Every plan and how it stands."""
    from cli.client.fleet_view import snapshot
    from cli.views.plans import plans_table
    from keyexpr_schema.keyspace import PLAN_SPEC, PLAN_STATUS

    async with call.session() as session:
        view = await snapshot(session, PLAN_SPEC, PLAN_STATUS)
    plans, status = view.plans, view.plan_status
    names = sorted(set(plans) | set(status))
    call.show(
        [{"plan": name, "spec": plans.get(name), "status": status.get(name)} for name in names],
        lambda: plans_table(plans, status) if names else "No plans.",
    )


@command(app, "show")
async def show(
    call: Call,
    plan: AnyPlanArgument = None,
    dot: Annotated[
        bool, typer.Option("--dot", help="Only the graph, in Graphviz' language (`| dot -Tsvg`).")
    ] = False,
    analyze_idle: Annotated[
        bool,
        typer.Option("--analyze-idle", help="How long robots stand idle, predicted and measured."),
    ] = False,
) -> None:
    """One plan: its tasks and who does them, what waits for what, how it was made and changed.

    Where none is named it is the latest.
    """
    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.errors import HOW_TO_ADD, OVER, BadArgument, Unknown, check_known
    from cli.plans.idle import idle_report
    from cli.views.idle_time import idle_page

    if dot and call.json:
        raise BadArgument("--dot and --json are two forms of the same: choose one")
    if dot and analyze_idle:
        raise BadArgument("--dot draws only the graph; --analyze-idle does not go with it")

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS)
    names = set(view.plans) | set(view.plan_status)
    if plan is None:
        if not names:
            raise Unknown(f"there is no plan yet; {HOW_TO_ADD['plan']}; {OVER}")
        plan = max(names, key=lambda n: (view.changed_s(n), n))
    check_known("plan", plan, names)
    name = plan
    records = view.records(name)
    spec, status = view.plans.get(name), view.plan_status.get(name)
    idle = idle_report(spec, status, records.values(), view.robot_specs.values()) if spec else None

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.views.plan_graph import plan_dot
        from cli.views.plans import plan_page, plans_table, violations_table

        if spec is None and dot:
            state = status.state.value if status else "not there"
            raise Unknown(f"plan {name} has no tasks to draw: it is {state}")
        if spec is None:
            table = plans_table({}, {name: status} if status else {})
            if status is None or not status.violations:
                return table
            return Group(table, "", violations_table(status.violations))
        if dot:
            return plan_dot(spec, status, records)
        page = plan_page(spec, status, records, view.goals, view.goal_status, view.now_s)
        return Group(page, "", idle_page(idle)) if analyze_idle and idle else page

    data = {"plan": spec, "status": status, "tasks": list(records.values())}
    call.show({**data, "idle": idle} if analyze_idle else data, draw)


command(app, "check", FactWords)(check)
command(app, "propose")(propose)
command(app, "diff")(diff)


@command(app, "start")
async def start(call: Call, plan: PlanArgument) -> None:
    """Carry out a plan that was made with --no-start."""
    await _control(call, "start", plan)


@command(app, "approve")
async def approve(call: Call, plan: PlanArgument) -> None:
    """Let a plan be carried out that waits for a person (`robotctl planner --approval`)."""
    await _control(call, "approve", plan)


@command(app, "cancel")
async def cancel(call: Call, plan: PlanArgument, why: WhyOption = "") -> None:
    """Stop a plan: running tasks are told to stop, no further one begins."""
    await _control(call, "cancel", plan, why=why)


@command(app, "delete")
async def delete(
    call: Call,
    plans: PlansArgument = None,
    ended: Annotated[
        bool, typer.Option("--ended", help="All that have ended, with the goals they ended.")
    ] = False,
    older_than: OlderOption = None,
) -> None:
    """Delete the keys of plans, with their tasks and reports; `history` keeps what ended."""
    names = named("plan", plans, ended, older_than)
    if not names:
        await delete_ended(call, older_than, plans=True)
        return
    await _control(call, "delete", *names)


@single
async def replan(
    call: Call,
    plan: PlanArgument,
    reason: Annotated[
        str, typer.Option("--reason", help="Why; it is shown with the plan.", callback=one_line)
    ] = "a person asked for it",
    goals: GoalsOption = None,
) -> None:
    """Plan again from what is known now; what is done or running is kept."""
    from cli.client.planner_requests import ask_planner, check_goals, check_plan, request_name
    from keyexpr_schema.payloads.requests import ReplanRequest

    async with call.session() as session:
        await check_plan(session, plan)
        await check_goals(session, goals or ())
        answer = await ask_planner(
            session,
            ReplanRequest(
                request=request_name(),
                plan=plan,
                reason=reason,
                goals=tuple(goals or ()),
                by=call.by,
            ),
        )
    call.show(answer, lambda: answer.sentence)


async def _control(call: Call, control: str, *plans: str, why: str = "") -> None:
    from cli.client.planner_requests import ask_planner, check_plan, request_name
    from keyexpr_schema.keyspace import PLAN_PROPOSAL
    from keyexpr_schema.payloads.plans import PlanAddress
    from keyexpr_schema.payloads.requests import Control, ControlRequest

    answers = []
    async with call.session() as session:
        for plan in plans:
            await check_plan(session, plan)
        for plan in plans:
            if Control(control) is Control.DELETE:
                # First: a proposal that still stands when a planner starts is taken up.
                await session.delete(PLAN_PROPOSAL, PlanAddress(plan))
            request = ControlRequest(
                request=request_name(),
                control=Control(control),
                plan=plan,
                by=call.by,
                reason=why,
            )
            answers.append(await ask_planner(session, request))
    call.show(
        answers[0] if len(plans) == 1 else answers,
        lambda: "\n".join(answer.sentence for answer in answers),
    )
