"""Reads texts: words to tags, to a chart, to small trees, to what they mean in this world."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from typing import Any

from fleet.errors import NotUnderstood
from fleet.language.explaining import Explanations
from fleet.language.grammar.chart import NotGrammatical, inside_lists, parsed
from fleet.language.meanings.conditions import one_is_enough, otherwise
from fleet.language.meanings.expansion import Row, expanded, take
from fleet.language.meanings.other_words import alternatives, apart, in_other_words
from fleet.language.meanings.timing import end_goal
from fleet.language.meanings.understanding import Understanding
from fleet.language.reading import Reading, told_apart
from fleet.language.refusals import Misused, NoUse
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.frames import EXAMPLE, SAY_IT
from fleet.language.resolve.reference.mentions import TooOpen, WhichOne
from fleet.language.resolve.scene import Question
from fleet.language.resolve.stages import GoalDraft
from fleet.language.sentences.gapping import gapped, shared
from fleet.language.sentences.remarks import of_oneself, only_remarked, remark
from fleet.language.sentences.segments import Segment, Sentence, asking, cut, parted, sentences_of
from fleet.language.tagging.tagger import Lexeme, tagger_of
from fleet.language.tagging.task_phrases import TaskCall, called, marked, spoken_out
from fleet.language.tree.building import Builder
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.limits import tokens_within_limits
from keyexpr_schema.facts import Literal

MOST_WORDS_TOGETHER = 80
"""In one clause; of a long list one for each thing."""
CHOICES = 12
"""Of so many that a noun phrase may mean, one is asked for."""
MOST_FORKS = 60
"""Readings in which a noun phrase means one of several, and then another, that are tried."""
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
        self.understanding = Understanding(vocabulary, self.tagger, mode)
        self.remarks: list[str] = []
        self.forks = 0
        self._trees: dict[tuple[Lexeme, ...], Sequence[tuple[int, Any]]] = {}
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
        sentences = [each for words in parts for each in apart(cut(words))]
        for number, sentence in enumerate(sentences):
            self.later = [s for s in sentences[number + 1 :] if not self._said_of_oneself(s)]
            self.why.check(sentence)
            if sentence.goes_on:
                for state in states:
                    state.said.check_going_on()
            else:
                states = self._with_goals_ended(states, sentence.is_apart, now)
            for state in states if sentence.otherwise else ():
                otherwise(state.said)
            for state in states:
                said = state.said
                said.begin_sentence(sentence.telegraphic, sentence.urgent)
                said.once_more = sentence.once_more
                if not sentence.goes_on:
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
                    whether = asking(sentence.words)  # "the door is locked?" is no fact
                    states = self._sentence(cut(whether), before)
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
                    said.same = None  # what is said now is not said for that time
            except NotUnderstood as error:
                problem = problem or error
            else:
                kept.append(state)
        if not kept and problem is not None:
            raise problem
        return kept

    # --- one sentence after the other -------------------------------------------------------------
    def _sentence(self, sentence: Sentence, states: list[_State]) -> list[_State]:
        whole = shared(sentence.segments, self.tagger)
        segments = [part for each in whole for part in gapped(each, self.tagger)]
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
            for other in in_other_words(segment):
                try:
                    return self._clauses(other, states)
                except Misused as wrong:
                    raise wrong from None
                except NotUnderstood:
                    continue
            if several := alternatives(segment):
                return self._one_of_those(several, segment, states)
            raise problem from None

    def _one_of_those(
        self, several: Sequence[Segment], segment: Segment, states: Sequence[_State]
    ) -> list[_State]:
        """A condition that is several, of which one is enough."""
        found = []
        for state in states:
            rows, said = [], state.said.copy()
            known = len(said.conditions_of(segment.role))
            for one in several:
                told = self._condition(one, [_State(said.copy())])[0].said
                rows.append(told.conditions_of(segment.role)[known:])
                said.recent = [*said.recent, *told.recent]
            one_is_enough(rows, said, segment)
            found.append(_State(said, state.cost, state.question, state.asked))
        return found

    def _clauses(self, segment: Segment, states: Sequence[_State]) -> list[_State]:
        words = len(segment.words) - 2 * len(tuple(inside_lists(segment.words)))
        if words > MOST_WORDS_TOGETHER:
            raise NotUnderstood(
                f"{len(segment.words)} words are too many for one clause: say it in several"
            )
        self.why.unheard_of(segment)
        if (trees := self._trees.get(segment.words)) is None:
            try:
                trees = parsed(segment.words, Builder(segment.words, self.tagger))
            except NotGrammatical as error:
                raise self.why.ungrammatical(segment, error.at) from None
            self._trees[segment.words] = trees
        found: list[_State] = []
        plainest: int | None = None
        problems: list[tuple[int, NotUnderstood]] = []
        for state in states:
            if problems and not found and state.cost > states[0].cost + _ODDER:
                break
            for cost, clauses in trees:
                try:
                    said, question = self.understanding.resolved(
                        clauses, state.said.copy(), segment
                    )
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
            self.forks += 1
            if self.forks > MOST_FORKS:
                raise TooOpen(str(which))
            try:
                found += self._segment(segment, forked)
            except TooOpen:
                raise TooOpen(str(which)) from None
            except NotUnderstood:
                continue
        return found

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
        return told_apart(rows, self.vocabulary.is_at)

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
        left_out = tuple(dict.fromkeys(said.left_out))
        question = state.question
        return Reading(self.line, goals, facts, question, presumed, remarks, methods, left_out)
