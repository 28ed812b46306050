"""`robotctl ask`: questions, answered from what is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, single

if TYPE_CHECKING:
    from keyexpr_schema.payloads.questions import QuestionQuery, QuestionReply
    from keyexpr_schema.transport.session import Session

ANSWER_S = 10.0


@single
async def ask(
    call: Call,
    text: Annotated[str, typer.Argument(metavar="TEXT", help="The question, in a sentence.")],
    speaker: Annotated[
        str | None,
        typer.Option(
            "--speaker", metavar="PERSON", help='Who asks, of the people in the world: "my".'
        ),
    ] = None,
    look: Annotated[
        bool, typer.Option("--look", help="Have somebody look, where nobody knows, and wait.")
    ] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout-s", min=0.0, help="Longest time to --look.")
    ] = 600.0,
) -> None:
    """Ask where something is, how many there are, whether something is so, who does what.

    The answer says who told it, and how long ago. What nobody knows is said so, with the goal that
    would find out; with --look, or if you say yes at a terminal, somebody does, and it is answered
    then. A question that is not understood is refused (exit code 1).
    """
    from cli.errors import Refused
    from keyexpr_schema.payloads.questions import QuestionQuery

    query = QuestionQuery(text=text, speaker=speaker)
    async with call.session() as session:
        reply = await _answer(session, query)
        if reply.answer is None:
            if call.json:
                call.show(reply, lambda: "")
            raise Refused(reply.reason or "the question was not understood")
        if reply.offer is not None and (look or (call.interactive and _shall_look(reply))):
            await _find_out(call, session, reply.offer, timeout_s)
            reply = await _answer(session, query)
    call.show(reply, lambda: _words(reply))


async def _answer(session: Session, query: QuestionQuery) -> QuestionReply:
    from cli.client.presence import planner_alive
    from cli.errors import NotRunning
    from keyexpr_schema.errors import NoReply
    from keyexpr_schema.keyspace import QUESTION
    from keyexpr_schema.payloads.system import PlannerAddress

    try:
        reply: QuestionReply = await session.query(QUESTION, PlannerAddress(), query, ANSWER_S)
    except NoReply:
        if await planner_alive(session):
            raise
        raise NotRunning(
            "no planner is running, and it answers questions; start one with `robotctl planner`"
        ) from None
    return reply


async def _find_out(call: Call, session: Session, offer: str, timeout_s: float) -> None:
    """Have the goal carried out that would find out.

    Raises:
        Refused: it was not understood, not planned, or not reached.
        TooLate: it has not ended in time.
    """
    from cli.client.fleet_view import fleet_view
    from cli.client.planner_requests import have_planned
    from cli.client.publish import put_goal
    from cli.errors import Refused
    from keyexpr_schema.keyspace import GOAL_STATUS
    from keyexpr_schema.payloads.goals import GoalState

    goal = (await put_goal(session, offer, None, by=call.by)).goal
    async with fleet_view(session, (GOAL_STATUS, {"goal": goal})) as view:
        await view.until_read((goal,), f"goal {goal}", ANSWER_S, timeout_s)
        if not view.ended((goal,)):
            call.inform(await have_planned(session, view, (goal,), call.by))
        await view.until(lambda: view.ended((goal,)), timeout_s, f"goal {goal} to end")
        status = view.goal_status[goal]
    if status.state is not GoalState.REACHED:
        raise Refused(f"goal {goal} {status.state.value}: {status.reason or 'no reason given'}")


def _shall_look(reply: QuestionReply) -> bool:
    """Whether somebody at the terminal wants to have it found out."""
    typer.echo(reply.answer, err=True)
    return typer.confirm("Shall somebody look?", err=True)


def _words(reply: QuestionReply) -> str:
    offer = f"\nTo find out: ask again with --look, or robotctl goal add {reply.offer!r}"
    return f"{reply.answer}{offer if reply.offer else ''}"
