"""The one place where concrete planners and allocators are named.

An installed package adds its own as plug-ins; one that is broken is logged and left out.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from fleet.allocators.base import Allocator
from fleet.allocators.cost_based import CostBasedAllocator
from fleet.allocators.llm import LlmAllocator
from fleet.allocators.makespan import MakespanAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.llm.configuration import load_llm_config
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import Planner
from fleet.planners.llm.paraphraser import LlmParaphraser
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.programs.base import ProgramWriter
from fleet.planners.programs.model import ModelWriter
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.errors import BrokenPlugIn
from keyexpr_schema.ids import Id
from keyexpr_schema.plug_ins import load_plug_in, load_plug_ins, plug_in_names

PLANNERS = "robotfleet.planners"
ALLOCATORS = "robotfleet.allocators"
PROGRAM_WRITERS = "robotfleet.program_writers"
"""Entry-point groups: each entry is a class (of a `Planner`, an `Allocator`, a `ProgramWriter`)
without arguments. A writer of programs is named for the model of the robots that it writes for."""

_log = logging.getLogger("robotfleet.plug_ins")


@dataclass(frozen=True)
class Composition:
    """What plans are made with. `feasibility` says at no cost if a goal can be reached."""

    planners: Mapping[str, Planner]
    allocators: Mapping[str, Allocator]
    language_model: LanguageModel
    paraphraser: LlmParaphraser
    feasibility: Planner
    model_writer: ProgramWriter
    program_writers: Mapping[str, ProgramWriter]
    """Those that robots bring, by the robot's model."""

    @property
    def strategies(self) -> tuple[str, ...]:
        """Every strategy that some planner has."""
        return tuple(dict.fromkeys(s for p in self.planners.values() for s in p.strategies))


def compose(llm_file: Path | None = None) -> Composition:
    """All planners and allocators there are.

    `llm_file` configures the language model; without it configs/planner.yaml does.

    Raises:
        BadLlmConfig: the language model's configuration or prompts cannot be used.
    """
    symbolic = SymbolicPlanner()
    model = LanguageModel(load_llm_config(llm_file))
    llm = LlmPlanner(model, symbolic)
    planners: dict[str, Planner] = {symbolic.name: symbolic, llm.name: llm}
    own: tuple[Allocator, ...] = (
        MakespanAllocator(),
        MinMaxLoadAllocator(TieBreak.TRAVEL),
        MinMaxLoadAllocator(TieBreak.TRAVEL, fallback_round_robin=True),
        MinMaxLoadAllocator(TieBreak.NEXT_LOADS),
        CostBasedAllocator(),
        RoundRobinAllocator(),
        LlmAllocator(model, MakespanAllocator()),
    )
    allocators = {allocator.name: allocator for allocator in own}
    load_plug_ins(PLANNERS, lambda offered: _add(offered, Planner, planners))
    load_plug_ins(ALLOCATORS, lambda offered: _add(offered, Allocator, allocators))
    return Composition(
        planners,
        allocators,
        model,
        LlmParaphraser(model, symbolic),
        symbolic,
        ModelWriter(model),
        _program_writers(),
    )


def _program_writers() -> dict[str, ProgramWriter]:
    """The writers that installed packages bring, by the name of their entry point."""

    def accept(offered: Any) -> ProgramWriter:
        if not isinstance(made := offered(), ProgramWriter):
            raise TypeError(f"it makes {made!r}, which is no ProgramWriter")
        msgspec.convert(getattr(made, "name", None), Id)
        return made

    found: dict[str, ProgramWriter] = {}
    for name in plug_in_names(PROGRAM_WRITERS):
        try:
            found[name] = load_plug_in(PROGRAM_WRITERS, name, accept)
        except BrokenPlugIn as error:
            _log.warning("%s", error)
    return found


def _add(offered: Any, kind: type[Planner] | type[Allocator], known: dict[str, Any]) -> None:
    """Make what a plug-in offers and add it to those `known`; what it raises is the warning."""
    if not isinstance(made := offered(), kind):
        raise TypeError(f"it makes {made!r}, which is no {kind.__name__}")
    name = msgspec.convert(getattr(made, "name", None), Id)
    if name in known:
        raise ValueError(f"there is a {kind.__name__} called {name!r} already")
    msgspec.convert(made.waiting_s, float)
    if isinstance(made, Planner):
        msgspec.convert(made.strategies, tuple[Id, ...])
    known[name] = made
