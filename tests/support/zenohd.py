"""Zenoh's own router with its storage, where it is installed: as users copy its configuration."""

from __future__ import annotations

import os
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from fleet.service.router_process import with_port
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.child_process import child_process
from tests.support.polling import DEADLINE_S

CONFIG = Path(__file__).parents[2] / "configs" / "routers" / "zenohd-storage.json5"
LISTENS = "tcp/0.0.0.0:7447"


@asynccontextmanager
async def zenohd(folder: Path) -> AsyncIterator[str]:
    """The endpoint of a `zenohd` with the shipped storages; skips the test where it has none."""
    program = shutil.which("zenohd")
    if program is None:
        pytest.skip("zenohd is not on the path: its storage was not tested")
    endpoint = with_port("tcp/127.0.0.1:0")
    text = CONFIG.read_text()
    assert LISTENS in text
    config = folder / CONFIG.name
    config.write_text(text.replace(LISTENS, endpoint))
    log = folder / "zenohd.log"
    environment = {**os.environ, "ZENOH_BACKEND_ROCKSDB_ROOT": str(folder)}
    with log.open("w") as out:
        async with child_process(
            program, "--config", str(config), stdout=out, stderr=out, env=environment
        ) as process:
            try:
                async with open_session(SessionConfig((endpoint,), connect_timeout_s=DEADLINE_S)):
                    pass
            except Unreachable:
                pytest.fail(f"zenohd does not answer: {log.read_text()}")
            if process.returncode is not None or "not find" in log.read_text():
                pytest.skip("zenohd has no rocksdb backend here: its storage was not tested")
            yield endpoint
