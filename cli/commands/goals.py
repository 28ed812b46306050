"""`robotctl goal`: what people want."""

from __future__ import annotations

from datetime import datetime
from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import AnyGoalsArgument, GoalArgument
from cli.command import Call, command, group
from cli.commands.ended import OlderOption, delete_ended, named
from cli.commands.goal_changes import retry, set_, wait

if TYPE_CHECKING:
    from keyexpr_schema.payloads.goals import GoalStatus

READ_S = 10.0
"""How long the planner may take to say something of a goal."""
MODEL_READ_S = 180.0
"""How long a language model may take to read a sentence that the grammar refuses."""


class MissedTimes(str, Enum):
    """As in `keyexpr_schema.payloads.schedules`, which `--help` does not import."""

    ONCE = "once"
    SKIP = "skip"
    ALL = "all"


class OverlappingTimes(str, Enum):
    """As there."""

    SKIP = "skip"
    QUEUE = "queue"


app = group("Say what you want, in a sentence; see what became of it.")


@command(app, "add")
async def add(
    call: Call,
    text: Annotated[str, typer.Argument(metavar="TEXT", help="What you want, in a sentence.")],
    name: Annotated[
        str | None, typer.Option("--id", help="Name of the goal; else made from its words.")
    ] = None,
    priority: Annotated[int, typer.Option("--priority", help="Higher goes first.")] = 0,
    within_s: Annotated[
        float | None,
        typer.Option(
            "--within-s",
            min=0.0,
            metavar="SECONDS",
            help="When it should be done, from now; plans keep to that if they can.",
        ),
    ] = None,
    due: Annotated[
        str | None,
        typer.Option("--due", metavar="TIME", help="The same, said as 17:00, 20min, 8h."),
    ] = None,
    speaker: Annotated[
        str | None,
        typer.Option(
            "--speaker", metavar="PERSON", help='Who says it, of the people in the world: "me".'
        ),
    ] = None,
    always: Annotated[
        list[str] | None,
        typer.Option("--always", metavar="CONDITION", help="What must hold till then; repeatable."),
    ] = None,
    never: Annotated[
        list[str] | None,
        typer.Option("--never", metavar="CONDITION", help="What must not hold; repeatable."),
    ] = None,
    before: Annotated[
        list[str] | None,
        typer.Option(
            "--before",
            metavar="'CONDITION before CONDITION'",
            help="What must have held before something else may; repeatable.",
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="TIME", help="Not before then: 17:00, 2026-11-28T17:00."),
    ] = None,
    in_: Annotated[
        str | None, typer.Option("--in", metavar="SPAN", help="Not before so long: 90s, 2h.")
    ] = None,
    every: Annotated[
        str | None,
        typer.Option(
            "--every", metavar="TIMES", help="A schedule: a line of cron, or a span as 2h, PT2H."
        ),
    ] = None,
    zone: Annotated[
        str | None,
        typer.Option("--zone", metavar="ZONE", help="Of times of day; else this host's."),
    ] = None,
    missed: Annotated[
        MissedTimes | None,
        typer.Option("--missed", help="Times of a schedule that nobody was there for; else once."),
    ] = None,
    overlap: Annotated[
        OverlappingTimes | None,
        typer.Option("--overlap", help="Times at which the run before goes on; else skip."),
    ] = None,
    when: Annotated[
        list[str] | None,
        typer.Option("--when", metavar="CONDITION", help="Wait until it holds; repeatable."),
    ] = None,
    whenever: Annotated[
        list[str] | None,
        typer.Option(
            "--whenever", metavar="CONDITION", help="Each time that it comes to hold; repeatable."
        ),
    ] = None,
    only_if: Annotated[
        list[str] | None,
        typer.Option("--if", metavar="CONDITION", help="Only if it holds then; repeatable."),
    ] = None,
    by: Annotated[
        list[str] | None,
        typer.Option(
            "--by",
            metavar="ROBOT",
            help="Who alone shall do it; repeatable.",
            autocompletion=completion.robots,
        ),
    ] = None,
    plan: Annotated[
        bool, typer.Option("--plan", help="Have it planned and carried out at once.")
    ] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Return when the goal has ended, or stands.")
    ] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout-s", min=0.0, help="Longest time to --wait.")
    ] = 600.0,
) -> None:
    """Want something. The planner says what it understood, or that it did not (exit code 1)."""
    from cli.client.fleet_view import fleet_view
    from cli.client.planner_requests import (
        ask_planner,
        have_planned,
        request_name,
        waits_unplanned,
    )
    from cli.client.presence import planner_alive
    from cli.client.publish import Later, Repeats, answer_goal, put_goal
    from cli.errors import BadArgument, NotRunning, Refused
    from cli.plans.worlds import parse_condition, parse_precedence
    from cli.times import parse_every, parse_span, parse_until, zone_said
    from cli.views.goals import GoalRow, goal_sentence
    from cli.views.text import refusal
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import GoalState
    from keyexpr_schema.payloads.requests import PlanRequest
    from keyexpr_schema.payloads.schedules import Missed, Overlap

    if at is not None and in_ is not None:
        raise BadArgument("say either --at or --in")
    if within_s is not None and due is not None:
        raise BadArgument("say either --within-s or --due")
    clocks = zone_said(zone)
    now = datetime.now(clocks).astimezone(clocks)
    in_s = None if in_ is None else parse_span(in_, "--in")
    within_s = within_s if due is None else parse_until(due, "--due", now)
    repeated = every is not None or missed is not None or overlap is not None
    repeats = None
    if repeated:
        kept_times = Missed.ONCE if missed is None else Missed(missed.value)
        repeats = Repeats(kept_times, Overlap(overlap.value) if overlap else Overlap.SKIP)
    every = None if every is None else parse_every(every, "--every", now)
    async with call.session() as session:
        if plan and not await planner_alive(session):
            raise NotRunning(
                "no planner is running, so the goal was not stored; start one with "
                "`robotctl planner`, or leave --plan out"
            )
        kept, avoided = ([parse_condition(row) for row in rows or ()] for rows in (always, never))
        in_order = [parse_precedence(row) for row in before or ()]
        later = Later(
            in_s if at is None else parse_until(at, "--at", now),
            every,
            tuple(parse_condition(row) for row in when or ()),
            tuple(parse_condition(row) for row in only_if or ()),
            tuple(by or ()),
            tuple(parse_condition(row) for row in whenever or ()),
            None if clocks is None else clocks.key,
            repeats,
        )
        spec = await put_goal(
            session,
            text,
            name,
            priority,
            within_s,
            speaker,
            kept,
            avoided,
            in_order,
            later,
            call.by,
        )
        if not (wait or plan) and not await planner_alive(session):
            call.show(
                GoalRow(goal=spec.goal, spec=spec, status=None),
                lambda: (
                    f"stored goal {spec.goal}. No planner is running: "
                    "the goal will be read once one runs (`robotctl planner`)"
                ),
            )
            return
        async with fleet_view(session, (GOAL_STATUS, {"goal": spec.goal})) as view:
            longest_s = (timeout_s, timeout_s) if wait else (READ_S, MODEL_READ_S)
            what = f"goal {spec.goal} (it is stored)"
            await view.until_read((spec.goal,), what, *longest_s)
            asked = view.goal_status[spec.goal]
            if asked.candidates and call.interactive and (said := _asked_back(asked)):
                spec = await answer_goal(session, spec, asked, said, call.by)
                await view.until(lambda: not view.goal_status[spec.goal].candidates, READ_S, what)
            parts = view.goal_status[spec.goal].parts
            if parts and plan:
                known = (await session.list(GOAL_STATUS)).values()
                left = {each.goal for each in known if waits_unplanned(each)}
                if left.intersection(parts):
                    asks = PlanRequest(request=request_name(), goals=(spec.goal,), by=call.by)
                    call.inform((await ask_planner(session, asks)).sentence)
            if plan and view.goal_status[spec.goal].state is GoalState.WAITING:
                call.inform(goal_sentence(spec, view.goal_status[spec.goal]))
                call.inform(await have_planned(session, view, (spec.goal,), call.by))
            if wait:
                await view.until(
                    lambda: view.ended((spec.goal,)) or view.stands(spec.goal),
                    timeout_s,
                    f"goal {spec.goal} to end",
                )
            status = view.goal_status[spec.goal]
    if status.state in (GoalState.REJECTED, GoalState.FAILED):
        if status.candidates and call.json:
            call.show(GoalRow(goal=spec.goal, spec=spec, status=status), lambda: "")
        raise Refused(refusal(status))
    call.show(
        GoalRow(goal=spec.goal, spec=spec, status=status), lambda: goal_sentence(spec, status, plan)
    )


