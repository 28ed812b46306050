"""Property tests that fail when their interesting branches were never reached."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

Reached = Counter[str]


def reaches(*branches: str, least: Mapping[str, int] | None = None) -> Callable[..., Any]:
    """A test around a law by `@given`, whose argument `reached` counts the branches it takes.

    After all examples each of `branches` must have been counted once, those in `least` so often.
    Fixtures and parameters of the test go to the law as they are.
    """
    needed = {**dict.fromkeys(branches, 1), **(least or {})}

    def test_of(law: Callable[..., None]) -> Callable[..., None]:
        def test(**fixtures: Any) -> None:
            reached: Reached = Counter()
            law(reached=reached, **fixtures)
            missed = [name for name, count in needed.items() if reached[name] < count]
            assert not missed, f"hardly or never reached: {missed}, of {dict(reached)}"

        signature = inspect.signature(law)
        rest = [p for p in signature.parameters.values() if p.name != "reached"]
        test.__signature__ = signature.replace(parameters=rest)  # type: ignore[attr-defined]
        test.__name__, test.__doc__, test.__module__ = law.__name__, law.__doc__, law.__module__
        return test

    return test_of
