"""The process behind `robotctl planner`."""

from __future__ import annotations

import asyncio
import logging
import signal
import sqlite3
import sys
from contextlib import suppress
from pathlib import Path

from msgspec.structs import replace

from fleet.core.model.skills import Skills
from fleet.core.state import Policy
from fleet.errors import FleetError
from fleet.history.archive import Archive
from fleet.history.audit_log import AuditLog
from fleet.history.retention import Retention
from fleet.language import load_language_config
from fleet.llm.configuration import load_llm_config
from fleet.llm.conversation import LanguageModel
from fleet.service.event_journal import EventJournal
from fleet.service.planner_service import PlannerService
from fleet.service.planning.pool import PlanningPool
from fleet.service.skill_models import load_all_skills
from fleet.service.task_files import load_all_tasks
from fleet.service.word_files import load_words
from keyexpr_schema.control_characters import show_in_logs
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.full_disk import FREE_SOME, is_full
from keyexpr_schema.transport.session import SessionConfig, open_session

STORE_S = 30.0
"""How long the store may take to answer [s]: a planner that has none has to begin anew."""


def run(
    endpoints: tuple[str, ...],
    realm: str,
    data_dir: Path,
    skill_files: tuple[Path, ...] = (),
    task_files: tuple[Path, ...] = (),
    word_files: tuple[Path, ...] = (),
    llm_file: Path | None = None,
    policy: Policy | None = None,
    retention: Retention | None = None,
    zenoh_config: Path | None = None,
) -> None:
    """Be the central planner of a realm until SIGTERM or SIGINT; prints a line once it is ready.

    The event journal and the archive of what is over lie in `data_dir`; `retention` says how long
    that keeps its keys. It waits for a router as long as there is none. `skill_files` are those of
    `load_all_skills`, `task_files` those of `load_all_tasks`, `word_files` those of `load_words`,
    `llm_file` that of `compose`.

    Raises:
        SystemExit: with 1 and one sentence on stderr, when it cannot start or is superseded.
    """
    show_in_logs()
    logging.basicConfig(
        level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(name)s: %(message)s"
    )
    config = SessionConfig(
        endpoints=endpoints,
        realm=realm,
        component="planner",
        connect_timeout_s=None,
        answer_s=STORE_S,
        zenoh_config=zenoh_config,
    )
    try:
        skills = load_all_skills(skill_files)
        model = LanguageModel(load_llm_config(llm_file))
        language = load_language_config(llm_file)
        policy = replace(
            policy or Policy(),
            interpreter=model.configured,
            confirm=language.confirm,
            tasks=load_all_tasks(task_files),
            words=load_words(word_files),
        )
        pool = PlanningPool(llm_file, data_dir / "failed-planning-jobs")
        asyncio.run(_run(config, data_dir, pool, skills, policy, retention))
    except (FleetError, SchemaError) as error:
        print(f"Error: {error}", file=sys.stderr)  # noqa: T201
        raise SystemExit(1) from None
    except (sqlite3.Error, OSError) as error:
        what = FREE_SOME if is_full(error) else "move away what is damaged, to begin with none"
        print(  # noqa: T201
            f"Error: what the planner keeps in {data_dir} can be read or written no more: "
            f"{error}; {what}",
            file=sys.stderr,
        )
        raise SystemExit(1) from None


async def _run(
    config: SessionConfig,
    data_dir: Path,
    pool: PlanningPool,
    skills: Skills,
    policy: Policy,
    retention: Retention | None,
) -> None:
    loop = asyncio.get_running_loop()
    with (
        EventJournal(data_dir) as journal,
        Archive(data_dir) as archive,
        AuditLog(data_dir) as audit,
    ):
        async with pool.running(), open_session(config) as session:
            ready = asyncio.Event()
            service = asyncio.create_task(
                PlannerService(
                    session, journal, pool, skills, archive, audit, policy, retention
                ).run(ready)
            )
            for number in (signal.SIGTERM, signal.SIGINT):
                loop.add_signal_handler(number, service.cancel)
            waiting = asyncio.create_task(ready.wait())
            await asyncio.wait((service, waiting), return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
            if ready.is_set():
                print(f"planner ready in realm {config.realm}", flush=True)  # noqa: T201
            with suppress(asyncio.CancelledError):
                await service
