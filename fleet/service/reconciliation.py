"""After each reconnection planner and store are brought together again.

While a planner runs, its outbox has all confirmed that changes. A store that comes back as an older
one (its log was lost, a backup was put in its place) lacks what was confirmed before, and has
orders that are over: nobody would ever say them again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import NoReturn

from fleet.core.effects import Publish, Retract, effects_of
from fleet.core.state import State
from fleet.service.catch_up import OWN
from fleet.service.outbox import Outbox
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import ORDER
from keyexpr_schema.transport.session import Session

AGAIN_S = 1.0
log = logging.getLogger(__name__)


class Reconciliation:
    """Looks what the store lacks of the planner's documents, and has it written again."""

    def __init__(self, session: Session, outbox: Outbox, state: Callable[[], State]) -> None:
        self._session, self._outbox, self._state = session, outbox, state

    async def run(self) -> NoReturn:
        """After each reconnection, for ever."""
        connections = self._session.connections
        while True:
            await self._session.wait_reconnected(connections)
            connections = self._session.connections
            try:
                lacking = await self.lacking()
            except SchemaError as error:
                log.warning("it is not known what the store lacks: %s", error)
                connections -= 1  # once more
                await asyncio.sleep(AGAIN_S)
                continue
            if lacking:
                log.warning("the store lacked %d documents of the planner's", len(lacking))
                self._outbox.send(lacking)

    async def lacking(self) -> list[Publish | Retract]:
        """What is to be written so that the store has what the state says, and no orders besides.

        Raises:
            Unreachable: the store cannot be asked.
        """
        stored = {
            key.build(address): (key, address, value)
            for key in (ORDER, *OWN)
            for address, value in (await self._session.list(key)).items()
        }
        wanted = {
            effect.key.build(effect.address): effect
            for effect in effects_of(self._state())
            if isinstance(effect, Publish)
        }
        missing: list[Publish | Retract] = [
            effect
            for keyexpr, effect in wanted.items()
            if effect.key in (ORDER, *OWN)
            and (keyexpr not in stored or stored[keyexpr][2] != effect.payload)
        ]
        return missing + [
            Retract(key, address)
            for keyexpr, (key, address, _) in stored.items()
            if key is ORDER and keyexpr not in wanted
        ]
