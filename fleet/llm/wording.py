"""How the world is put to a language model: what people wrote is fenced as data."""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from fleet.core.model.skills import SPACE, SkillModel
from fleet.core.model.world import WorldModel
from fleet.language import Vocabulary
from keyexpr_schema.facts import AT, Literal
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Violation

MAX_TEXT = 300
"""Characters of one label or sentence; more is cut."""
MAX_VIOLATIONS = 20
"""Reasons told in one round; more would bury the first, which is often the cause of the others."""


def cleaned(text: str) -> str:
    """Text of people without control and invisible formatting characters, cut to `MAX_TEXT`."""
    shown = "".join(
        " " if unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp", "Cs", "Co") else c for c in text
    )
    return shown if len(shown) <= MAX_TEXT else shown[: MAX_TEXT - 1] + "…"


def fenced(data: Any) -> str:
    """Data as JSON that cannot leave its fence: `<` and `>` are escaped, texts are cleaned."""
    lines = json.dumps(_clean(data), ensure_ascii=False, indent=1)
    return lines.replace("<", "\\u003c").replace(">", "\\u003e")


def _clean(data: Any) -> Any:
    if isinstance(data, str):
        return cleaned(data)
    if isinstance(data, Mapping):
        return {cleaned(str(key)): _clean(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_clean(item) for item in data]
    return data


def skills_text(skills: Iterable[SkillModel]) -> str:
    """The skills, one a line: parameters, what they need, what must hold before and holds after."""
    return "\n".join(_skill(skill) for skill in skills)


def _skill(skill: SkillModel) -> str:
    parameters = ", ".join(f"{name}: {kind}" for name, kind in skill.parameters.items())
    before = [str(row) for row in skill.before]
    before += [f"{SPACE}({carrier})" for carrier in skill.space_in]
    parts = [f"- {skill.name}({parameters}): {skill.about}".rstrip(": ")]
    needs = [
        f"{parameter} has {need.capability}"
        + (f" >= {need.measure}({need.of})" if need.measure else "")
        for parameter, rows in skill.needs.items()
        for need in rows
    ]
    if needs:
        parts.append(f"Needs: {', '.join(needs)}.")
    parts.append(f"Before: {', '.join(before) or 'nothing'}.")
    parts.append(f"After: {', '.join(map(str, skill.after)) or 'nothing'}.")
    return " ".join(parts)


def useful_skills(world: WorldModel) -> list[SkillModel]:
    """The skills that some connected robot has."""
    names = {name for robot in world.team for name in world.robots[robot].skills}
    return [skill for skill in world.skills.values() if skill.name in names]


def problem_text(world: WorldModel, goals: Iterable[Goal], keep: Iterable[Condition] = ()) -> str:
    """Robots, places, objects, facts and goals, fenced. Where robots stand is left out.

    `keep` holds already and must hold at the end.
    """
    robots = [
        {
            "robot": name,
            "label": world.robots[name].label,
            "skills": list(world.robots[name].skills),
            "capabilities": world.robots[name].capabilities,
        }
        for name in world.team
    ]
    objects = [
        {**_object(thing.label, thing.aliases), "object": name, "mass_kg": thing.mass_kg}
        for name, thing in world.objects.items()
    ]
    facts = [
        str(Literal(variable, value))
        for variable, value in world.facts.items()
        if not (variable.relation == AT and variable.subject in world.robots)
    ]
    wanted = [
        {
            "goal": goal.goal,
            "text": goal.text,
            "conditions": [str(condition) for condition in goal.conditions],
        }
        for goal in goals
    ]
    places = [
        {**_object(place.label, place.aliases), "place": name}
        for name, place in world.places.items()
    ]
    return fenced(
        {
            "robots": robots,
            "places": places,
            "objects": objects,
            "facts": facts,
            "keep": [str(condition) for condition in keep],
            "goals": wanted,
        }
    )


def vocabulary_text(text: str, words: Vocabulary) -> str:
    """A sentence and the names that it may use, fenced."""
    return fenced(
        {
            "places": [
                {**_object(place.label, place.aliases), "place": name}
                for name, place in words.places.items()
            ],
            "objects": [
                {
                    **_object(thing.label, thing.aliases),
                    "object": name,
                    "kind": thing.kind,
                    "ordinal": thing.ordinal,
                    "at": words.whereabouts.get(name, "unknown"),
                }
                for name, thing in words.objects.items()
            ],
            "robots": [{"robot": name, "label": spec.label} for name, spec in words.robots.items()],
            "sentence": text,
        }
    )


def _object(label: str, aliases: tuple[str, ...]) -> dict[str, Any]:
    return {"label": label, "aliases": list(aliases)} if aliases else {"label": label}


def violations_text(violations: Iterable[Violation]) -> tuple[str, str]:
    """Violations as sentences, one a line, and as data; both fit to stand in a fence."""
    rows = list(violations)[:MAX_VIOLATIONS]
    sentences = "\n".join(f"- {cleaned(row.sentence)}" for row in rows)
    sentences = sentences.replace("<", "\\u003c").replace(">", "\\u003e")
    return sentences, fenced(msgspec.to_builtins(rows))
