"""The one place where concrete planners, allocators and skill files are named.

An installed package adds its own as plug-ins; one that is broken is logged and left out.
"""

from __future__ import annotations

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
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel
from fleet.errors import BadSkillFile
from fleet.llm.configuration import load_llm_config
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import Planner
from fleet.planners.llm.interpreter import LlmInterpreter
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.config_files import config_file, read_yaml
from keyexpr_schema.ids import Id
from keyexpr_schema.plug_ins import load_plug_ins

SKILL_MODELS = "robotfleet.skill_models"
"""Entry-point group: paths of skill files, or mappings such as one holds, `{"skills": {…}}`."""
PLANNERS = "robotfleet.planners"
ALLOCATORS = "robotfleet.allocators"
"""Entry-point groups: each entry is a class (of a `Planner`, an `Allocator`) without arguments."""


@dataclass(frozen=True)
class Composition:
    """What this planner is made of. `feasibility` says at no cost if a goal can be reached."""

    skills: Mapping[str, SkillModel]
    planners: Mapping[str, Planner]
    allocators: Mapping[str, Allocator]
    language_model: LanguageModel
    interpreter: LlmInterpreter
    feasibility: Planner

    @property
    def strategies(self) -> tuple[str, ...]:
        """Every strategy that some planner has."""
        return tuple(dict.fromkeys(s for p in self.planners.values() for s in p.strategies))


def compose(skill_files: tuple[Path, ...] = (), llm_file: Path | None = None) -> Composition:
    """All planners and allocators there are, and the skills of these files (none: the household's).

    `llm_file` configures the language model; without it configs/planner.yaml does.

    Raises:
        BadSkillFile: a file cannot be read, or two files model the same skill.
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
    skills = load_all_skills(skill_files)
    interpreter = LlmInterpreter(model)
    return Composition(skills, planners, allocators, model, interpreter, symbolic)


def load_all_skills(skill_files: tuple[Path, ...] = ()) -> dict[str, SkillModel]:
    """The household's skill models, those of installed packages, and those in these files.

    A file or a package may model a skill of the household anew; two of them not the same one.

    Raises:
        BadSkillFile: a file cannot be read, or models a skill that another or a package does.
    """
    added: dict[str, SkillModel] = {}

    def add(where: str, models: Mapping[str, SkillModel]) -> None:
        if twice := sorted(added.keys() & models):
            raise BadSkillFile(f"{where}: skill {twice[0]} is already modelled elsewhere")
        added.update(models)

    def offered(models: Any) -> None:
        where = "its skill models"
        if isinstance(models, Path):
            add(where, load_skills(models))
        else:
            add(where, skills_from_data(models, where))

    load_plug_ins(SKILL_MODELS, offered)
    for path in skill_files:
        add(str(path), load_skills(path))
    return {**load_skills(config_file("skills", "household")), **added}


def load_skills(path: Path) -> dict[str, SkillModel]:
    """The skill models in a YAML file.

    Raises:
        BadSkillFile: it cannot be read, or what is in it is not right.
    """
    return skills_from_data(read_yaml(path, BadSkillFile), str(path))


def _add(offered: Any, kind: type, known: dict[str, Any]) -> None:
    """Make what a plug-in offers and add it to those `known`; what it raises is the warning."""
    if not isinstance(made := offered(), kind):
        raise TypeError(f"it makes {made!r}, which is no {kind.__name__}")
    name = msgspec.convert(getattr(made, "name", None), Id)
    if name in known:
        raise ValueError(f"there is a {kind.__name__} called {name!r} already")
    if isinstance(made, Planner):
        msgspec.convert(made.strategies, tuple[Id, ...])
    known[name] = made
