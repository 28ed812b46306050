"""`robotctl ask`: questions, answered from what is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, single

if TYPE_CHECKING:
    from keyexpr_schema.payloads.questions import QuestionReply

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
) -> None:
    """Ask where something is, how many there are, whether something is so, who does what.

    The answer says who told it, and how long ago. What nobody knows is said so, with the goal that
    would find out; a question that is not understood is refused (exit code 1).
    """
    from cli.client.presence import planner_alive
    from cli.errors import NotRunning, Refused
    from keyexpr_schema.errors import NoReply
    from keyexpr_schema.keyspace import QUESTION
    from keyexpr_schema.payloads.questions import QuestionQuery
    from keyexpr_schema.payloads.system import PlannerAddress

    query = QuestionQuery(text=text, speaker=speaker)
    async with call.session() as session:
        try:
            reply: QuestionReply = await session.query(QUESTION, PlannerAddress(), query, ANSWER_S)
        except NoReply:
            if await planner_alive(session):
                raise
            raise NotRunning(
                "no planner is running, and it answers questions; start one with `robotctl planner`"
            ) from None
    if reply.answer is None:
        if call.json:
            call.show(reply, lambda: "")
        raise Refused(reply.reason or "the question was not understood")
    call.show(reply, lambda: _words(reply))


def _words(reply: QuestionReply) -> str:
    offer = f"\nTo find out: robotctl goal add {reply.offer!r}" if reply.offer else ""
    return f"{reply.answer}{offer}"
