"""Fixtures for everybody, and the profiles of property tests."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from fleet.llm.client import ModelClient
from keyexpr_schema.transport.session import SessionConfig
from tests.support.open_files import nothing_stays_open
from tests.support.polling import DEADLINE_S
from tests.support.router_process import RouterProcess

# No timing decides a test. A change is judged by the same examples each time, wherever that is.
# `make laws` draws new ones (`--hypothesis-profile=new`), and what those find becomes a test of its
# own. To look for a smaller example takes minutes where an example is a whole life of a fleet: what
# failed is printed as it is, with what brings it back, and `--hypothesis-profile=shrink` makes it
# small.
UNTIMED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
AS_IT_IS = [phase for phase in Phase if phase not in {Phase.shrink, Phase.explain}]
settings.register_profile("shrink", UNTIMED)
settings.register_profile("new", UNTIMED, phases=AS_IT_IS)
settings.register_profile("same", UNTIMED, derandomize=True, phases=AS_IT_IS)
settings.load_profile("same")

# The tests start hundreds of processes. Where the environment forbids to keep what was compiled,
# each would compile our source again: a third of the time that a planner takes to start.
# The same goes for this process: the next run begins sooner by what it keeps.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Who is started in the background of a script (`make test &`) ignores Ctrl-C, and so would all
# that the tests start: those that interrupt a process would wait for ever.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Stores and journals sync what they confirm: thousands of times in the tests, for which a disk
# takes milliseconds each. In memory it takes none.
MEMORY, ENOUGH_BYTES = Path("/dev/shm"), 4 * 2**30


def _is_roomy(folder: Path) -> bool:
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        return False
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize > ENOUGH_BYTES and not found.f_flag & os.ST_NOEXEC


if _is_roomy(MEMORY):
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))


def pytest_xdist_auto_num_workers() -> int:
    """Three for every two cores: much of the time a test waits for processes that it started."""
    return -(-3 * (os.cpu_count() or 1) // 2)


# Thousands of collected tests and every library are there until the end: to look through them for
# garbage again and again took a tenth of the time of tests that compute.
YOUNG_OBJECTS = 20_000


def pytest_collection() -> None:
    gc.disable()


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG_OBJECTS)
    gc.enable()


@pytest.fixture
def router(tmp_path: Path) -> Iterator[RouterProcess]:
    """A real router and store on a free port of the loopback, in a process of its own."""
    process = RouterProcess(tmp_path / "router")
    try:
        yield process
    finally:
        process.kill()


@pytest.fixture
def all_closed() -> Iterator[None]:
    """For a test that leaves nothing open: no file, no pipe, no connection to a database."""
    with nothing_stays_open():
        yield


@pytest.fixture(scope="session")
def model_client() -> Iterator[ModelClient]:
    """The processes that ask language models: one set for all tests, as LiteLLM starts slowly."""
    client = ModelClient()
    yield client
    client.close()


@pytest.fixture
def session_config(router: RouterProcess) -> Callable[..., SessionConfig]:
    """Makes a `SessionConfig` for the fixture `router`: `session_config(component="me")`."""

    def make(**fields: object) -> SessionConfig:
        patient = {"endpoints": (router.endpoint,), "connect_timeout_s": DEADLINE_S}
        return SessionConfig(**(patient | fields))  # type: ignore[arg-type]

    return make
