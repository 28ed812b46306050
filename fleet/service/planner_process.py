"""The process behind `robotctl planner`."""

from __future__ import annotations

import asyncio
import logging
import signal
import sys
from importlib import import_module
from pathlib import Path

from fleet.core.state import Policy
from fleet.errors import FleetError
from fleet.history.archive import Archive
from fleet.history.retention import Retention
from fleet.service.composition import Composition, compose
from fleet.service.event_journal import EventJournal
from fleet.service.planner_service import PlannerService
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.transport.session import SessionConfig, open_session


def run(
    endpoints: tuple[str, ...],
    realm: str,
    data_dir: Path,
    skill_files: tuple[Path, ...] = (),
    llm_file: Path | None = None,
    policy: Policy | None = None,
    retention: Retention | None = None,
) -> None:
    """Be the central planner of a realm until SIGTERM or SIGINT; prints a line once it is ready.

    The event journal and the archive of what is over lie in `data_dir`; `retention` says how long
    that keeps its keys. It waits for a router as long as there is none.
    `skill_files` and `llm_file` are those of `compose`.

    Raises:
        SystemExit: with 1 and one sentence on stderr, when it cannot start or is superseded.
    """
    logging.basicConfig(
        level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(name)s: %(message)s"
    )
    try:
        composition = compose(skill_files, llm_file)
        asyncio.run(_run(endpoints, realm, data_dir, composition, policy, retention))
    except (FleetError, SchemaError) as error:
        print(f"error: {error}", file=sys.stderr)  # noqa: T201
        raise SystemExit(1) from None


async def _run(
    endpoints: tuple[str, ...],
    realm: str,
    data_dir: Path,
    composition: Composition,
    policy: Policy | None,
    retention: Retention | None,
) -> None:
    config = SessionConfig(
        endpoints=endpoints, realm=realm, component="planner", connect_timeout_s=None
    )
    loop = asyncio.get_running_loop()
    with EventJournal(data_dir) as journal, Archive(data_dir) as archive:
        async with open_session(config) as session:
            ready = asyncio.Event()
            service = asyncio.create_task(
                PlannerService(session, journal, composition, archive, policy, retention).run(ready)
            )
            for number in (signal.SIGTERM, signal.SIGINT):
                loop.add_signal_handler(number, service.cancel)
            waiting = asyncio.create_task(ready.wait())
            await asyncio.wait((service, waiting), return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
            warming = asyncio.create_task(asyncio.to_thread(_warm_up, composition))
            if ready.is_set():
                print(f"planner ready in realm {realm}", flush=True)  # noqa: T201
            try:
                await service
            except asyncio.CancelledError:
                return
            finally:
                # Ends calls to a model that are under way, so that no thread keeps the process.
                composition.language_model.close()
                warming.cancel()


def _warm_up(composition: Composition) -> None:
    """Load what plans are made with now, so that the first one need not wait for it."""
    for library in ("pulp", "scipy.optimize", "scipy.sparse.csgraph"):
        import_module(library)
    composition.language_model.warm()