def _asked_back(status: GoalStatus) -> str:
    """What somebody at the terminal says to what a goal's sentence can mean; nothing: not that."""
    if status.paraphrase is not None and not status.candidates[1:]:
        typer.echo(f"  a language model says it as “{status.paraphrase}”", err=True)
        typer.echo(f"  understood as {status.candidates[0]}", err=True)
        if status.teaches is not None:
            typer.echo("  as a task, to be kept with `robotctl task keep`:", err=True)
            typer.echo(status.teaches.rstrip(), err=True)
        return "1" if typer.confirm("Is that meant", err=True) else ""
    for number, words in enumerate(status.candidates, 1):
        typer.echo(f"  {number}  {words}", err=True)
    said: str = typer.prompt("It can mean each of these; which", err=True)
    return said


@command(app, "answer")
async def answer(
    call: Call,
    goal: GoalArgument,
    which: Annotated[
        str,
        typer.Argument(metavar="WHICH", help="Its number in what it can mean, its words, or yes."),
    ],
) -> None:
    """Say which of several things a goal's sentence means (`goal show` lists them), or that it
    means what a language model has made of it.
    """
    from cli.client.fleet_view import fleet_view
    from cli.client.planner_requests import check_planner
    from cli.client.publish import answer_goal, put_goals
    from cli.errors import Refused, check_known
    from cli.views.goals import GoalRow, goal_sentence
    from cli.views.text import refusal
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import GoalState

    async with call.session() as session:
        await check_planner(session)
        known = await put_goals(session)
        check_known("goal", goal, known)
        async with fleet_view(session, (GOAL_STATUS, {"goal": goal})) as view:
            await view.until_read((goal,), f"goal {goal}", READ_S, MODEL_READ_S)
            spec = await answer_goal(session, known[goal], view.goal_status[goal], which, call.by)
            await view.until(
                lambda: not view.goal_status[goal].candidates, READ_S, f"goal {goal} to be read"
            )
            status = view.goal_status[goal]
    if status.state is GoalState.REJECTED:
        raise Refused(refusal(status))
    call.show(
        GoalRow(goal=goal, spec=spec, status=status), lambda: goal_sentence(spec, status, False)
    )


