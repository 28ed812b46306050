"""Conditions under which something is wanted: what holds then, and what does not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec.structs import replace as changed

from fleet.errors import NotUnderstood
from fleet.language.refusals import Misused
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.scene import Question
from fleet.language.sentences.segments import Segment
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import AT, LOCATED, FactKey, Value
from keyexpr_schema.payloads.goals import Condition


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
        if rows[1:] and _of_several(rows, segment):
            return [negation_of(row) for row in rows]  # "if the plates are not in the cupboard"
        if rows[1:]:
            raise NotUnderstood(
                f"{_quoted(segment)} is several things, and it is not said which of them does not "
                "hold: say them one by one"
            )
        return [negation_of(rows[0])]
    return list(rows)


def _of_several(rows: Sequence[Condition], segment: Segment) -> bool:
    """Whether one clause says the same of several things, none of which it is so of."""
    said = [word for word in segment.words if "BE" in word.tags]
    same = {(row.relation, row.value, row.negated) for row in rows}
    each = any("UNIV" in word.tags for word in segment.words)  # "all plates are not …": some?
    return len(same) == 1 and len(said) < 2 and not each and segment.role != "unless"


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


def existing(
    question: Question | None, segment: Segment, vocabulary: Vocabulary
) -> list[Condition]:
    """`there is a cup in the kitchen`: that one of those is so of whom it can be said; of nobody in
    particular, of all persons or things.

    Raises:
        NotUnderstood: see `rows_for`; or it asks something else.
    """
    if question is None or question.of not in ("whether", "who") or len(question.holds) != 1:
        raise NotUnderstood(f"{_quoted(segment)} says nothing that can hold or not")
    (row,) = question.holds
    meant = question.subjects
    if row.subject == "?" and not meant:
        who = question.of == "who"
        persons = filter(vocabulary.is_person, vocabulary.objects)
        meant = tuple(sorted(persons if who else vocabulary.movable))
    if row.subject != "?" or not meant:
        raise NotUnderstood(f"{_quoted(segment)}: nobody is known of whom that could be said")
    one, *more = meant
    any_of = meant if more else ()
    return rows_for([changed(row, subject=one, any_of=any_of)], segment)


def otherwise(said: Discourse) -> None:
    """Want what follows where the condition of the goal before does not hold.

    Raises:
        NotUnderstood: that has no condition, or several.
    """
    last = said.goals[-1] if said.goals else None
    if last is None or not all(said.asked) or not said.asked:
        raise NotUnderstood(
            "'otherwise' belongs to no condition: say \"if …\" before it, with what holds then"
        )
    if said.asked[1:] and any(rows[1:] for rows in said.asked):
        raise NotUnderstood(
            "'otherwise' belongs to several conditions, and it is not said which of them does not "
            'hold: say "if …" once more'
        )
    if said.asked[1:]:
        said.only_if = [negation_of(row) for rows in said.asked for row in rows]
    else:  # not both: the first does not hold, or it does and the second does not
        said.either = [(negation_of(row),) for row in said.asked[0]]
    said.when, said.whenever = list(last.when), list(last.whenever)
    said.otherwise = True


def one_is_enough(rows: Sequence[Sequence[Condition]], said: Discourse, segment: Segment) -> None:
    """Take conditions of which one is enough: "the fridge or the oven is open".

    Raises:
        NotUnderstood: a goal cannot wait for one of these.
    """
    if segment.role == "unless":
        said.only_if.extend(row for each in rows for row in each)
        return
    kinds = {(row.relation, row.value, row.negated) for each in rows for row in each}
    single = all(len(each) == 1 for each in rows)
    if single and len(kinds) == 1 and not rows[0][0].negated:
        names = tuple(dict.fromkeys(name for (row,) in rows for name in row.subjects))
        one = changed(rows[0][0], subject=names[0], any_of=names if names[1:] else ())
        said.conditions_of(segment.role).append(one)
        return
    if segment.role != "if" or not single or said.either:
        raise NotUnderstood(
            f"{_quoted(segment)} is one thing or another: say it as goals of their own"
        )
    said.either = [tuple(each) for each in rows]


def _quoted(segment: Segment) -> str:
    return repr(" ".join(word.text for word in segment.words))
