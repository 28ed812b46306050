"""Answers to questions, from what is believed: with who said so, and how long ago."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msgspec.structs import replace

from fleet.core.believed import PLACED, believed, is_known, read_off
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.indexes.fact_views import FactValues
from fleet.core.model.abilities import brings_about
from fleet.core.model.derived import carriers, is_located
from fleet.core.state import State
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Question, read
from fleet.language.phrasing import Phrasing
from fleet.language.resolve.frames import ASK_IT, said_of
from keyexpr_schema.facts import AT, SEARCHED, FactKey
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.questions import AnsweredFact, QuestionQuery, QuestionReply
from keyexpr_schema.payloads.world import Fact

ANYBODY = "?"
"""In a question's conditions: each of those that it is asked of."""
MOST_NAMED = 20
STALE_S = 3600.0
"""What was said longer ago than this, in s, may well have changed since."""


def answer(state: State, asked: QuestionQuery) -> QuestionReply:
    """What is believed of what is asked; or why it is not understood."""
    try:
        reading = read(asked.text, state.vocabulary().spoken_by(asked.speaker))
    except NotUnderstood as error:
        return QuestionReply(reason=said_of(str(error), "a question", ASK_IT))
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
            if question.holds:
                return self._able_to(question.subjects, question.holds)
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
            offer=self._way_to_know(lost) or self._way_to_be_sure(subjects),
        )

    def _way_to_know(self, unknown: Sequence[str]) -> str | None:
        """The goal that would find out about those of which something is unknown: find them, or
        where it is known where they are, look around there, unless somebody has."""
        if lost := [name for name in dict.fromkeys(unknown) if not self._located(name)]:
            return f"find {_listed(lost)}"
        return _search(
            place
            for name in unknown
            for place in self._places_of(name)
            if self._values.get(FactKey(SEARCHED, place)) is not True
        )

    def _way_to_be_sure(self, subjects: Iterable[str]) -> str | None:
        """The goal that would look anew for things that were seen long ago."""
        return _search(
            place
            for name in subjects
            if (fact := self._state.facts.get(FactKey(AT, name))) is not None
            and name in self._state.objects
            and self._age_s(fact) >= STALE_S
            for place in self._places_of(name)
        )

    def _located(self, name: str) -> bool:
        return is_located(name, self._values.get, self._state)

    def _whereabouts(self, name: str) -> str:
        if name in self._state.places:
            return f"{self._named(name)} is a place"
        if not self._located(name):
            lost = self._state.facts.get(FactKey(AT, name))
            return f"nobody knows where {self._named(name)} is{self._heard(lost)}"
        around = list(carriers(name, self._values.get, self._state, aboard=True))
        there = ", ".join(self._at(each) for each in around) or "somewhere"
        fact = self._state.facts.get(FactKey(AT, name))
        away = name in self._state.robots and not self._state.connected.get(name)
        sure = self._heard(fact) if _told(fact) else " (where it belongs; nobody has said so)"
        return f"{self._named(name)} is {there}{sure}{', and is not connected' if away else ''}"

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
        age_s = self._age_s(fact)
        since = ", and not confirmed since" if age_s >= STALE_S and _told(fact) else ""
        return f" (said {_ago(age_s)} ago{told}{since})"

    def _ages(self, keys: Iterable[FactKey]) -> str:
        """How long ago was said what an answer about several rests on."""
        ages = [self._age_s(row) for key in keys if (row := self._state.facts.get(key))]
        if not ages:
            return ""
        first, last = _ago(min(ages)), _ago(max(ages))
        since = ", and not confirmed since" if min(ages) >= STALE_S else ""
        return f" (said {first if first == last else f'{first} to {last}'} ago{since})"

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
        open_ = [s for s, holds in rows.items() if holds is None] if question.subjects else []
        keys = [key for s in found for c in question.holds for key in read_off(_bound(c, s))]
        names = ", ".join(map(self._named, (found or open_)[:MOST_NAMED]))
        unseen = [] if question.subjects or found else self._not_searched(question.holds)
        text = f"yes: {names}{self._ages(keys)}" if found else "no"
        if open_ and not found:
            text = f"nobody knows of {names}"
        elif unseen:
            there = _listed(list(map(self._named, unseen)))
            text = f"none that is known, and nobody has searched {there}"
        return QuestionReply(
            answer=text,
            holds=True if found else None if open_ or unseen else False,
            subjects=tuple(found),
            facts=tuple(self._facts(keys)),
            offer=None if found else self._way_to_know(open_) or _search(unseen),
        )

    def _not_searched(self, conditions: Sequence[Condition]) -> list[str]:
        """Where something is asked for, as far as nobody has looked there: a container, or the
        place of anything else."""
        spots: dict[str, None] = {}
        for where in (c.value for c in conditions if c.relation in PLACED and not c.negated):
            thing = self._state.objects.get(str(where))
            if thing is None or thing.is_a("contains"):
                spots[str(where)] = None
            else:
                spots |= dict.fromkeys(self._places_of(thing.object))
        known = [spot for spot in spots if spot in (*self._state.places, *self._state.objects)]
        return [s for s in known if self._values.get(FactKey(SEARCHED, s)) is not True]

    def _places_of(self, name: str) -> list[str]:
        around = carriers(name, self._values.get, self._state, aboard=True)
        return [place for place in around if place in self._state.places]

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
        placed = [key.subject for key in keys if key.relation == AT]
        return QuestionReply(
            answer=f"{word}: {'; '.join(said)}" if said else word,
            holds=holds,
            facts=tuple(self._facts(keys)),
            offer=self._way_to_know(unknown) or self._way_to_be_sure(placed),
        )

    def _said(self, key: FactKey, asked: Condition) -> str:
        if key.relation == AT:
            return self._whereabouts(key.subject)
        fact = self._state.facts.get(key)
        row = replace(asked, relation=key.relation, subject=key.subject, any_of=())
        if fact is None or fact.value is None:
            return f"nobody knows whether {self._words.condition(row)}{self._heard(fact)}"
        return f"{self._words.condition(replace(row, value=fact.value))}{self._heard(fact)}"

    def _which(self, question: Question) -> QuestionReply:
        asked_of = self._persons if question.of == "who" else self._anybody
        subjects = question.subjects or asked_of(question.holds)
        rows = {subject: self._all(question.holds, subject) for subject in subjects}
        found = [subject for subject, holds in rows.items() if holds]
        open_ = [subject for subject, holds in rows.items() if holds is None]
        keys = [key for s in found for c in question.holds for key in read_off(_bound(c, s))]
        unseen = [] if question.subjects else self._not_searched(question.holds)
        names = ", ".join(map(self._named, found[:MOST_NAMED]))
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        none = "nobody that is known" if question.of == "who" else "none that is known"
        text = f"{names}{more}" if found else none
        if question.of == "how many":
            text = f"{len(found)}: {text}" if found else none if unseen else "none"
        text += self._ages(keys)
        if unseen:
            text += f"; nobody has searched {_listed(list(map(self._named, unseen)))}"
        if open_ and question.subjects:
            lost = ", ".join(map(self._named, open_[:MOST_NAMED]))
            text += f"; of {len(open_)} more nobody knows: {lost}"
        return QuestionReply(
            answer=text,
            subjects=tuple(found),
            facts=tuple(self._facts(keys)),
            offer=self._way_to_know(open_ if question.subjects else ()) or _search(unseen),
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
        rest = "; ".join(self._whereabouts(key.subject) for key in keys)
        lost = [key.subject for key in keys if not self._located(key.subject)]
        nobody = rest if len(lost) == len(keys) else f"nobody: {rest}"
        return QuestionReply(
            answer=f"{', '.join(said)}{self._ages(keys)}" if said else nobody,
            subjects=tuple(holders),
            facts=tuple(self._facts(keys)),
            offer=self._way_to_know(lost),
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

    def _able_to(self, robots: Sequence[str], wanted: Sequence[Condition]) -> QuestionReply:
        """Whether robots have skills by which that can come about: "can Dusty wash dishes?"."""
        state = self._state
        found: dict[str, None] = {}
        for robot in robots:
            own = [
                state.skills[name] for name in state.robots[robot].skills if name in state.skills
            ]
            for row in wanted:
                fit = [s.name for s in own if brings_about(s, row, state.robots)]
                if not fit:
                    able = self._able([robot])
                    no = f"no: no skill of {self._named(robot)} does that; it has {able.answer}"
                    return replace(able, answer=no, holds=False)
                found |= dict.fromkeys(fit)
        by = ", ".join(name.replace("_", " ") for name in found)
        names = " and ".join(map(self._named, robots))
        return QuestionReply(answer=f"yes: {names}, by {by}", holds=True, subjects=tuple(robots))

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


def _search(places: Iterable[str]) -> str | None:
    found = list(dict.fromkeys(places))
    return f"search {_listed(found)}" if found else None


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _told(fact: Fact | None) -> bool:
    return fact is not None and fact.value is not None


def _ago(seconds: float) -> str:
    for size_s, unit in ((86_400.0, "d"), (3_600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size_s:
            return f"{seconds / size_s:.0f} {unit}"
    return f"{seconds:.0f} s"
