"""What a program may call, as stubs that it is type-checked against before anything moves."""

from __future__ import annotations

from collections.abc import Iterable
from keyword import iskeyword

from workers.skill_registry import ParameterKind, Skill

ASK, LEARN, REPLAN, FAIL = "ask", "learn", "replan", "fail"
CALLS = {
    ASK: ("relation", "subject"),
    LEARN: ("relation", "subject", "value"),
    REPLAN: ("reason",),
    FAIL: ("reason",),
}
"""What every program may call besides skills, with the parameters."""

_HEAD = '''from typing import NoReturn

def ask(relation: str, subject: str) -> str | bool | float | None:
    """What is known of relation(subject), such as ask("at", "cup_1"); None: unknown."""
    ...

def learn(relation: str, subject: str, value: str | bool | float | None) -> None:
    """Tell everybody that relation(subject) is so; None: that it is unknown."""
    ...

def replan(reason: str) -> NoReturn:
    """End here: the planner shall make another plan from what is known now."""
    ...

def fail(reason: str) -> NoReturn:
    """End here: what was asked cannot be done."""
    ...
'''


def callable_skills(skills: Iterable[Skill]) -> dict[str, Skill]:
    """The skills that a program can call, by name: those whose names can stand in Python."""
    return {
        one.name: one
        for one in skills
        if one.name not in CALLS and all(_is_name(name) for name in (one.name, *one.parameters))
    }


def stubs_of(skills: Iterable[Skill]) -> str:
    """The stub file for a robot with these skills."""
    return _HEAD + "".join(map(_stub, callable_skills(skills).values()))


def _stub(one: Skill) -> str:
    parameters = ", ".join(f"{name}: {_type(kind)}" for name, kind in one.parameters.items())
    about = one.about.replace("\\", "").replace('"', "'")
    return f'\ndef {one.name}({parameters}) -> None:\n    """{about}"""\n    ...\n'


def _type(kind: ParameterKind) -> str:
    return "float" if kind is ParameterKind.NUMBER else "str"


def _is_name(text: str) -> bool:
    return text.isidentifier() and not iskeyword(text)
