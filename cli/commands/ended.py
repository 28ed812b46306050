"""What `goal delete` and `plan delete` share: names, or all that has ended."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from cli.command import Call

OlderOption = Annotated[
    str | None,
    typer.Option("--older-than", metavar="SPAN", help="With --ended: so long ago, as 2h, 7d."),
]


def named(what: str, names: Sequence[str] | None, ended: bool, older_than: str | None) -> list[str]:
    """Whose names were given, each once; none where all that has ended is meant.

    Raises:
        BadArgument: neither names nor --ended were said, or both, or --older-than without it.
    """
    from cli.errors import BadArgument

    if older_than is not None and not ended:
        raise BadArgument("--older-than goes with --ended")
    if bool(names) == ended:
        raise BadArgument(
            f"name the {what}s to delete, or say --ended for all that have ended; one of both"
        )
    return list(dict.fromkeys(names or ()))


async def delete_ended(
    call: Call, older_than: str | None, *, plans: bool = False, goals: bool = False
) -> None:
    """Delete the keys of plans or goals that are over, and say how many."""
    from cli.client.history import retire
    from cli.times import parse_span
    from cli.views.history import retired_sentence
    from keyexpr_schema.payloads.history import RetireQuery

    older_s = 0.0 if older_than is None else parse_span(older_than, "--older-than")
    async with call.session() as session:
        query = RetireQuery(plans=plans, goals=goals, older_than_s=older_s, by=call.by)
        gone = await retire(session, query)
    call.show(gone, lambda: retired_sentence(gone))
