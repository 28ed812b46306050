"""Answers to questions, from what is believed: with who said so, and how long ago."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msgspec.structs import replace

from fleet.core.believed import PLACED, believed, is_known, read_off
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.indexes.fact_views import FactValues
from fleet.core.model.derived import carriers, is_located
from fleet.core.state import State
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Question, read
from fleet.language.phrasing import Phrasing
from keyexpr_schema.facts import AT, SEARCHED, FactKey
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.questions import AnsweredFact, QuestionQuery, QuestionReply
from keyexpr_schema.payloads.world import Fact

ANYBODY = "?"
"""In a question's conditions: each of those that it is asked of."""
MOST_NAMED = 20


def answer(state: State, asked: QuestionQuery) -> QuestionReply:
    """What is believed of what is asked; or why it is not understood."""
    try:
        reading = read(asked.text, state.vocabulary().spoken_by(asked.speaker))
    except NotUnderstood as error:
        return QuestionReply(reason=str(error))
    if isinstance(reading, Ambiguity):
        candidates = tuple(words for words, _ in reading.candidates)
        return QuestionReply(reason=reading.sentence, candidates=candidates)
    if reading.question is None:
        return QuestionReply(
            reason=f"{asked.text!r} is no question: a goal is given with `robotctl goal add`, "
            "a fact with `robotctl world add`"
        )
    return _Answers(state).to(reading.question)


