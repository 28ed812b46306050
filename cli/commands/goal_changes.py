"""`robotctl goal retry`, `goal set`, `goal wait`: once more, sooner, to the end."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.arguments import GoalsArgument
from cli.command import Call

READ_S = 10.0
"""How long the planner may take to say something of a goal."""


async def retry(
    call: Call,
    goals: GoalsArgument,
    plan: Annotated[
        bool, typer.Option("--plan/--no-plan", help="Have them planned and carried out at once.")
    ] = True,
) -> None:
    """Want goals again that have failed: they are planned anew, from what is so now."""
    from cli.client.fleet_view import fleet_view
    from cli.client.goal_changes import check_failed, goals_named, want_again
    from cli.client.planner_requests import check_planner, have_planned
    from cli.errors import Refused
    from cli.views.goals import goal_rows
    from cli.views.text import refusal
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import GoalState

    names = tuple(dict.fromkeys(goals))
    async with call.session() as session:
        await check_planner(session)
        specs, before = await goals_named(session, names, own=True)
        check_failed(names, before)
        await want_again(session, specs, before, call.by)
        async with fleet_view(session, GOAL_STATUS) as view:

            def read(name: str) -> bool:
                now = view.goal_status.get(name)
                return now is not None and now != before[name]

            what = f"{', '.join(names)} to be read again"
            await view.until(lambda: all(map(read, names)), READ_S, what)
            waiting = tuple(n for n in names if view.goal_status[n].state is GoalState.WAITING)
            if plan and waiting:
                call.inform(await have_planned(session, view, waiting, call.by))
            status = dict(view.goal_status)
    for name in names:
        if status[name].state is GoalState.REJECTED:
            raise Refused(refusal(status[name]))
    call.show(
        goal_rows(specs, status),
        lambda: "\n".join(f"goal {name} is wanted again" for name in names),
    )


async def set_(
    call: Call,
    goals: GoalsArgument,
    priority: Annotated[int | None, typer.Option("--priority", help="Higher goes first.")] = None,
    due: Annotated[
        str | None,
        typer.Option("--due", metavar="TIME", help="When to be done: 17:00, 20min, or none."),
    ] = None,
) -> None:
    """Make goals more or less urgent; what goes on stays as it is.

    Robots go by a new priority from their next task on, and plans by a new time when they are made
    again (`robotctl replan` does that at once).
    """

    from cli.client.goal_changes import check_open, goals_named, set_urgency
    from cli.errors import BadArgument
    from cli.times import now_here, parse_until, span_said, until_said
    from cli.views.goals import goal_rows

    if priority is None and due is None:
        raise BadArgument("say --priority N, or --due TIME, or both")
    never = due == "none"
    now = now_here()
    in_s = None if due is None or never else parse_until(due, "--due", now)
    names = tuple(dict.fromkeys(goals))
    async with call.session() as session:
        specs, status = await goals_named(session, names)
        check_open(names, status)
        schedules = await set_urgency(session, specs, call.by, priority, in_s, never)
        specs, status = await goals_named(session, names)

    def words(name: str) -> str:
        said = [f"has priority {priority}"] if priority is not None else []
        if never:
            said.append("is due at no time")
        elif due is not None and in_s is not None:
            once = f"is due {until_said(due, in_s, now)}"
            of_runs = f"its runs are due {span_said(in_s)} after they begin"
            said.append(of_runs if name in schedules else once)
        return f"goal {name} {' and '.join(said)}"

    call.show(goal_rows(specs, status), lambda: "\n".join(map(words, names)))


async def wait(
    call: Call,
    goals: GoalsArgument,
    timeout_s: Annotated[float, typer.Option("--timeout-s", min=0.0, help="Longest time.")] = 600.0,
) -> None:
    """Return when goals have ended, or stand until they are deleted; exit code 1 if one failed."""
    from cli.client.fleet_view import fleet_view
    from cli.client.planner_requests import asked_for_no_plan
    from cli.client.presence import planner_alive
    from cli.errors import Refused, check_known
    from cli.views.goals import goal_row
    from cli.views.text import refusal
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC
    from keyexpr_schema.payloads.goals import GoalState

    names = tuple(dict.fromkeys(goals))
    async with (
        call.session() as session,
        fleet_view(session, GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC) as view,
    ):
        for name in names:
            check_known("goal", name, {**view.wanted, **view.goal_status})

        said = frozenset(view.wanted)  # not runs of schedules, nor what the planner wants itself

        def gone(name: str) -> bool:
            wanted = name in view.wanted
            return not wanted and (name in said or name not in view.goal_status)

        def over(name: str) -> bool:
            return view.ended((name,)) or view.stands(name) or gone(name)

        told: set[str] = set()

        def tell_unplanned() -> None:
            """Once of each goal that nobody plans: it would be waited for in silence."""
            for name in names:
                known = view.goal_status.get(name)
                unplanned = known is not None and asked_for_no_plan(known)
                if unplanned and name not in told:
                    told.add(name)
                    call.warn(f"goal {name} waits, and nobody has asked for a plan (`plan create`)")

        def all_over() -> bool:
            tell_unplanned()
            return all(map(over, names))

        if not all(map(over, names)) and not await planner_alive(session):
            call.warn("no planner is running; start one with `robotctl planner`")
        what = f"{', '.join(names)} to end (`robotctl why` tells what for)"
        await view.until(all_over, timeout_s, what)
        wanted, status = dict(view.wanted), dict(view.goal_status)
        deleted = [name for name in names if gone(name)]
    if deleted:
        raise Refused(f"goal {deleted[0]} was deleted meanwhile")
    for name in names:
        known = status[name]
        if known.state in (GoalState.FAILED, GoalState.REJECTED):
            raise Refused(refusal(known))
    call.show(
        [goal_row(name, wanted, status) for name in names],
        lambda: "\n".join(f"goal {name} is {status[name].state.value}" for name in names),
    )
