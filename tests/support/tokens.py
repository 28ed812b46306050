"""Tokens on their way: of two sessions nothing says whose words a router has first."""

from __future__ import annotations

from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.session import Session
from tests.support.polling import DEADLINE_S, until


async def there(session: Session, address: AliveAddress) -> None:
    """Wait until a router that is up has a worker's token."""

    async def seen() -> bool:
        replies = await session.link.tokens(ROBOT_ALIVE.pattern(), DEADLINE_S)
        return ROBOT_ALIVE.build(address) in {sample.keyexpr for sample in replies.values}

    await until(seen, "the token at the router")
