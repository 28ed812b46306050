"""What people can ask for by a skill's name: "vacuum the hallway"."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.core.model.skills import SkillModel
from fleet.language.vocabulary import SkillPhrase


def phrases_of(skills: Mapping[str, SkillModel]) -> tuple[SkillPhrase, ...]:
    """The skills that make something true of one object or place, and of that alone.

    What they do to robots aside; a skill whose effects name a second thing, as `place` names where
    an object is put, needs a sentence of its own in the grammar.
    """
    found = []
    for name in sorted(skills):
        skill = skills[name]
        rows = [row for row in skill.after if skill.parameters[row.variable.subject] != "robot"]
        about = {row.variable.subject for row in rows}
        plain = all(row.value not in skill.parameters for row in rows)
        if len(about) == 1 and plain:
            kind = skill.parameters[about.pop()]
            wants = tuple((key.relation, value) for key, value in rows if value is not None)
            if wants:
                found.append(SkillPhrase(verb=name.replace("_", " "), type=kind, wants=wants))
    return tuple(found)
