"""robotctl against a router of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import pytest

from tests.robotctl import Robotctl


class Router(Protocol):
    endpoint: str


@pytest.fixture
def robotctl(router: Router, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path)
