"""Conditions under which something is wanted: what holds then, and what does not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from msgspec.structs import replace as changed

from fleet.errors import NotUnderstood
from fleet.language.refusals import Misused
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.scene import Question
from fleet.language.sentences.segments import Segment
from fleet.language.tagging.tagger import Lexeme
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import AT, LOCATED, FactKey, Value
from keyexpr_schema.payloads.goals import Condition

_AUXILIARY = frozenset({"BE", "HAVE", "MODAL", "DO"})


def negation_of(row: Condition) -> Condition:
    """What holds where a condition does not: of one truth value, the other."""
    if isinstance(row.value, bool) and not row.any_of[1:]:
        return changed(row, value=not row.value)
    return changed(row, negated=not row.negated)


def conditions_of(
    told: Iterable[tuple[FactKey, Value]], segment: Segment, vocabulary: Vocabulary
) -> list[Condition]:
    """What must hold for a clause after "if" and the like, of what it tells."""
    rows = []
    for (relation, subject), value in dict(told).items():
        if relation == AT and value is None:
            relation, value = LOCATED, False
        elif relation == AT:
            relation = vocabulary.relation_to(str(value))
        rows.append(Condition(relation=relation, subject=subject, value=value))
    return rows_for(rows, segment)


def rows_for(rows: Sequence[Condition], segment: Segment) -> list[Condition]:
    """The conditions as the clause means them, negated or not.

    Raises:
        NotUnderstood: it tells of none, or says that of several not all hold: which of them must
            not is not said.
    """
    if not rows:
        raise NotUnderstood(f"{_quoted(segment)} says nothing that can hold or not")
    if segment.negated is not (segment.role == "unless"):
        if rows[1:]:
            raise NotUnderstood(
                f"{_quoted(segment)} is several things, and it is not said which of them does not "
                "hold: say them one by one"
            )
        return [negation_of(rows[0])]
    return list(rows)


def found(
    rows: Sequence[Condition], segment: Segment, wanted: Iterable[Iterable[Condition]]
) -> list[Condition]:
    """`you find it`: that it is known where it is; that it is not, after a search for it only.

    `wanted` are the stages of what comes before.

    Raises:
        Misused: nobody has looked for it, so that there is no moment at which it is not found.
    """
    sought = {n for stage in wanted for c in stage if c.relation == LOCATED for n in c.subjects}
    rows = [Condition(relation=LOCATED, subject=row.subject, any_of=row.any_of, value=True)
            for row in rows]  # fmt: skip
    lost = segment.negated is not (segment.role == "unless")
    if lost and not all(sought.issuperset(row.subjects) for row in rows):
        raise Misused(
            f'{_quoted(segment)}: nothing before it says to look for that: say "look for …" first'
        )
    return rows_for(rows, segment)


def existing(question: Question | None, segment: Segment) -> list[Condition]:
    """`there is a cup in the kitchen`: that one of those is so of whom it can be said.

    Raises:
        NotUnderstood: see `rows_for`; or it asks something else.
    """
    if question is None or question.of != "whether" or len(question.holds) != 1:
        raise NotUnderstood(f"{_quoted(segment)} says nothing that can hold or not")
    (row,) = question.holds
    one, *more = question.subjects
    any_of = question.subjects if more else ()
    return rows_for([changed(row, subject=one, any_of=any_of)], segment)


def in_other_words(segment: Segment) -> Iterator[Segment]:
    """How a condition can be read that is not read as it is: as a question, and without "not"."""
    without = _affirmed(segment)
    yield from filter(None, (_asked(segment), without and _asked(without), without))


def _affirmed(segment: Segment) -> Segment | None:
    """The same without its one negation: "the cup is not in the kitchen" as "is in the kitchen"."""
    words: list[Lexeme] = []
    count = 0
    for i, word in enumerate(segment.words):
        before = segment.words[i - 1].tags if i else frozenset()
        if "NOT" in word.tags and (before & _AUXILIARY or not i):
            count += 1
            if "MODAL" in before:
                words.pop()  # "if you cannot find it"
        elif "DONT" in word.tags and "PEOPLE" in before:
            count += 1
        elif "NONE" in word.tags and "BE" in before:
            count += 1
            words.append(replace(word, words=("a",), tags=frozenset({"INDEF"})))
        else:
            words.append(word)
    return replace(segment, words=tuple(words), negated=True) if count == 1 else None


def _asked(segment: Segment) -> Segment | None:
    """`there is a cup in the kitchen` as the question whether there is."""
    words = segment.words
    if len(words) < 3 or "THERE" not in words[0].tags or "BE" not in words[1].tags:
        return None
    is_ = replace(words[1], words=("is",), tags=frozenset({"ISARE"}))
    return replace(segment, words=(is_, words[0], *words[2:]))


def otherwise(said: Discourse) -> None:
    """Want what follows where the condition of the goal before does not hold.

    Raises:
        NotUnderstood: that has no condition, or several.
    """
    last = said.goals[-1] if said.goals else None
    if last is None or not last.only_if:
        raise NotUnderstood(
            "'otherwise' belongs to no condition: say \"if …\" before it, with what holds then"
        )
    if last.only_if[1:]:
        raise NotUnderstood(
            "'otherwise' belongs to several conditions, and it is not said which of them does not "
            'hold: say "if …" once more'
        )
    said.only_if = [negation_of(last.only_if[0])]
    said.when, said.whenever = list(last.when), list(last.whenever)
    said.otherwise = True


def _quoted(segment: Segment) -> str:
    return repr(" ".join(word.text for word in segment.words))
