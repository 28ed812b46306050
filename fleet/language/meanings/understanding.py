"""What the clauses of one segment add to what is said: wishes, facts, conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.meanings.conditions import conditions_of, existing, found
from fleet.language.resolve.clauses import Clauses
from fleet.language.resolve.discourse import Ahead, Discourse
from fleet.language.resolve.reference.mentions import Mention, WhichOne
from fleet.language.resolve.scene import Question, Scene
from fleet.language.resolve.stages import GoalDraft
from fleet.language.sentences.segments import Segment
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.nodes import Clause
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import LOCATED
from keyexpr_schema.payloads.goals import Condition

_GO_ON = frozenset({"bare", "bare_state", "whereto", "named", "remarked"})
"""Kinds of clauses that say more of what was said before."""


class Understanding:
    """Takes the clauses of a segment into what a text has said so far."""

    def __init__(self, vocabulary: Vocabulary, tagger: Tagger, mode: str) -> None:
        self.vocabulary, self.tagger, self.mode = vocabulary, tagger, mode

    def resolved(
        self, clauses: tuple[Clause, ...], said: Discourse, segment: Segment
    ) -> tuple[Discourse, Question | None]:
        """What is said after these clauses, and what they ask.

        Raises:
            NotUnderstood: they mean nothing here.
        """
        if not segment.role:
            return self._understood(clauses, said, segment, self.mode)
        try:
            if "ISARE" in segment.words[0].tags:
                plain = replace(segment, role="")
                after, question = self._understood(clauses, said.copy(), plain, "")
                said.last_place = after.last_place
                rows = existing(question, segment, self.vocabulary)
                said.ahead = said.ahead or _ahead_of(rows, said, segment)
                said.conditions_of(segment.role).extend(rows)
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
        addressed, said.addressees = said.addressees, []  # "you" are whoever does the rest
        said.recent = _meant(said, draft)
        try:
            said, question = self._understood(clauses, said, replace(segment, role=""), "goal")
            each = list(said.draft.of_each())
            rows = [row for stage in said.draft.conditions() for row in stage]
        except WhichOne:
            raise
        except NotUnderstood:
            return None
        looked_for = bool(rows) and all(row.relation == LOCATED for row in rows)
        if not looked_for or question is not None or any(by for by, _ in each):
            return None
        said.draft, said.addressees = draft, addressed
        again = said.whenever or any(time.kind == "every" for time in said.times)
        if not again and (ahead := draft.search_ahead()) is not None:
            said.ahead = Ahead(ahead, tuple(said.when), tuple(said.only_if))
        stages = [stage for goal in said.goals for stage in goal.stages]
        stages += [] if said.ahead is None else said.ahead.draft.conditions()
        said.conditions_of(segment.role).extend(found(rows, segment, stages))
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
            if not segment.role and clause.kind not in _GO_ON:
                scene.said.begun = scene.said.draft.count
                scene.said.begun_then = segment.joint == "then"
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
            said.ahead = said.ahead or _ahead_of(rows, said, segment)
            said.conditions_of(segment.role).extend(rows)
            said.severally |= bool(rows[1:]) and not any(map(_all_together, segment.words))
            said.elliptic = ""
        return said, scene.question


def _ahead_of(rows: Sequence[Condition], said: Discourse, segment: Segment) -> Ahead | None:
    """What is wanted whether or not a condition holds that stands behind the last clause, and is
    about what that wants alone: "bring me a coffee, and turn off the lamp if it is on"; or is what
    was wanted before: "charge it, and bring it to me when it is charged".

    Raises:
        NotUnderstood: the last clause is for after the others, and these may be for that, too.
    """
    wishes = [wish for stage in said.draft.stages for wish in stage]
    earlier, last = wishes[: said.begun], wishes[said.begun :]
    if not earlier or not last or segment.role in ("whenever", "as long as"):
        return None
    about = {name for row in rows for name in row.subjects}
    first, then = ({name for w in part for name in w.subjects} for part in (earlier, last))
    wanted = any(
        (w.relation, w.value) == (row.relation, row.value) and row.subject in w.subjects
        for row in rows
        for w in earlier
    )
    if not wanted and not (about <= then and about.isdisjoint(first)):
        return None
    if said.begun_then and not wanted:
        raise NotUnderstood(
            f"{said.line!r}: it is not said whether what comes first depends on the condition, "
            "too: say it as two goals"
        )
    draft = said.draft.take_first(said.begun)
    return Ahead(draft, tuple(said.when), tuple(said.only_if))


def _all_together(word: Lexeme) -> bool:
    """Whether several are spoken of as one: "both windows", "the fridge and the oven"."""
    return bool(word.tags & {"UNIV", "AND", "COMMA"}) and "NOUN" not in word.tags


def _meant(said: Discourse, draft: GoalDraft) -> list[Mention]:
    """Whom "it" means in "if you find it": what was looked for, or what was spoken of last."""
    recent = said.recent
    sought = [wish.subjects for stage in draft.stages for wish in stage if wish.relation == LOCATED]
    stages = [stage for goal in said.goals for stage in goal.stages]
    sought = sought or [c.subjects for stage in stages for c in stage if c.relation == LOCATED]
    named = {name for subjects in sought for name in subjects}
    if not sought or any(named.issuperset(m.subjects) for m in recent):
        return recent
    found = Mention(sought[-1], "object", -1, len(sought[-1]) > 1)
    one = len(recent) == 1 and recent[0].single and recent[0].type == "object"
    return [*recent, found] if one else [found]
