"""What a whole text means: one reading, or the question which of several."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from fleet.errors import NotUnderstood
from fleet.language.reader import CHOICES, Reader
from fleet.language.reading import Ambiguity, Reading, WantedGoal
from fleet.language.refusals import shortened
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import Literal


def read(text: str, vocabulary: Vocabulary, now: datetime | None = None) -> Reading | Ambiguity:
    """What a text asks for, says, or asks; of several meanings the plainest.

    `now` is what the clock says, with its zone, for times of day.

    Raises:
        NotUnderstood: it means nothing here; one sentence says why.
    """
    return _one(_readings(Reader(text, vocabulary), now))


def _readings(reader: Reader, now: datetime | None = None) -> Sequence[tuple[int, str, Reading]]:
    """All that it can mean; a refusal of it repeats no long text."""
    try:
        return reader.read(now)
    except NotUnderstood as refused:
        said = shortened(str(refused))
        if said == str(refused):
            raise
        raise NotUnderstood(said) from None


def _one(readings: Sequence[tuple[int, str, Reading]]) -> Reading | Ambiguity:
    least, asked = readings[0][:2]
    best = [reading for cost, _, reading in readings if cost == least]
    if len(best) == 1:
        return best[0]
    candidates = tuple((each.understood_as, each) for each in best[:CHOICES])
    return Ambiguity(best[0].text, candidates, asked)


def read_goal(text: str, vocabulary: Vocabulary) -> Reading:
    """What a text asks for, where it asks for one goal that is to be reached once.

    Raises:
        NotUnderstood: a word was not understood, or the text contradicts itself; one sentence.
    """
    reading = _one(_readings(Reader(text, vocabulary, "goal")))
    if isinstance(reading, Ambiguity):
        raise NotUnderstood(reading.sentence)
    if reading.facts or any(goal != WantedGoal(goal.stages, priority=goal.priority)
                            for goal in reading.goals):  # fmt: skip
        raise NotUnderstood(f"{reading.text!r} says more than what shall be reached: leave it out")
    return reading


def statement_facts(text: str, vocabulary: Vocabulary) -> tuple[Literal, ...]:
    """The facts in a statement, where the value `None` is *unknown*.

    Raises:
        NotUnderstood: a word was not understood, or the text contradicts itself; one sentence.
    """
    reading = _one(_readings(Reader(text, vocabulary, "fact")))
    if isinstance(reading, Ambiguity):
        raise NotUnderstood(reading.sentence)
    return reading.facts
