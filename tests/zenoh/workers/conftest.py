"""Workers in this process, in a kinematic world that a test drives."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from keyexpr_schema.transport.session import SessionConfig
from sim.backend import Backend
from sim.files.mission_file import Mission
from sim.kinematic.backend import KinematicBackend, MotionModel
from tests.support.polling import DEADLINE_S
from tests.support.worker_world import Fleet, MakeFleet, running_fleet


@pytest.fixture(autouse=True)
def patient_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that ends waits for its last report to go out as long as that takes."""
    monkeypatch.setattr("workers.runtime.DRAIN_S", DEADLINE_S)


@pytest.fixture
def fleet_of(session_config: Callable[..., SessionConfig], tmp_path: Path) -> MakeFleet:
    """Makes a running fleet; motions fail as told: `fleet_of({"hsr": {"grasp": (1,)}})`."""

    @asynccontextmanager
    async def make(
        failures: dict[str, dict[str, tuple[int, ...]]] | None = None,
    ) -> AsyncIterator[Fleet]:
        def backend(mission: Mission) -> Backend:
            motion_model = MotionModel(failures=failures or {})
            robots = [(r.spec, r.start_m_rad) for r in mission.robots]
            return KinematicBackend(mission.world, robots, motion_model, step_s=0.05)

        async with running_fleet(session_config, tmp_path / "workers", backend) as fleet:
            yield fleet

    return make
