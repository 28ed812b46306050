"""Goal sentences that the grammar does not take, read by a language model."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

from fleet.core.model.skills import SkillModel
from fleet.language import Vocabulary
from fleet.llm.client import ModelCaller
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import Conversation, GivenUp, Ledger, Rejected
from fleet.llm.prompts import load_prompts
from fleet.llm.quoting import cleaned
from fleet.planners.llm.answers import Answer, read_answer, schema_of
from fleet.planners.llm.prompt_text import vocabulary_text
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)

MAX_CONDITIONS = 100
DERIVED = {"located": "it is known where the object is", "held": "a hand holds the object"}
"""Relations that follow from others; `keyexpr_schema.payloads.goals.Condition` says how."""

Stages = tuple[tuple[Condition, ...], ...]


class ConditionAnswer(Answer, frozen=True):
    """A `Condition`, with every field said."""

    relation: Id
    subject: Id
    value: str | bool
    any_of: tuple[Id, ...] = ()


class GoalAnswer(Answer, frozen=True):
    """Stages of conditions, or why there are none."""

    stages: tuple[tuple[ConditionAnswer, ...], ...]
    reason: str = ""


@dataclass(frozen=True)
class _Relation:
    """What a relation takes: pairs of a subject's kind and a value's kind or the value itself."""

    rows: frozenset[tuple[str, str | bool]]

    def told(self, name: str) -> str:
        """The relation as a line of the prompt."""
        forms = " or ".join(
            f"{name}({subject}) = {str(value).lower() if value is True else value}"
            for subject, value in sorted(self.rows, key=str)
        )
        about = DERIVED.get(name)
        return f"- {forms}" + (f": {about}" if about else "")


class LlmInterpreter:
    """Turns a sentence into stages of conditions; asks within the budget of one plan."""

    def __init__(
        self,
        config: LlmConfig,
        skills: Mapping[str, SkillModel],
        caller: ModelCaller | None = None,
    ) -> None:
        """`skills` say which relations there are; `caller` can be shared with a planner.

        Raises:
            BadLlmConfig: the prompts that the configuration asks for cannot be used.
        """
        self._config = config
        self._prompts = load_prompts(config)
        self._relations = _relations(skills)
        self._caller = caller or ModelCaller()
        self._conversation = Conversation(config, self._prompts, self._caller)

    @property
    def configured(self) -> bool:
        """Whether there is a model to ask."""
        return self._config.not_configured is None

    def close(self) -> None:
        """Stop asking: a call that is under way ends at once, and says so."""
        self._caller.close()

    def interpret(self, text: str, vocabulary: Vocabulary) -> Stages | str:
        """What must hold, stage by stage, or a sentence that says why that is not known.

        Every name in the result exists, and fits its relation. Blocks, and never raises.
        """
        if told := self._config.not_configured:
            return told

        def read(said: str) -> Stages | str | Rejected:
            return self._read(said, vocabulary)

        try:
            made: Stages | str | GivenUp = self._conversation.ask(
                system=self._prompts.fill("interpret-system"),
                question=self._prompts.fill(
                    "interpret",
                    relations="\n".join(row.told(name) for name, row in self._relations.items()),
                    problem=vocabulary_text(text, vocabulary),
                    form=_FORM,
                ),
                repair="interpret-repair",
                schema=schema_of(GoalAnswer),
                read=read,
                ledger=Ledger(self._config),
            )
        except Exception as error:
            log.exception("interpreting a goal by language model")
            return f"reading the answer failed: {error or type(error).__name__}"
        return made.reason if isinstance(made, GivenUp) else made

    def _read(self, said: str, words: Vocabulary) -> Stages | str | Rejected:
        answer = read_answer(said, GoalAnswer)
        if isinstance(answer, str):
            return Rejected.because("malformed", answer)
        if not answer.stages:
            reason = cleaned(answer.reason).strip()
            return f"the language model says: {reason or 'this is no goal that can be expressed'}"
        rows = [row for stage in answer.stages for row in stage]
        if len(rows) > MAX_CONDITIONS or not all(answer.stages):
            sentence = f"every stage needs a condition, and all together at most {MAX_CONDITIONS}"
            return Rejected.because("malformed", sentence)
        violations = [v for row in rows for v in self._wrong(row, words)]
        for number, stage in enumerate(answer.stages, 1):
            violations += _contradictions(number, stage)
        if violations:
            return Rejected(tuple(violations))
        return tuple(tuple(_condition(row) for row in stage) for stage in answer.stages)

    def _wrong(self, row: ConditionAnswer, words: Vocabulary) -> list[Violation]:
        relation = self._relations.get(row.relation)
        if relation is None:
            known = ", ".join(self._relations)
            sentence = f"there is no relation {row.relation}; there are {known}"
            return [Violation(code="unknown-name", sentence=sentence)]
        found: list[Violation] = []
        for subject in dict.fromkeys((row.subject, *row.any_of)):
            if (kind := _kind(subject, words)) is None:
                names = ", ".join([*words.objects, *words.places, *words.robots]) or "none"
                sentence = f"{subject} is not a known name; known are {names}"
                found.append(Violation(code="unknown-name", sentence=sentence))
            elif not any(
                kind == wanted
                and (row.value is value or row.value == value or _fits(row.value, value, words))
                for wanted, value in relation.rows
            ):
                sentence = (
                    f"{row.relation}({subject}) = {row.value} does not fit: {subject} is a {kind}, "
                    f"and the relation is {relation.told(row.relation).removeprefix('- ')}"
                )
                found.append(Violation(code="wrong-type", sentence=sentence))
        return found


def _fits(value: str | bool, kind: str | bool, words: Vocabulary) -> bool:
    return isinstance(value, str) and kind is not True and _kind(value, words) == kind


def _kind(name: str, words: Vocabulary) -> str | None:
    if name in words.robots:
        return "robot"
    if name in words.objects:
        return "object"
    return "place" if name in words.places else None


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


def _relations(skills: Mapping[str, SkillModel]) -> dict[str, _Relation]:
    rows: dict[str, set[tuple[str, str | bool]]] = {}
    for skill in skills.values():
        for relation, subject, value in skill.after:
            if isinstance(value, str):
                # `holding = nothing` is a word; `at = to` a parameter of some type.
                shown: str | bool = skill.parameters.get(value, value)
            elif value is True:
                shown = True
            else:
                continue
            rows.setdefault(relation, set()).add((skill.parameters[subject], shown))
    for relation in DERIVED:
        rows[relation] = {("object", True)}
    return {name: _Relation(frozenset(rows[name])) for name in sorted(rows)}


_FORM = """{"stages": [[{"relation": "RELATION", "subject": "NAME", "value": "NAME", \
"any_of": []}]], "reason": ""}"""
