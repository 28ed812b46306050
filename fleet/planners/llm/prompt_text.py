"""How skills, the planning problem and the names that exist are put to a language model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from fleet.core.model.formulas.text import effect_text, formula_text
from fleet.core.model.skills import SPACE, SkillModel
from fleet.core.model.world import WorldModel
from fleet.language import Vocabulary
from fleet.llm.quoting import fenced
from keyexpr_schema.facts import AT, Literal
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.world import Object, Place


def skills_text(skills: Iterable[SkillModel]) -> str:
    """The skills, one a line: parameters, what they need, what must hold before and holds after."""
    return "\n".join(_skill_text(skill) for skill in skills)


def _skill_text(skill: SkillModel) -> str:
    parameters = ", ".join(f"{name}: {kind}" for name, kind in skill.parameters.items())
    before = [str(row) for row in skill.before]
    before += map(formula_text, skill.conditions)
    before += [f"{SPACE}({carrier})" for carrier in skill.space_in]
    sentences = [f"- {skill.name}({parameters}): {skill.about}".rstrip(": ")]
    needs = [
        f"{parameter} has {need.capability}"
        + (f" >= {need.measure}({need.of})" if need.measure else "")
        for parameter, rows in skill.needs.items()
        for need in rows
    ]
    if needs:
        sentences.append(f"Needs: {', '.join(needs)}.")
    sentences.append(f"Before: {', '.join(before) or 'nothing'}.")
    after = [*map(str, skill.after), *map(effect_text, skill.conditional)]
    sentences.append(f"After: {', '.join(after) or 'nothing'}.")
    return " ".join(sentences)


def team_skills(world: WorldModel) -> list[SkillModel]:
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
        {
            **_names(thing.label, thing.aliases),
            "object": name,
            "mass_kg": thing.mass_kg,
            **_features(thing),
        }
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
            "conditions": [str(c) for c in goal.conditions],
            **({"only_by": list(goal.by)} if goal.by else {}),
        }
        for goal in goals
    ]
    return fenced(
        {
            "robots": robots,
            "places": _places(world.places),
            "objects": objects,
            "facts": facts,
            "keep": [str(condition) for condition in keep],
            "goals": wanted,
        }
    )


def sentence_text(text: str, refusal: str, vocabulary: Vocabulary) -> str:
    """A sentence, why the grammar refuses it, and the names that other words can use; fenced."""
    return fenced(
        {
            "places": _places(vocabulary.places),
            "objects": [
                {
                    **_names(thing.label, thing.aliases),
                    "object": name,
                    "kind": thing.kind,
                    "at": _at(name, vocabulary),
                    **_features(thing),
                }
                for name, thing in vocabulary.objects.items()
            ],
            "robots": [
                {"robot": name, "label": spec.label} for name, spec in vocabulary.robots.items()
            ],
            **({} if vocabulary.speaker is None else {"speaker": vocabulary.speaker}),
            "sentence": text,
            "refused": refusal,
        }
    )


def frames_text(vocabulary: Vocabulary) -> str:
    """How skills are asked for, one a line, and which words there are for states."""
    rows = [
        f"- {'; '.join((phrase.verb, *phrase.says))} ({phrase.type})"
        for phrase in vocabulary.skill_phrases
    ]
    rows += [f"- {'; '.join(task.says)}: a task of its own" for task in vocabulary.tasks]
    words = dict.fromkeys(each.word for each in vocabulary.state_words)
    rows += [f"- something should be: {', '.join(words)}"] if words else []
    return "\n".join(rows) or "- nothing"


def _at(name: str, vocabulary: Vocabulary) -> str:
    """What carries a thing, as finely as is known."""
    around = vocabulary.carriers.get(name) or (vocabulary.whereabouts.get(name, "unknown"),)
    return around[0]


def _features(thing: Object) -> dict[str, Any]:
    """What can be done with a thing, where anything is said of that."""
    told: dict[str, Any] = {}
    if not thing.movable:
        told["movable"] = False
    if thing.features:
        told["features"] = list(thing.features)
    if thing.part_of is not None:
        told["part_of"] = thing.part_of
    if thing.blocked_by:
        told["blocked_while_open_by"] = list(thing.blocked_by)
    if thing.room is not None:
        told["room"] = thing.room
    return told


def _places(places: Mapping[str, Place]) -> list[dict[str, Any]]:
    return [{**_names(row.label, row.aliases), "place": name} for name, row in places.items()]


def _names(label: str, aliases: tuple[str, ...]) -> dict[str, Any]:
    return {"label": label, "aliases": list(aliases)} if aliases else {"label": label}
