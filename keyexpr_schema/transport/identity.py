"""Who a session is for the others: the common name in the certificate that it shows, if any.

Zenoh's access control drops what is not allowed, and says so to nobody: a put is gone, a question
has no answer. So who has a certificate looks into the table first.
"""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from typing import Any

from keyexpr_schema.errors import NotAllowed
from keyexpr_schema.key import Key
from keyexpr_schema.principals import Principal
from keyexpr_schema.transport.trace import Operation, Trace

AGAIN_S = 5.0
"""How often one who is not admitted looks whether it is now."""

_log = logging.getLogger(__name__)


class CheckedTrace(Trace):
    """A trace of what `principal` does, which refuses what the table does not give it."""

    def __init__(self, component: str, principal: Principal | None) -> None:
        super().__init__(component)
        self._principal = principal

    def note(self, operation: Operation, key: Key[Any, Any], keyexpr: str) -> None:
        """As `Trace.note`.

        Raises:
            NotAllowed: the table gives this to others.
        """
        if self._principal is not None:
            match operation:
                case "delete":
                    objection = self._principal.objection_to_delete(key, keyexpr)
                case "put" | "token" | "query":
                    objection = self._principal.objection_to_write(key, keyexpr)
                case _:
                    objection = self._principal.objection_to_read(key, keyexpr)
            if objection is not None:
                raise NotAllowed(objection)
        super().note(operation, key, keyexpr)


class RouterAccess:
    """Whether the router knows a principal (`None`: nobody who has a certificate).

    `shown` waits so long [s] for a sign that somebody answers, which a router with access control
    does not show to those whom it does not know.
    """

    def __init__(
        self,
        principal: Principal | None,
        endpoints: tuple[str, ...],
        shown: Callable[[float], Awaitable[bool]],
    ) -> None:
        self._principal, self._endpoints, self._shown = principal, endpoints, shown

    async def check(self, within_s: float, certified_within_s: float) -> bool:
        """Whether somebody answers, or comes to be known; who has a certificate may wait longer.

        Raises:
            NotAllowed: nobody does, for one who has a certificate.
        """
        if self._principal is None:
            return await self._shown(within_s)
        if not await self._shown(certified_within_s):
            raise NotAllowed.not_known(self._principal.name, self._endpoints)
        return True

    async def wait(self) -> None:
        """Look until one who has a certificate is known; says once what it waits for."""
        said = False
        while self._principal is not None and not await self._shown(AGAIN_S):
            if not said:
                why = NotAllowed.not_known(self._principal.name, self._endpoints)
                _log.error("%s; waiting for that", why)
                said = True
