"""`robotctl goal`: what people want."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, command
from cli.parsing import Group

if TYPE_CHECKING:
    from keyexpr_schema.payloads.goals import Goal, GoalStatus
    from keyexpr_schema.transport.session import Session

UNDERSTANDING_S = 10.0
"""How long the planner may take to say something of a goal."""
READING_S = 180.0
"""How long a language model may take to read a sentence that the grammar refuses."""

app = typer.Typer(cls=Group, no_args_is_help=True, rich_markup_mode=None, add_completion=False)
GoalArgument = Annotated[str, typer.Argument(metavar="GOAL", help="Its name.")]


@app.callback()
def goal() -> None:
    """Say what you want, in a sentence; see what became of it."""


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
    plan: Annotated[
        bool, typer.Option("--plan", help="Have it planned and carried out at once.")
    ] = False,
    wait: Annotated[bool, typer.Option("--wait", help="Return when the goal has ended.")] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout-s", min=0.0, help="Longest time to --wait.")
    ] = 600.0,
) -> None:
    """Want something. The planner says what it understood, or that it did not (exit code 1)."""
    from cli.asking import ask_planner
    from cli.board import following
    from cli.errors import NotRunning, Refused
    from cli.naming import request_name
    from cli.presence import planner_alive
    from cli.show.fleet_tables import GoalRow
    from cli.telling import put_goal
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
    from keyexpr_schema.payloads.requests import PlanRequest

    async with call.session() as session:
        if plan and not await planner_alive(session):
            raise NotRunning(
                "no planner is running, so the goal was not stored; start one with "
                "`robotctl planner`, or leave --plan out"
            )
        spec = await put_goal(session, text, name, priority, within_s)
        if not (wait or plan) and not await planner_alive(session):
            call.show(
                GoalRow(goal=spec.goal, spec=spec, status=None),
                lambda: (
                    f"stored goal {spec.goal}. No planner is running: "
                    "the goal will be read once one runs (`robotctl planner`)"
                ),
            )
            return
        async with following(session, (GOAL_STATUS, {"goal": spec.goal})) as board:
            await board.until(
                lambda: spec.goal in board.goal_status,
                timeout_s if wait else UNDERSTANDING_S,
                f"the planner to read goal {spec.goal} (it is stored)",
            )
            await board.until(
                lambda: board.goal_status[spec.goal].state is not GoalState.READING,
                timeout_s if wait else READING_S,
                f"a language model to read goal {spec.goal} (it is stored)",
            )
            if plan and board.goal_status[spec.goal].state is GoalState.WAITING:
                call.say(sentence(spec, board.goal_status[spec.goal]))
                answer = await ask_planner(
                    session, PlanRequest(request=request_name(), goals=(spec.goal,))
                )
                call.say(answer.sentence)
                await board.until(
                    lambda: board.goal_status[spec.goal].state is not GoalState.WAITING,
                    UNDERSTANDING_S,
                    f"goal {spec.goal} to be planned",
                )
            if wait:
                await board.until(
                    lambda: board.goal_status[spec.goal].state in ENDED_GOALS,
                    timeout_s,
                    f"goal {spec.goal} to end",
                )
            status = board.goal_status[spec.goal]
    if status.state in (GoalState.REJECTED, GoalState.FAILED):
        raise Refused(
            f"goal {spec.goal} {status.state.value}: {status.reason or 'no reason given'}"
        )
    call.show(
        GoalRow(goal=spec.goal, spec=spec, status=status), lambda: sentence(spec, status, plan)
    )


def sentence(spec: Goal, status: GoalStatus, planned: bool = True) -> str:
    """How a goal stands and what it was understood as; how to have it planned, if it is not."""
    from cli.show.words import meaning as meaning_of
    from keyexpr_schema.payloads.goals import GoalState

    means = meaning_of(status)
    meaning = f", understood as {means}" if means else ""
    hint = ""
    if status.state is GoalState.WAITING and not planned:
        hint = f"; plan it with `robotctl plan create big-dag makespan {spec.goal}`"
    note = f" ({status.note})" if status.note else ""
    return f"goal {spec.goal} is {status.state.value}{meaning}{note}{hint}"


@command(app, "list")
async def list_(call: Call) -> None:
    """Every goal and how it stands."""
    from cli.show.fleet_tables import goal_rows, goals_table

    async with call.session() as session:
        rows = goal_rows(*await _all(session))
    call.show(rows, lambda: goals_table(rows) if rows else "No goals.")


@command(app, "show")
async def show(call: Call, goal: GoalArgument) -> None:
    """One goal: its words, what they were understood to mean, how it stands."""
    from cli.errors import check_known
    from cli.show.fleet_tables import GoalRow
    from cli.show.goal_page import goal_page

    async with call.session() as session:
        goals, status = await _all(session)
    check_known("goal", goal, goals, "say one with `robotctl goal add`")
    row = GoalRow(goal=goal, spec=goals[goal], status=status.get(goal))
    call.show(row, lambda: goal_page(row))


@command(app, "delete")
async def delete(call: Call, goal: GoalArgument) -> None:
    """Take a goal back; its plan goes on without it, and ends if it had no other goal."""
    from cli.errors import check_known
    from keyexpr_schema.keyspace import GOAL_SPEC
    from keyexpr_schema.payloads.goals import GoalAddress

    async with call.session() as session:
        goals, _ = await _all(session)
        check_known("goal", goal, goals, "say one with `robotctl goal add`")
        await session.delete(GOAL_SPEC, GoalAddress(goal))
    call.show({"deleted": goal}, lambda: f"deleted goal {goal}")


async def _all(session: Session) -> tuple[dict[str, Goal], dict[str, GoalStatus]]:
    from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS

    goals = {a.goal: spec for a, spec in (await session.list(GOAL_SPEC)).items()}
    status = {a.goal: each for a, each in (await session.list(GOAL_STATUS)).items()}
    return goals, status
