"""Payloads about questions that people ask of the fleet."""

from __future__ import annotations

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload


class QuestionQuery(Payload, frozen=True, kw_only=True):
    """A question in words; `speaker` is the person who asks it: "my", "me"."""

    text: str
    speaker: Id | None = None


class AnsweredFact(Payload, frozen=True, kw_only=True):
    """What an answer rests on: who said it, and how long ago [s]; a value `None` is unknown."""

    relation: Id
    subject: Id
    value: Value
    source: str
    age_s: float


class QuestionReply(Payload, frozen=True, kw_only=True):
    """The answer in words, and what it rests on.

    `subjects` are those that the answer names: what is where it was asked of, who does something;
    `holds` is the answer to a question whether something is so, `None` where that is not known.
    `offer` is a goal, in words, that would find out. Without `answer`, the question was not
    understood: `reason` says why, and `candidates` what it can mean, if that is several things.
    """

    answer: str | None = None
    subjects: tuple[Id, ...] = ()
    holds: bool | None = None
    facts: tuple[AnsweredFact, ...] = ()
    offer: str | None = None
    reason: str | None = None
    candidates: tuple[str, ...] = ()