@command(app, "list")
async def list_(call: Call) -> None:
    """Every goal and how it stands."""
    from cli.client.fleet_view import snapshot
    from cli.views.goals import goal_rows, goals_table
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC

    async with call.session() as session:
        view = await snapshot(session, GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC)
    rows = goal_rows(view.wanted, view.goal_status)
    call.show(rows, lambda: goals_table(rows) if rows else "No goals.")


@command(app, "show")
async def show(call: Call, goal: GoalArgument) -> None:
    """One goal: its words, what they were understood to mean, how it stands."""
    from cli.client.fleet_view import snapshot
    from cli.client.history import check_not_deleted
    from cli.errors import check_known
    from cli.views.goals import goal_page, goal_row
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC

    async with call.session() as session:
        view = await snapshot(session, GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC)
        own = (name for name, status in view.goal_status.items() if status.own)
        known = {*view.wanted, *view.runs(), *own}
        if goal not in known:
            await check_not_deleted(session, goal)
    check_known("goal", goal, known)
    row = goal_row(goal, view.wanted, view.goal_status)
    call.show(row, lambda: goal_page(row))


command(app, "retry")(retry)
command(app, "set")(set_)
command(app, "wait")(wait)


@command(app, "delete")
async def delete(
    call: Call,
    goals: AnyGoalsArgument = None,
    ended: Annotated[
        bool, typer.Option("--ended", help="All that were reached, failed or rejected.")
    ] = False,
    older_than: OlderOption = None,
) -> None:
    """Take goals back; their plans go on without them, and end if they had no other goal.

    With --ended, delete the keys of those that are over; `history` keeps them.
    """
    from cli.client.schedules import delete_goals

    names = named("goal", goals, ended, older_than)
    if not names:
        await delete_ended(call, older_than, goals=True)
        return
    async with call.session() as session:
        await delete_goals(session, names)
    call.show({"deleted": names}, lambda: "\n".join(f"deleted goal {goal}" for goal in names))
