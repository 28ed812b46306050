"""`robotctl journal`: what changed in the key-space, and goes on changing."""

from __future__ import annotations

import asyncio
import re
from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, single
from cli.terminal import json_text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.payloads.system import StoreJournal, StoreQuery
    from keyexpr_schema.transport.session import Session

LAST = 50
"""Entries shown if nothing else is said."""
PAGE = 1000
"""Entries asked for at once while following."""
FOLLOW_S = 0.5
"""How often the store is asked for more, which costs it what is new."""
JOURNAL_S = 10.0
_CHUNK = re.compile(r"\*\*?|(?:[^/*$#?]|\$\*)+")
"""A chunk of a Zenoh key expression: a wildcard, or text in which `$*` stands for any part."""


@single
async def journal(
    call: Call,
    tail: Annotated[
        bool, typer.Option("--tail", help="Go on with what changes, until Ctrl-C.")
    ] = False,
    key: Annotated[
        str,
        typer.Option(
            "--key", metavar="PATTERN", help="Only such keys: 'goals/**', 'robots/*/orders/**'."
        ),
    ] = "**",
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="TIME", help="From then on: 15min, 2h, 14:30, 2026-11-28."),
    ] = None,
    after: Annotated[
        int | None,
        typer.Option("--after", min=0, help="Only those numbered higher; the first of them."),
    ] = None,
    limit: Annotated[
        int, typer.Option("--limit", min=1, help="At most so many: the last, unless --after.")
    ] = LAST,
) -> None:
    """What changed in the key-space, in the order in which the store applied it, newest last."""
    from keyexpr_schema.payloads.system import StoreQuery

    query = StoreQuery(
        after=after or 0,
        limit=limit,
        pattern=_pattern(key),
        since_s=_since_s(since),
        newest=after is None,
    )
    async with call.session() as session:
        page = await _ask(session, query)
        if tail:
            await _follow(call, session, query, page)
            return

    def draw() -> RenderableType:
        from cli.views.status import journal_table

        return journal_table(page) if page.entries else "The journal has no such entries."

    call.show(page, draw)


async def _follow(call: Call, session: Session, query: StoreQuery, page: StoreJournal) -> None:
    """Print one line an entry, for ever."""
    import msgspec
    from msgspec.structs import replace

    from cli.views.status import journal_line
    from keyexpr_schema.errors import NoReply

    while True:
        for entry in page.entries:
            typer.echo(json_text(msgspec.json.encode(entry)) if call.json else journal_line(entry))
        if len(page.entries) < query.limit:
            await asyncio.sleep(FOLLOW_S)
        # Where a page is full there may be more that match before the newest entry of all.
        full = not query.newest and len(page.entries) == query.limit
        reached = page.entries[-1].number if full else page.last
        query = replace(query, after=reached, limit=PAGE, newest=False, since_s=None)
        try:
            page = await _ask(session, query)
        except NoReply as error:
            call.warn(f"{error}; waiting for it")
            await session.wait_connected()
            page = replace(page, entries=())


async def _ask(session: Session, query: StoreQuery) -> StoreJournal:
    from keyexpr_schema.keyspace import STORE_JOURNAL
    from keyexpr_schema.payloads.system import StoreAddress, StoreJournal

    # What a query key replies is not in its type; the key table says it is a StoreJournal.
    page = await session.query(STORE_JOURNAL, StoreAddress(), query, JOURNAL_S)
    assert isinstance(page, StoreJournal)
    return page


def _pattern(written: str) -> str:
    """A key expression relative to the realm.

    Raises:
        BadArgument: it is none.
    """
    from cli.errors import BadArgument

    chunks = written.strip("/").split("/")
    if not all(_CHUNK.fullmatch(chunk) for chunk in chunks):
        raise BadArgument(
            f"--key {written!r} is no pattern of keys; write one such as 'goals/**' or "
            "'robots/*/orders/**' (docs/keyspace.md lists the keys)"
        )
    return "/".join(chunks)


def _since_s(written: str | None) -> float | None:

    from cli.times import now_here, parse_since

    if written is None:
        return None
    return parse_since(written, "--since", now_here())
