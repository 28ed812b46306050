"""Goal sentences that the grammar does not take, turned into conditions by a language model."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from fleet.core.model.skills import SkillModel
from fleet.language import Vocabulary
from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.quoting import cleaned
from fleet.llm.structured_output import StructuredAnswer, read_answer, schema_of
from fleet.planners.llm.prompt_text import vocabulary_text
from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, render_value
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Violation

MAX_CONDITIONS = 100
DERIVED = {LOCATED: "it is known where the object is", HELD: "a hand holds the object"}
READINGS_OF_AT = {ON: "it is on that thing", IN: "it is in that thing"}
"""Relations that follow from others; `keyexpr_schema.payloads.goals.Condition` says how."""

Stages = tuple[tuple[Condition, ...], ...]
_Signature = set[tuple[str, str | bool]]
"""What a relation takes: pairs of the subject's type, and the value's type or the value."""
_Signatures = Mapping[str, _Signature]


class ConditionAnswer(StructuredAnswer, frozen=True):
    """A `Condition`, with every field said."""

    relation: Id
    subject: Id
    value: str | bool
    any_of: tuple[Id, ...] = ()


class GoalAnswer(StructuredAnswer, frozen=True):
    """Stages of conditions, or why there are none."""

    stages: tuple[tuple[ConditionAnswer, ...], ...]
    reason: str = ""


class LlmInterpreter:
    """Turns a sentence into stages of conditions; asks within the budget of one plan."""

    def __init__(self, model: LanguageModel) -> None:
        self._model = model

    @property
    def waiting_s(self) -> float:
        """How long an answer takes at most, s."""
        return self._model.longest_s

    def interpret(
        self, sentence: str, vocabulary: Vocabulary, skills: Mapping[str, SkillModel]
    ) -> Stages | str:
        """What must hold, stage by stage, or a sentence that says why that is not known.

        `skills` say which relations there are. Every name in the result exists, and fits its
        relation. Blocks, and never raises.
        """
        signatures = _signatures(skills)
        stages: Stages | str | GivenUp = self._model.ask(
            system="interpret-system",
            question="interpret",
            correction="interpret-repair",
            values={
                "relations": "\n".join(f"- {_form(*each)}" for each in signatures.items()),
                "problem": vocabulary_text(sentence, vocabulary),
                "form": _FORM,
            },
            schema=schema_of(GoalAnswer),
            read=lambda text: _read(text, vocabulary, signatures),
        )
        return stages.reason if isinstance(stages, GivenUp) else stages


def _read(text: str, vocabulary: Vocabulary, signatures: _Signatures) -> Stages | str | Rejected:
    answer = read_answer(text, GoalAnswer)
    if isinstance(answer, str):
        return Rejected.because("malformed", answer)
    if not answer.stages:
        reason = cleaned(answer.reason).strip()
        return f"the language model says: {reason or 'this is no goal that can be expressed'}"
    rows = [row for stage in answer.stages for row in stage]
    if len(rows) > MAX_CONDITIONS or not all(answer.stages):
        sentence = f"every stage needs a condition, and all together at most {MAX_CONDITIONS}"
        return Rejected.because("malformed", sentence)
    violations = [v for row in rows for v in _type_errors(row, vocabulary, signatures)]
    for number, stage in enumerate(answer.stages, 1):
        violations += _contradictions(number, stage)
    if violations:
        return Rejected(tuple(violations))
    return tuple(tuple(_condition(row) for row in stage) for stage in answer.stages)


def _type_errors(
    row: ConditionAnswer, vocabulary: Vocabulary, signatures: _Signatures
) -> list[Violation]:
    signature = signatures.get(row.relation)
    if signature is None:
        known = ", ".join(signatures)
        sentence = f"there is no relation {row.relation}; there are {known}"
        return [Violation(code="unknown-name", sentence=sentence)]
    found: list[Violation] = []
    for subject in dict.fromkeys((row.subject, *row.any_of)):
        if (kind := _type_of(subject, vocabulary)) is None:
            names = (
                ", ".join([*vocabulary.objects, *vocabulary.places, *vocabulary.robots]) or "none"
            )
            sentence = f"{subject} is not a known name; known are {names}"
            found.append(Violation(code="unknown-name", sentence=sentence))
        elif not any(
            kind == subject_type and _fits(row.value, value_type, vocabulary)
            for subject_type, value_type in signature
        ):
            sentence = (
                f"{row.relation}({subject}) = {row.value} does not fit: {subject} is a {kind}, "
                f"and the relation is {_form(row.relation, signature)}"
            )
            found.append(Violation(code="wrong-type", sentence=sentence))
    return found


def _fits(value: str | bool, wanted: str | bool, vocabulary: Vocabulary) -> bool:
    if wanted in ("object", "place", "robot"):
        return isinstance(value, str) and _type_of(value, vocabulary) == wanted
    return value == wanted


def _type_of(name: str, vocabulary: Vocabulary) -> str | None:
    if name in vocabulary.robots:
        return "robot"
    if name in vocabulary.objects:
        return "object"
    return "place" if name in vocabulary.places else None


def _condition(row: ConditionAnswer) -> Condition:
    others = tuple(dict.fromkeys((row.subject, *row.any_of))) if row.any_of else ()
    any_of = others if len(others) > 1 else ()
    return Condition(relation=row.relation, subject=row.subject, value=row.value, any_of=any_of)


def _contradictions(number: int, stage: tuple[ConditionAnswer, ...]) -> list[Violation]:
    wanted: dict[tuple[str, str], str | bool] = {}
    found: list[Violation] = []
    for row in stage:
        if (
            not row.any_of
            and wanted.setdefault((row.relation, row.subject), row.value) != row.value
        ):
            sentence = f"stage {number} wants two values of {row.relation}({row.subject})"
            found.append(Violation(code="contradiction", sentence=sentence))
    return found


def _form(relation: str, signature: _Signature) -> str:
    """What a condition on the relation looks like."""
    forms = " or ".join(
        f"{relation}({subject}) = {render_value(value)}"
        for subject, value in sorted(signature, key=str)
    )
    about = DERIVED.get(relation) or READINGS_OF_AT.get(relation)
    return forms + (f": {about}" if about else "")


def _signatures(skills: Mapping[str, SkillModel]) -> dict[str, _Signature]:
    types: dict[str, _Signature] = {}
    for skill in skills.values():
        for (relation, subject), value in skill.after:
            if isinstance(value, str):
                # `holding = nothing` is a word; `at = to` a parameter of some type.
                values: tuple[str | bool, ...] = _bases(skill, value) or (value,)
            elif isinstance(value, bool):
                values = (value,)
            else:
                continue
            types.setdefault(relation, set()).update(product(_bases(skill, subject), values))
    if ("object", "object") in types.get(AT, ()):
        types |= {relation: {("object", "object")} for relation in READINGS_OF_AT}
    for relation in DERIVED:
        types[relation] = {("object", True)}
    return dict(sorted(types.items()))


def _bases(skill: SkillModel, parameter: str) -> tuple[str, ...]:
    return skill.types[parameter].bases if parameter in skill.types else ()


_FORM = """{"stages": [[{"relation": "RELATION", "subject": "NAME", "value": "NAME", \
"any_of": []}]], "reason": ""}"""
