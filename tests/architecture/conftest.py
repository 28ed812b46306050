"""Trees of sources are kept for the rules of one file, and not for the tests that come after."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.sources import forget


@pytest.fixture(scope="module", autouse=True)
def sources_are_forgotten() -> Iterator[None]:
    """Hundreds of megabytes, which every collection of garbage would look through."""
    yield
    forget()
