"""Reads texts: words to tags, to a chart, to small trees, to what they mean in this world."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime

from fleet.errors import NotUnderstood
from fleet.language.conditions import affirmed, asked, conditions_of, existing, found, otherwise
from fleet.language.expansion import Row, expanded, take
from fleet.language.explaining import Explanations
from fleet.language.gapping import gapped
from fleet.language.grammar.chart import NotGrammatical, inside_lists, parsed
from fleet.language.limits import tokens_within_limits
from fleet.language.reading import Reading
from fleet.language.refusals import Misused, NoUse
from fleet.language.remarks import of_oneself, only_remarked, remark
from fleet.language.resolve.clauses import Clauses
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.frames import EXAMPLE, SAY_IT
from fleet.language.resolve.mentions import WhichOne
from fleet.language.resolve.scene import Question, Scene
from fleet.language.resolve.stages import GoalDraft
from fleet.language.segments import Segment, Sentence, cut, parted, sentences_of
from fleet.language.tagging.tagger import tagger_of
from fleet.language.tagging.task_phrases import TaskCall, called, marked, spoken_out
from fleet.language.timing import end_goal
from fleet.language.tree.building import Builder
from fleet.language.tree.nodes import Clause
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import LOCATED, Literal

MOST_WORDS_TOGETHER = 80
"""In one clause; of a long list one for each thing."""
CHOICES = 12
"""Of so many that a noun phrase may mean, one is asked for."""
_NAMING = re.compile(r"not a known|as a goal")
"""What a refusal says that names a word nobody knows."""
_ODDER = 2
"""So much odder a reading may be to stand where the plainest one comes to nothing later."""
_READINGS = 12
"""Readings of what was read so far that are followed up."""


class _State:
    """One reading of what was read so far."""

    def __init__(
        self, said: Discourse, cost: int = 0, question: Question | None = None, asked: str = ""
    ) -> None:
        """`asked`: the sentence that asks which of several is meant, where it is one of them."""
        self.said, self.cost, self.question, self.asked = said, cost, question, asked


class Reader:
    """Reads one text."""

    def __init__(
        self, text: str, vocabulary: Vocabulary, mode: str = "", within: tuple[str, ...] = ()
    ) -> None:
        """`mode`: only a `goal` or a `fact` is understood; else anything. `within`: the tasks by
        whose methods the text is said.

        Raises:
            NotUnderstood: the text is empty, or too long.
        """
        self.tokens = tokens_within_limits(text, mode)
        self.text, self.vocabulary, self.mode, self.within = text, vocabulary, mode, within
        self.tagger = tagger_of(vocabulary)
        self.remarks: list[str] = []
        self.later: Sequence[Sentence] = ()
        """The sentences after the one that is being read, but for remarks."""
        self.why = Explanations(text, self.tokens, self.tagger, mode, vocabulary)
        self.line = " ".join(text.split())

    def read(self, now: datetime | None) -> list[tuple[int, str, Reading]]:
        """All that the text can mean, the plainest first.

        Raises:
            NotUnderstood: nothing; one sentence says why.
        """
        draft = GoalDraft(self.vocabulary.is_at)
        states = [_State(Discourse(self.text, self.tokens, draft, self.vocabulary.is_person))]
        lexemes = self.tagger.tagged(self.tokens, self.text)
        if self.mode != "fact":
            lexemes = marked(lexemes, self.tokens, self.text, self.vocabulary, self.tagger)
        dangling = False
        parts = (part for whole in sentences_of(lexemes) for part in parted(whole))
        sentences = [cut(words) for words in parts]
        for number, sentence in enumerate(sentences):
            self.later = [s for s in sentences[number + 1 :] if not self._said_of_oneself(s)]
            self.why.check(sentence)
            timed = bool(sentence.times) or any(part.role for part in sentence.segments)
            states = self._with_goals_ended(states, timed or sentence.otherwise, now)
            for state in states if sentence.otherwise else ():
                otherwise(state.said)
            for state in states:
                said = state.said
                said.elliptic, said.addressees, said.done, said.again = "", [], False, None
                said.telegraphic, said.clauses, said.offer = sentence.telegraphic, 0, None
                said.front = ()
                said.urgent = said.urgent or sentence.urgent
                said.times, said.time_words = list(sentence.times), sentence.time_words
            dangling = sentence.dangling
            if self._said_of_oneself(sentence):
                try:
                    states = self._sentence(sentence, states)
                except NotUnderstood:
                    states = self._remark(sentence, states)
            else:
                before, states = states, self._sentence(sentence, states)
                if self._asserted(sentence, before[0], states):
                    states = self._asked(sentence, before)
        return self._ended(states, now, dangling)

    def _asserted(self, sentence: Sentence, before: _State, states: Sequence[_State]) -> bool:
        """Whether what ends with a question mark was taken for a fact, and for nothing else."""
        end = sentence.words[-1].last
        if end >= len(self.tokens) or self.tokens[end].word != "?":
            return False
        asks = [s.question is not before.question for s in states]
        wished = [s.said.draft.stages != before.said.draft.stages for s in states]
        told = [len(s.said.facts) > len(before.said.facts) for s in states]
        return not any(asks) and not any(wished) and any(told)

    def _asked(self, sentence: Sentence, states: list[_State]) -> list[_State]:
        """`the door is locked?` is no fact, but asks whether it is."""
        first = sentence.words[0]
        whether = replace(first, tags=frozenset({"ASKIF"}), last=first.first)
        return self._sentence(cut([whether, *sentence.words]), states)

    def _with_goals_ended(
        self, states: Sequence[_State], timed: bool, now: datetime | None
    ) -> list[_State]:
        """Those readings whose goals could end, where the next sentence has times of its own."""
        kept, problem = [], None
        for state in states:
            said = state.said
            try:
                if timed or said.times or said.conditions:
                    end_goal(said, self.vocabulary, now, self.mode)
            except NotUnderstood as error:
                problem = problem or error
            else:
                kept.append(state)
        if not kept and problem is not None:
            raise problem
        return kept

    # --- one sentence after the other -------------------------------------------------------------
    def _sentence(self, sentence: Sentence, states: list[_State]) -> list[_State]:
        segments = [part for whole in sentence.segments for part in gapped(whole, self.tagger)]
        for number, segment in enumerate(segments):
            if segment.joint == "then":
                for state in states:
                    state.said.draft.next_stage()
            if segment.joint == "sooner":
                for state in states:
                    state.said.draft.hold()
            try:
                states = self._segment(segment, states)
                for state in states:
                    state.said.draft.release()
            except NotUnderstood as problem:
                left = segments[number:]
                raise self.why.rather(problem, left, self.later) from None
        return states

    def _segment(self, segment: Segment, states: Sequence[_State]) -> list[_State]:
        if segment.role and not segment.negated:
            return self._condition(segment, states)
        call = called(segment.words, self.tagger)
        segment = replace(segment, words=spoken_out(segment.words))
        if call is not None and not (segment.role or segment.always):
            if call.task.yields:
                with suppress(NotUnderstood):
                    return self._clauses(segment, states)
            return self._task(call, states)
        try:
            return self._clauses(segment, states)
        except NotUnderstood as problem:
            raise self.why.beside_a_task(problem, segment) from None

    def _condition(self, segment: Segment, states: Sequence[_State]) -> list[_State]:
        """A clause after "if" and the like, as it is, or as what it says does not hold."""
        try:
            return self._clauses(segment, states)
        except NotUnderstood as problem:
            without = affirmed(segment)
            others = (asked(segment), without and asked(without), without)
            for other in filter(None, others):
                try:
                    return self._clauses(other, states)
                except Misused as wrong:
                    raise wrong from None
                except NotUnderstood:
                    continue
            raise problem from None

    def _clauses(self, segment: Segment, states: Sequence[_State]) -> list[_State]:
        words = len(segment.words) - 2 * len(tuple(inside_lists(segment.words)))
        if words > MOST_WORDS_TOGETHER:
            raise NotUnderstood(
                f"{len(segment.words)} words are too many for one clause: say it in several"
            )
        self.why.unheard_of(segment)
        try:
            trees = parsed(segment.words, Builder(segment.words, self.tagger))
        except NotGrammatical as error:
            raise self.why.ungrammatical(segment, error.at) from None
        found: list[_State] = []
        plainest: int | None = None
        problems: list[tuple[int, NotUnderstood]] = []
        for state in states:
            if problems and not found and state.cost > states[0].cost + _ODDER:
                break
            for cost, clauses in trees:
                try:
                    said, question = self._resolved(clauses, state.said.copy(), segment)
                except NotUnderstood as problem:
                    problems.append((state.cost + cost, problem))
                else:
                    if question is not None and state.question is not None:
                        twice = f"{self.line!r} asks two things: ask one at a time"
                        problems.append((state.cost + cost, NotUnderstood(twice)))
                        continue
                    whole = state.cost + cost
                    plainest = whole if plainest is None else min(whole, plainest)
                    found.append(_State(said, whole, question or state.question, state.asked))
        at, which = min(problems, key=lambda row: row[0]) if problems else (0, None)
        if isinstance(which, WhichOne) and (plainest is None or at < plainest):
            found = self._each(which, segment, states) or found  # rather asked than read oddly
        if not found:
            strange = [w for w in segment.words if "UNK" in w.tags]
            named = (
                bool(strange)
                and strange[0].text in str(which)
                and _NAMING.search(str(which)) is not None
                and not self.why.asks_for(segment)
            )
            if not problems or (strange and not named):
                raise self.why.ungrammatical(segment, 0)
            raise min(problems, key=lambda row: (isinstance(row[1], NoUse), row[0]))[1]
        found.sort(key=lambda state: state.cost)
        return found[:_READINGS]

    def _task(self, call: TaskCall, states: Sequence[_State]) -> list[_State]:
        found: list[_State] = []
        for meant in expanded(call, self.vocabulary, self.within, self._said_by_method):
            for state in states:
                said = state.said.copy()
                take(said, call, meant, self.vocabulary.robots)
                found.append(_State(said, state.cost, state.question, state.asked or meant.asked))
        return found[:_READINGS]

    def _said_by_method(self, text: str, within: tuple[str, ...]) -> list[Row]:
        return Reader(text, self.vocabulary, within=within).read(None)

    def _each(self, which: WhichOne, segment: Segment, states: Sequence[_State]) -> list[_State]:
        """The readings in which a noun phrase means one, then another of those that it can."""
        if len(which.choices) > CHOICES or len(states) > CHOICES:
            return []
        found: list[_State] = []
        for meant in which.choices:
            forked = []
            for state in states:
                if which.key in state.said.chosen:
                    return []
                said = state.said.copy()
                said.chosen[which.key] = meant
                asked = state.asked or str(which)
                forked.append(_State(said, state.cost, state.question, asked))
            with suppress(NotUnderstood):
                found += self._segment(segment, forked)
        return found

    def _resolved(
        self, clauses: tuple[Clause, ...], said: Discourse, segment: Segment
    ) -> tuple[Discourse, Question | None]:
        if not segment.role:
            return self._understood(clauses, said, segment, self.mode)
        try:
            if "ISARE" in segment.words[0].tags:
                _, question = self._understood(clauses, said.copy(), replace(segment, role=""), "")
                said.conditions_of(segment.role).extend(existing(question, segment))
                return said, None
            return self._understood(clauses, said.copy(), segment, "fact")
        except NotUnderstood:
            if (found := self._found(clauses, said, segment)) is None:
                raise
            return found, None

    def _found(
        self, clauses: tuple[Clause, ...], said: Discourse, segment: Segment
    ) -> Discourse | None:
        """Under a condition that something is found, and none other that somebody does."""
        draft, said.draft = said.draft, GoalDraft(self.vocabulary.is_at)
        try:
            said, question = self._understood(clauses, said, replace(segment, role=""), "goal")
            each = list(said.draft.of_each())
            rows = [row for stage in said.draft.conditions() for row in stage]
        except NotUnderstood:
            return None
        looked_for = bool(rows) and all(row.relation == LOCATED for row in rows)
        if not looked_for or question is not None or any(by for by, _ in each):
            return None
        said.conditions_of(segment.role).extend(found(rows, segment, said.goals))
        said.draft = draft
        return said

    def _understood(
        self, clauses: tuple[Clause, ...], said: Discourse, segment: Segment, mode: str
    ) -> tuple[Discourse, Question | None]:
        before, told = dict(said.facts), len(said.told)
        draft = said.draft
        if segment.role:
            said.elliptic = ""
            said.as_long_as |= segment.role == "as long as"
        if segment.always:
            said.draft = GoalDraft(self.vocabulary.is_at)
        scene = Scene(self.vocabulary, self.tagger, said, mode)
        resolver = Clauses(scene)
        for clause in clauses:
            if segment.topic and len(clauses) == 1 and clause.kind in ("bare", "named"):
                resolver.topic(clause)
            else:
                resolver.clause(clause)
        said = scene.said
        if segment.always:
            said.always.extend(c for stage in said.draft.conditions() for c in stage)
            said.draft = draft
        if segment.role:
            said.facts = before
            rows = conditions_of(said.told[told:], segment, self.vocabulary)
            said.conditions_of(segment.role).extend(rows)
            said.elliptic = ""
        return said, scene.question

    # --- people speaking of themselves ------------------------------------------------------------
    def _said_of_oneself(self, sentence: Sentence) -> bool:
        return self.mode != "fact" and of_oneself(
            sentence.words, self.tokens, self.tagger.book.remarks
        )

    def _remark(self, sentence: Sentence, states: list[_State]) -> list[_State]:
        """Leave out a sentence that asks for nothing, up to its end or a command.

        Raises:
            NotUnderstood: it names something known, or has a word for which goals are refused.
        """
        shown, rest = remark(sentence.words, self.why.quote)
        self.remarks.append(shown)
        return self._sentence(cut(rest), states) if rest else states

    # --- the end ----------------------------------------------------------------------------------
    def _ended(
        self, states: Sequence[_State], now: datetime | None, dangling: bool
    ) -> list[tuple[int, str, Reading]]:
        found: dict[Reading, tuple[int, str]] = {}
        problem: NotUnderstood | None = None
        for state in states:
            try:
                reading = self._reading(state, now, dangling)
            except NotUnderstood as error:
                problem = problem or error
            else:
                row = (state.cost, state.asked)
                found[reading] = min(row, found.get(reading, row))
        if not found:
            assert problem is not None
            raise problem
        rows = [(cost, asked, reading) for reading, (cost, asked) in found.items()]
        best: dict[Reading, Row] = {}
        for each in sorted(rows, key=lambda row: (row[0], not self._believed(row[2]))):
            best.setdefault(replace(each[2], presumed=()), each)  # what is presumed asks nothing
        return list(best.values())

    def _believed(self, reading: Reading) -> bool:
        """Whether all that it takes for granted is believed."""
        is_at = self.vocabulary.is_at
        return all(is_at(key.subject, str(value)) for key, value in reading.presumed)

    def _reading(self, state: _State, now: datetime | None, dangling: bool) -> Reading:
        said = state.said.copy()
        end_goal(said, self.vocabulary, now, self.mode)
        facts = tuple(Literal(key, value) for key, value in said.facts.items())
        if dangling or not (said.goals or facts or state.question):
            if self.mode == "fact":
                raise NotUnderstood(f"{self.line!r} ends before it says anything: {SAY_IT}")
            if remarks := (*self.remarks, *said.remarks):
                raise only_remarked(remarks[-1])
            raise NotUnderstood(f"{self.line!r} ends before it says what to do: {EXAMPLE}")
        goals = tuple(replace(goal, priority=said.urgent) for goal in said.goals)
        presumed = tuple(dict.fromkeys(said.presumed))
        remarks = (*self.remarks, *said.remarks)
        methods = tuple(dict.fromkeys(said.methods))
        return Reading(self.line, goals, facts, state.question, presumed, remarks, methods)
