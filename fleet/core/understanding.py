"""What goals' sentences are understood to mean: what must hold, and what besides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, tzinfo

from msgspec.structs import replace

from fleet.core.confirmation import to_confirm
from fleet.core.indexes.fact_views import FactValues
from fleet.core.model.declarations import misfit, relations_of
from fleet.core.model.derived import holds
from fleet.core.model.recurrence import recurrence_of, said_at
from fleet.core.standing import EACH_DUE_SINCE_LOGIC, is_repeated, wanted_by
from fleet.core.state import State
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, Vocabulary, WantedGoal, read
from fleet.language.phrasing import Phrasing
from fleet.language.refusals import nearest
from keyexpr_schema.facts import LOCATED, NOTHING, Value
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus

NO_READING = Reading("")
_Words = tuple[Vocabulary, datetime | None]


@dataclass(frozen=True)
class Understood:
    """A goal as its sentence is read now: how it stands, and what of it is in force.

    `goal` is what was put with what the sentence adds to it: what must always or never hold, how
    urgent it is, when it is due, when it may begin. `parts` are the goals that it is, each with
    what it means, where they are several. `unread`: the grammar refuses it, and no language model
    has been asked to say it in other words.
    """

    status: GoalStatus
    goal: Goal
    reading: Reading = NO_READING
    parts: tuple[tuple[Goal, GoalStatus], ...] = ()
    unread: bool = False


def understood(
    state: State, goal: Goal, known: GoalStatus | None, asked: GoalStatus | None = None
) -> Understood:
    """What a goal that was put means; `known` is how it stood, if it is not a new one.

    `asked` is how it stood when a language model had been asked about the same words.
    """
    status = GoalStatus(
        goal=goal.goal,
        state=GoalState.WAITING,
        given_s=state.time_s if known is None else known.given_s,
        given_wall_s=state.wall_time_s if known is None else known.given_wall_s,
    )
    if known is not None and known.state is GoalState.STANDING:  # under an earlier planner
        status = replace(
            status,
            next_s=known.next_s,
            runs=known.runs,
            holds=known.holds,
            again=known.again,
            queued_s=known.queued_s,
            latest=known.latest,
            latest_s=known.latest_s,
            missed=known.missed,
            skipped=known.skipped,
        )
    try:
        words = _words_of(state, goal)
    except NotUnderstood as error:
        return Understood(_rejected(status, str(error)), goal)
    try:
        found = _reading(goal, goal.text, words)
    except NotUnderstood as error:
        return _in_other_words(state, goal, words, status, str(error), asked)
    try:
        return _taken(state, goal, status, found)
    except NotUnderstood as error:
        return Understood(_rejected(status, str(error)), goal)


def _taken(state: State, goal: Goal, status: GoalStatus, found: Reading | Ambiguity) -> Understood:
    """What becomes of a goal that can be read.

    Raises:
        NotUnderstood: it is nothing that the fleet can carry out.
    """
    if isinstance(found, Ambiguity):
        words = tuple(words for words, _ in found.candidates)
        return Understood(_rejected(replace(status, candidates=words), found.sentence), goal)
    wanted = wanted_goals(found)
    said_s = goal.said_s or status.given_s or 0.0
    parts = [(_in_force(goal, each, said_s), _means(status, each)) for each in wanted]
    for part, means in parts:
        _check(state, part, means, due_as_said=goal.due_s is None)
    schedule = state.schedules.get(goal.goal)
    if schedule is not None and wanted_by(schedule) == goal:
        _check_schedule(goal, [part for part, _ in parts])
    said = None if goal.conditions else Phrasing(state.vocabulary()).reading(found)
    read = {"understood": said, "note": _note(state, found)}
    if len(parts) > 1:
        status = replace(status, state=GoalState.STANDING, **read)
        whole = Goal(goal=goal.goal, text=goal.text, ordinal=goal.ordinal, said_s=goal.said_s)
        return Understood(status, whole, found, tuple(parts))
    ((whole, status),) = parts
    return Understood(replace(status, **read), whole, found)


def _means(status: GoalStatus, wanted: WantedGoal) -> GoalStatus:
    first = wanted.stages[0] if wanted.stages else ()
    return replace(status, conditions=first, stages=wanted.stages)


def _check(state: State, goal: Goal, means: GoalStatus, due_as_said: bool) -> None:
    """Whether the fleet can carry out what a goal means, as far as names and times tell.

    `due_as_said`: when it is due, its sentence says, which may be a time of day.

    Raises:
        NotUnderstood: it cannot; one sentence.
    """
    for stage in means.stages:
        for condition in stage:
            _check_condition(state, condition)
            _check_not_negated(condition)
    for condition in goal.constraints:
        _check_not_negated(condition)
    for condition in (*goal.constraints, *goal.when, *goal.only_if, *goal.whenever):
        _check_relation(state, condition)
        _check_condition(state, condition)
    zones = state.time_zones()
    said_at(goal, zones)
    if is_repeated(goal):
        _check_repeated(goal, means, zones)
        if goal.due_s is not None and (due_as_said or state.logic < EACH_DUE_SINCE_LOGIC):
            raise NotUnderstood(
                f"{goal.text!r} says when it is due, and that it is done again and again: say "
                "when it is begun"
            )
    for robot in goal.by:
        if robot not in state.robots:
            known = nearest(sorted(state.robots), robot)
            raise NotUnderstood(f"{robot!r}, who shall do it, is no robot; known are {known}")


def _check_schedule(goal: Goal, parts: list[Goal]) -> None:
    """Whether what was put as a schedule is one.

    Raises:
        NotUnderstood: it is not; one sentence.
    """
    if len(parts) > 1:
        raise NotUnderstood(
            f"{goal.text!r} is several goals, each with a time or condition of its own: make a "
            "schedule of each"
        )
    if parts[0].every is None:
        raise NotUnderstood(
            f"{goal.text!r} does not say how often: say it in words, such as “every morning”, or "
            "as a line of cron or a span of time"
        )


def _check_repeated(goal: Goal, means: GoalStatus, zones: Mapping[str, tzinfo]) -> None:
    """Whether what is done again and again can be.

    Raises:
        NotUnderstood: it cannot; one sentence.
    """
    if not means.stages:
        raise NotUnderstood(
            f"{goal.text!r} says what to keep or to avoid again and again: what is kept is "
            "kept all the time"
        )
    if goal.whenever and (goal.every is not None or goal.not_before_s is not None):
        time = "at what times it is done" if goal.every is not None else "when it is begun"
        raise NotUnderstood(
            f"{goal.text!r} says {time}, and that it is done each time that something comes to "
            "hold: say one of both"
        )
    if goal.every is not None:
        recurrence_of(goal, zones)


def _check_not_negated(condition: Condition) -> None:
    if condition.negated:
        raise NotUnderstood(
            f"{condition}: what shall hold says what is so, and not what is not; only conditions "
            "of a goal can"
        )


def _in_other_words(
    state: State,
    goal: Goal,
    known_words: _Words,
    status: GoalStatus,
    refusal: str,
    asked: GoalStatus | None,
) -> Understood:
    """What becomes of a goal that the grammar refuses: what a language model has made of it is read
    by the same grammar, and a person says whether it is meant."""
    if asked is None or asked.refusal is None:
        return Understood(_rejected(status, refusal), goal, unread=True)
    if (words := asked.paraphrase) is None:
        if asked.refusal != refusal:  # there are other names now
            return Understood(_rejected(status, refusal), goal, unread=True)
        return Understood(_rejected(replace(status, refusal=refusal), asked.reason or ""), goal)
    status = replace(status, refusal=refusal, paraphrase=words, teaches=asked.teaches)
    said = f"a language model says {goal.text!r} as {words!r}"
    try:
        read = _taken(state, goal, status, _reading(goal, words, known_words))
    except NotUnderstood as error:
        return Understood(_rejected(status, f"{refusal}; {said}: {error}"), goal)
    if read.status.candidates:
        return Understood(_rejected(read.status, f"{said}: {read.status.reason}"), goal)
    meaning = read.reading.understood_as
    if meaning == goal.meant or not to_confirm(state, goal, read.reading):
        return read
    sentence = (
        f"{said}, which is understood as {meaning}; nothing is done unless you say that it is "
        f"meant, with `robotctl goal answer {goal.goal} yes`"
    )
    return Understood(_rejected(replace(status, candidates=(meaning,)), sentence), goal)


def _rejected(status: GoalStatus, reason: str) -> GoalStatus:
    return replace(status, state=GoalState.REJECTED, reason=reason)


def _words_of(state: State, goal: Goal) -> _Words:
    """The names that whoever says a goal can use, and what clocks show.

    Raises:
        NotUnderstood: nobody knows who says it, or when.
    """
    words = state.vocabulary()
    if goal.conditions:
        return words, None
    return words.spoken_by(goal.speaker), said_at(goal, state.time_zones())


def _reading(goal: Goal, text: str, words: _Words) -> Reading | Ambiguity:
    if goal.conditions:
        return Reading(goal.text, (WantedGoal((goal.conditions,)),))
    found = read(text, *words)
    if isinstance(found, Ambiguity) and goal.meant is not None:
        return dict(found.candidates).get(goal.meant, found)
    return found


def wanted_goals(reading: Reading) -> tuple[WantedGoal, ...]:
    """What a reading wants; who wants to have it done where something is wants it found.

    Raises:
        NotUnderstood: it is no wish.
    """
    text, asked = reading.text, reading.question
    if asked is not None and asked.of == "where" and asked.subjects:
        lost = (Condition(relation=LOCATED, subject=name, value=True) for name in asked.subjects)
        return (WantedGoal((tuple(lost),)),)
    if asked is not None:
        raise NotUnderstood(f"{text!r} is a question: ask it with `robotctl ask`")
    if not reading.goals:
        raise NotUnderstood(
            f"{text!r} says what holds, and asks for nothing: tell it with `robotctl world add`"
        )
    return reading.goals


def _in_force(goal: Goal, wanted: WantedGoal, said_s: float) -> Goal:
    """What was put at `said_s`, with what its sentence adds.

    Raises:
        NotUnderstood: the two contradict each other.
    """
    due_s, not_before_s = goal.due_s, goal.not_before_s
    if due_s is None and wanted.due_s is not None:
        due_s = said_s + wanted.due_s
    if not_before_s is None and wanted.not_before_s is not None:
        not_before_s = said_s + wanted.not_before_s
    if goal.by and wanted.by and set(goal.by) != set(wanted.by):
        said = f"{' and '.join(wanted.by)} shall do it, and not {' and '.join(goal.by)}"
        raise NotUnderstood(f"{goal.text!r} says that {said}, as was asked for: say one of both")
    every = goal.every or wanted.every
    return replace(
        goal,
        said_s=goal.said_s if every is None and not_before_s is None else said_s,
        priority=goal.priority or wanted.priority,
        due_s=due_s,
        not_before_s=not_before_s,
        every=every,
        by=goal.by or wanted.by,
        always=tuple(dict.fromkeys((*goal.always, *wanted.always))),
        never=tuple(dict.fromkeys((*goal.never, *wanted.never))),
        when=tuple(dict.fromkeys((*goal.when, *wanted.when))),
        only_if=tuple(dict.fromkeys((*goal.only_if, *wanted.only_if))),
        whenever=tuple(dict.fromkeys((*goal.whenever, *wanted.whenever))),
    )


def _note(state: State, reading: Reading) -> str | None:
    """What a goal's sentence says besides what must hold, so that no word is lost unseen."""
    notes = [f"{use.said!r} is taken for: {use.text}" for use in reading.methods]
    notes += [f"{remark!r} asks for nothing" for remark in reading.remarks]
    notes += reading.left_out
    facts, words = FactValues(state.facts), Phrasing(state.vocabulary())
    for literal in reading.presumed:
        (relation, subject), value = literal
        fact = state.fact(relation, subject)
        if (
            fact is not None
            and fact.value not in (None, value)
            and not holds(literal, facts.get, state, aboard=True)
        ):
            taken, known = (
                words.condition(Condition(relation=relation, subject=subject, value=each))
                for each in (value, fact.value)
            )
            notes.append(f"it takes for granted that {taken}; believed is that {known}")
    return "; ".join(notes) or None


def _check_condition(state: State, condition: Condition) -> None:
    for name in condition.subjects:
        _check_name(state, name)
    for literal in condition.literals:
        if (wrong := misfit(literal, state.world())) is not None:
            raise NotUnderstood(wrong)
    if condition.value not in _words(state, condition.relation):
        _check_name(state, condition.value)


def _check_relation(state: State, condition: Condition) -> None:
    known = relations_of(state.world())
    if condition.relation not in known:
        raise NotUnderstood(
            f"{condition}: {condition.relation!r} is no relation that skills or facts speak of; "
            f"those are {', '.join(sorted(known))}"
        )


def _words(state: State, relation: str) -> tuple[str, ...]:
    """The words that skills declare as a relation's values: "hot", "cold"."""
    for skill in state.skills.values():
        if (known := skill.relations.get(relation)) is not None:
            return known.values if isinstance(known.values, tuple) else ()
    return ()


def _check_name(state: State, name: Value) -> None:
    if not isinstance(name, str) or name == NOTHING:
        return
    if not any(name in known for known in (state.places, state.objects, state.robots)):
        known = sorted((*state.places, *state.objects, *state.robots))
        raise NotUnderstood(f"{name!r} is nothing that is known; known are {nearest(known, name)}")
