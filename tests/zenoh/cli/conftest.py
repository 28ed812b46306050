"""robotctl against a router of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path)