class _Answers:
    """What is believed in one state."""

    def __init__(self, state: State) -> None:
        self._state = state
        self._values = FactValues(state.facts)
        self._words = Phrasing(state.vocabulary())

    def to(self, question: Question) -> QuestionReply:
        """What is believed of what is asked."""
        if question.of == "where":
            return self._where(question.subjects)
        if question.of == "what doing":
            return self._doing(question.subjects)
        if question.of == "what able":
            return self._able(question.subjects)
        if question.of == "whether":
            return self._whether(question)
        if question.of == "who" and any(c.value == ANYBODY for c in question.holds):
            return self._who_has(question.holds)
        return self._which(question)

    # --- where ------------------------------------------------------------------------------------
    def _where(self, subjects: Sequence[str]) -> QuestionReply:
        rows = [self._whereabouts(subject) for subject in subjects]
        lost = [s for s in subjects if not self._located(s)]
        return QuestionReply(
            answer="; ".join(rows),
            subjects=tuple(subjects),
            facts=tuple(self._facts(FactKey(AT, subject) for subject in subjects)),
            offer=self._way_to_know(lost),
        )

    def _way_to_know(self, unknown: Sequence[str]) -> str | None:
        """The goal that would find out about those of which something is unknown: find them, or
        where it is known where they are, look around there, unless somebody has."""
        if lost := [name for name in dict.fromkeys(unknown) if not self._located(name)]:
            return f"find {_listed(lost)}"
        places = {
            place: None
            for name in unknown
            for place in carriers(name, self._values.get, self._state, aboard=True)
            if place in self._state.places
            and self._values.get(FactKey(SEARCHED, place)) is not True
        }
        return f"search {_listed(list(places))}" if places else None

    def _located(self, name: str) -> bool:
        return is_located(name, self._values.get, self._state)

    def _whereabouts(self, name: str) -> str:
        if name in self._state.places:
            return f"{self._named(name)} is a place"
        if not self._located(name):
            return f"nobody knows where {self._named(name)} is"
        around = list(carriers(name, self._values.get, self._state, aboard=True))
        there = ", ".join(self._at(each) for each in around) or "somewhere"
        fact = self._state.facts.get(FactKey(AT, name))
        return f"{self._named(name)} is {there}{self._heard(fact)}"

    def _at(self, carrier: str) -> str:
        state = self._state
        if carrier in state.robots:
            return f"with {self._named(carrier)}"
        thing = state.objects.get(carrier)
        if thing is None:
            return f"in {self._named(carrier)}"
        if thing.is_a("person"):
            return f"with {self._named(carrier)}"
        return f"{'in' if thing.is_a('contains') else 'on'} {self._named(carrier)}"

    def _named(self, name: str) -> str:
        return self._words.named(name)

    def _heard(self, fact: Fact | None) -> str:
        if fact is None:
            return ""
        name = fact.source.removeprefix(f"{PLANNER_SOURCE}:")
        words = self._state.statements.get(name) or self._state.goals.get(name)
        told = f": “{words.text}”" if words is not None else f" by {fact.source}"
        return f" (said {_ago(self._age_s(fact))} ago{told})"

    def _age_s(self, fact: Fact) -> float:
        return max(0.0, self._state.time_s - fact.time_s)

    def _facts(self, keys: Iterable[FactKey]) -> Iterator[AnsweredFact]:
        for key in dict.fromkeys(keys):
            fact = self._state.facts.get(key)
            if fact is not None:
                yield AnsweredFact(
                    relation=fact.relation,
                    subject=fact.subject,
                    value=fact.value,
                    source=fact.source,
                    age_s=round(self._age_s(fact), 3),
                )

    # --- whether, which, how many ----------------------------------------------------------------
    def _whether_any(self, question: Question) -> QuestionReply:
        """Whether it is so of any of those that it is asked of: "are there any clean cups?"."""
        asked_of = self._persons if question.of == "who" else self._anybody
        subjects = question.subjects or asked_of(question.holds)
        rows = {subject: self._all(question.holds, subject) for subject in subjects}
        found = [subject for subject, holds in rows.items() if holds]
        open_ = [subject for subject, holds in rows.items() if holds is None]
        keys = [key for s in found for c in question.holds for key in read_off(_bound(c, s))]
        names = ", ".join(map(self._named, (found or open_)[:MOST_NAMED]))
        unsure = open_ and question.subjects
        text = f"yes: {names}" if found else f"nobody knows of {names}" if unsure else "no"
        return QuestionReply(
            answer=text,
            holds=True if found else None if unsure else False,
            subjects=tuple(found),
            facts=tuple(self._facts(keys)),
            offer=f"find {open_[0]}" if unsure and not found else None,
        )

    def _whether(self, question: Question) -> QuestionReply:
        if any(condition.subject == ANYBODY for condition in question.holds):
            return self._whether_any(question)
        found = [believed(self._state, condition) for condition in question.holds]
        holds = False if False in found else None if None in found else True
        asked = [(key, row) for row in question.holds for key in read_off(row)]
        keys = [key for key, _ in asked]
        word = {True: "yes", False: "no", None: "nobody knows"}[holds]
        said = [self._said(key, row) for key, row in asked]
        if len(said) == 1 and holds is None and said[0].startswith(word):
            word, said = said[0], []
        unknown = [key.subject for key in keys if not is_known(self._state, key)]
        return QuestionReply(
            answer=f"{word}: {'; '.join(said)}" if said else word,
            holds=holds,
            facts=tuple(self._facts(keys)),
            offer=self._way_to_know(unknown),
        )

    def _said(self, key: FactKey, asked: Condition) -> str:
        if key.relation == AT:
            return self._whereabouts(key.subject)
        fact = self._state.facts.get(key)
        row = replace(asked, relation=key.relation, subject=key.subject, any_of=())
        if fact is None or fact.value is None:
            return f"nobody knows whether {self._words.condition(row)}"
        return f"{self._words.condition(replace(row, value=fact.value))}{self._heard(fact)}"

    def _which(self, question: Question) -> QuestionReply:
        asked_of = self._persons if question.of == "who" else self._anybody
        subjects = question.subjects or asked_of(question.holds)
        rows = {subject: self._all(question.holds, subject) for subject in subjects}
        found = [subject for subject, holds in rows.items() if holds]
        open_ = [subject for subject, holds in rows.items() if holds is None]
        names = ", ".join(map(self._named, found[:MOST_NAMED]))
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        text = f"{len(found)}: {names}{more}" if found else "none"
        if question.of != "how many":
            none = "nobody" if question.of == "who" else "none"
            text = f"{names}{more}" if found else f"{none} that is known"
        if open_ and question.subjects:
            lost = ", ".join(map(self._named, open_[:MOST_NAMED]))
            text += f"; of {len(open_)} more nobody knows: {lost}"
        keys = [key for s in found for c in question.holds for key in read_off(_bound(c, s))]
        return QuestionReply(
            answer=text,
            subjects=tuple(found),
            facts=tuple(self._facts(keys)),
            offer=self._way_to_know(open_) if question.subjects else None,
        )

    def _anybody(self, conditions: Sequence[Condition]) -> list[str]:
        relations = {AT if c.relation in PLACED else c.relation for c in conditions}
        names = [key.subject for key in self._state.facts if key.relation in relations]
        return sorted(dict.fromkeys(names))

    def _persons(self, _: Sequence[Condition]) -> list[str]:
        people = filter(self._words.vocabulary.is_person, self._state.objects)
        return [*sorted(self._state.robots), *sorted(people)]

    def _all(self, conditions: Sequence[Condition], subject: str) -> bool | None:
        found = [believed(self._state, _bound(condition, subject)) for condition in conditions]
        return False if False in found else None if None in found else True

    def _who_has(self, conditions: Sequence[Condition]) -> QuestionReply:
        keys = [key for condition in conditions for key in read_off(condition)]
        is_person = self._words.vocabulary.is_person
        holders: list[str] = []
        for key in keys:
            around = carriers(key.subject, self._values.get, self._state, aboard=True)
            holders += [c for c in around if c in self._state.robots or is_person(c)]
        said = [self._named(holder) for holder in holders]
        rest = [self._whereabouts(key.subject) for key in keys] if not said else []
        return QuestionReply(
            answer=", ".join(said) or f"nobody: {'; '.join(rest)}",
            subjects=tuple(holders),
            facts=tuple(self._facts(keys)),
        )

    # --- what somebody can do ---------------------------------------------------------------------
    def _able(self, subjects: Sequence[str]) -> QuestionReply:
        """The skills of robots, and the tasks that have names."""
        specs = {name: self._state.robots[name] for name in subjects or sorted(self._state.robots)}
        rows = [
            f"{self._named(name)}: {', '.join(skill.replace('_', ' ') for skill in spec.skills)}"
            for name, spec in specs.items()
        ]
        if not subjects and (tasks := [task.shown for task in self._state.policy.tasks]):
            rows.append(f"tasks with names: {', '.join(tasks[:MOST_NAMED])} (`robotctl tasks`)")
        return QuestionReply(answer="; ".join(rows) or "no robot is known", subjects=tuple(specs))

    # --- what doing ------------------------------------------------------------------------------
    def _doing(self, subjects: Sequence[str]) -> QuestionReply:
        robots = subjects or sorted(self._state.robots)
        work: dict[str, list[str]] = {robot: [] for robot in robots}
        for plan, entry in self._state.plans.items():
            for record in entry.outstanding():
                if record.robot in work:
                    args = ", ".join(v for v in record.args.values() if v != record.robot)
                    work[record.robot].append(f"{record.skill}({args}) for {plan}")
        rows = [f"{robot}: {', '.join(tasks) or 'nothing'}" for robot, tasks in work.items()]
        return QuestionReply(answer="; ".join(rows) or "no robot is known", subjects=tuple(robots))


def _bound(condition: Condition, subject: str) -> Condition:
    if condition.subject != ANYBODY:
        return condition
    return replace(condition, subject=subject, any_of=())


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _ago(seconds: float) -> str:
    for size_s, unit in ((86_400.0, "d"), (3_600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size_s:
            return f"{seconds / size_s:.0f} {unit}"
    return f"{seconds:.0f} s"
