"""robotctl: the command line of the fleet; `running_demo` is its `demo` for programs and tests."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cli.demo.mission_run import Demo, DemoOptions, running_demo

__all__ = ["Demo", "DemoOptions", "running_demo"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("cli.demo.mission_run"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
