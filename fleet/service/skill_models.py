"""The skill models that a planner is started with: the household's, of packages, and in files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel
from fleet.errors import BadSkillFile
from keyexpr_schema.config_files import config_file
from keyexpr_schema.plug_ins import load_plug_ins
from keyexpr_schema.yaml_reader import read_yaml_file

SKILL_MODELS = "robotfleet.skill_models"
"""Entry-point group: paths of skill files, or mappings such as one holds, `{"skills": {…}}`."""


def load_all_skills(skill_files: tuple[Path, ...] = ()) -> dict[str, SkillModel]:
    """The household's skill models, those of installed packages, and those in these files.

    A file or a package may model a skill of the household anew; two of them not the same one.

    Raises:
        BadSkillFile: a file cannot be read, or models a skill that another or a package does, or
            declares a relation otherwise.
    """
    household = load_skills(config_file("skills", "household"))
    relations = {name: row for model in household.values() for name, row in model.relations.items()}
    added: dict[str, SkillModel] = {}

    def add(where: str, models: Mapping[str, SkillModel]) -> None:
        if twice := sorted(added.keys() & models):
            raise BadSkillFile(f"{where}: skill {twice[0]} is already modelled elsewhere")
        for model in models.values():
            for name, declared in model.relations.items():
                if relations.setdefault(name, declared) != declared:
                    raise BadSkillFile(f"{where}: relation {name} is declared otherwise elsewhere")
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
    return {**household, **added}


def load_skills(path: Path) -> dict[str, SkillModel]:
    """The skill models in a YAML file.

    Raises:
        BadSkillFile: it cannot be read, or what is in it is not right.
    """
    file = read_yaml_file(path, BadSkillFile)
    return skills_from_data(file.data, file)
