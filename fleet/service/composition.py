"""The one place where concrete planners, allocators and skill files are named.

A user's package adds its own by the entry point groups `robotfleet.planners` and
`robotfleet.allocators` (classes without constructor arguments).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import yaml

from fleet.allocators.base import Allocator
from fleet.allocators.cost_based import CostBasedAllocator
from fleet.allocators.llm import LlmAllocator
from fleet.allocators.makespan import MakespanAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.core.model.skills import SkillModel, skills_from_data
from fleet.errors import BadSkillFile, FleetError
from fleet.llm.configuration import load_llm_config
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import Planner
from fleet.planners.llm.interpreter import LlmInterpreter
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.config_files import config_file

SKILL_MODELS = "robotfleet.skill_models"
"""Entry points to mappings such as the YAML of a skill file holds: `{"skills": {name: model}}`."""


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
        FleetError: an installed package offers something that is not a planner or an allocator.
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
    for found in _from_packages("robotfleet.planners"):
        if not isinstance(found, Planner):
            raise FleetError(f"{type(found).__name__}, installed as a planner, is not a Planner")
        planners[found.name] = found
    for found in _from_packages("robotfleet.allocators"):
        if not isinstance(found, Allocator):
            raise FleetError(f"{type(found).__name__}, installed as an allocator, is not one")
        allocators[found.name] = found
    skills = load_all_skills(skill_files)
    interpreter = LlmInterpreter(model, skills)
    return Composition(skills, planners, allocators, model, interpreter, symbolic)


def load_all_skills(skill_files: tuple[Path, ...] = ()) -> dict[str, SkillModel]:
    """The household's skill models, those of installed packages, and those in these files.

    A file or a package may model a skill of the household anew; two of them not the same one.

    Raises:
        BadSkillFile: a file or a package offers something that is no skill model, or two model the
            same skill.
    """
    sources = [
        (f"entry point {entry.name}", skills_from_data(entry.load(), f"entry point {entry.name}"))
        for entry in entry_points(group=SKILL_MODELS)
    ]
    sources += [(str(path), load_skills(path)) for path in skill_files]
    added: dict[str, SkillModel] = {}
    for where, models in sources:
        for name, skill in models.items():
            if name in added:
                raise BadSkillFile(f"{where}: skill {name} is already modelled elsewhere")
            added[name] = skill
    return {**load_skills(config_file("skills", "household")), **added}


def load_skills(path: Path) -> dict[str, SkillModel]:
    """The skill models in a YAML file.

    Raises:
        BadSkillFile: it cannot be read, or what is in it is not right.
    """
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadSkillFile(f"{path} cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise BadSkillFile(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    return skills_from_data(data, str(path))


def _from_packages(group: str) -> list[Any]:
    return [entry.load()() for entry in entry_points(group=group)]
