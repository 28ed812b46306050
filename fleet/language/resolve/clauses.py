"""What each kind of clause asks for or says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import reason_for
from fleet.language.resolve.claims import SAY_IT, Claims
from fleet.language.resolve.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.nouns import PLACES, THINGS
from fleet.language.resolve.senses import ROBOTS_TELL
from fleet.language.resolve.stages import GoalDraft
from fleet.language.resolve.wishes import EXAMPLE, Frame, framed
from fleet.language.tagging.skill_words import SKILL, SkillFrame
from fleet.language.tagging.tagger import Lexeme
from fleet.language.tree.nodes import Argument, Clause, Nouns, Predicate
from fleet.language.words.tokens import Phrase
from keyexpr_schema.facts import AT, HELD, LOCATED, SEARCHED
from keyexpr_schema.payloads.goals import Condition

_DONE = {"find": LOCATED, "pick": HELD, "search": SEARCHED}
"""What holds when it has been done: "the book should be found"."""
_GUESSES = frozenset({"can", "could", "may", "would", "will"})
_WISHES = frozenset({"do", "told", "wanted", "belongs", "whereto", "enough", "kept", "never_be",
                     "never_do", "avoid"})  # fmt: skip


class Clauses(Claims):
    """Resolves one clause after the other."""

    def clause(self, clause: Clause) -> None:
        """Take a clause into what is said.

        Raises:
            NotUnderstood: it means nothing here; one sentence.
        """
        self.said.began, self.said.ended = clause.first, clause.last
        if self.mode == "fact" and clause.kind in _WISHES:
            if clause.kind in ("do", "told"):
                raise NotUnderstood(f"{self.said.line!r} is a goal and not a fact: {SAY_IT}")
            raise NotUnderstood(f"{self.said.clause!r} is not understood as a fact: {SAY_IT}")
        getattr(self, f"on_{clause.kind}")(clause)

    # --- commands ---------------------------------------------------------------------------------
    def on_do(self, clause: Clause) -> None:
        self._verb(clause, self.said.addressees or None)

    def on_told(self, clause: Clause) -> None:
        assert clause.subject is not None
        who = self.subjects(clause.subject, THINGS, "an object or a robot")
        self.check_robots(who)
        self.said.addressees = [s for s in who if not (isinstance(s, NounPhrase) and s.generic)]
        self._verb(clause, who)

    def _verb(self, clause: Clause, who: Sequence[Subject] | None) -> None:
        assert clause.verb is not None
        problems: list[NotUnderstood] = []
        frames = self._frames(clause.verb, clause.arguments, ("VERB", "FIN", "GER"))
        if not frames:
            raise NotUnderstood(f"{clause.verb.text!r} is not understood as a goal: {EXAMPLE}")
        for frame, phrases in frames:
            before = self.said
            self.said = before.copy()
            try:
                if phrases:
                    if phrases[0].phrase.type != "robot":
                        self._check_who(who)
                    self.said.elliptic = ""
                    self.said.again = (clause.verb, clause.arguments)
                    self.skill(frame, phrases, who)
                else:
                    self._sense(frame, who)
                return
            except NotUnderstood as problem:
                self.said = before
                problems.append(problem)
        raise problems[0]

    def _frames(
        self, verb: Lexeme, arguments: Sequence[Argument], forms: tuple[str, ...]
    ) -> list[tuple[Frame, list[SkillFrame]]]:
        """The uses of a verb that its particles and prepositions fit, the longest first."""
        found: list[tuple[int, Frame, list[SkillFrame]]] = []
        plain = framed(arguments, verb.word)
        for head in self.tagger.verbs.heads(verb.words, *forms):
            for entry in self.tagger.verbs.entries[head]:
                fitted = _fitted(plain, entry.behind, entry.senses, entry.base)
                if fitted is not None:
                    skills = self.tagger.verbs.skills.get((head, entry.behind), [])
                    of_skill = skills if SKILL in entry.senses else []
                    found.append((len(entry.behind), fitted, of_skill))
        longest = max((row[0] for row in found), default=0)
        return [(frame, skills) for length, frame, skills in found if length == longest]

    def _sense(self, frame: Frame, who: Sequence[Subject] | None) -> None:
        senses = frame.senses
        self.said.verb = frame.verb
        self.said.elliptic = "move" if senses & {"move", "go", "give"} else ""
        if "go" in senses and not frame.themes and ("move" not in senses or _whereto(frame)):
            return self.go(frame, who)
        if "patrol" in senses and any(not self.any_robot(s) for s in who or ()):
            self.check_robots(who or ())
            return self.patrol(frame, who or ())
        self._check_who(who)
        if "clear" in senses and "tidy" not in senses:
            return self.clear(frame)
        if "move" in senses and (frame.themes or "tidy" not in senses):
            return self.move(frame)
        if "give" in senses:
            return self.move(frame)
        if "tidy" in senses:
            return self.tidy(frame)
        if "find" in senses:
            return self.find(frame)
        if "pick" in senses:
            return self.pick(frame)
        return self.search(frame)

    def _check_who(self, who: Sequence[Subject] | None) -> None:
        if who is not None:
            self.check_who(who)

    # --- what shall be ----------------------------------------------------------------------------
    def on_shall_be(self, clause: Clause) -> None:
        modal = next((w.word for w in clause.words if "MODAL" in w.tags), "")
        if modal in _GUESSES:
            if modal == "can" and clause.predicate is not None and clause.subject is not None:
                self._claims()
                return self.placed(clause.subject, clause.predicate.arguments)
            raise NotUnderstood(f"{modal!r} is uncertain; say what holds, or what should hold")
        if self.mode == "fact":
            raise NotUnderstood(f"{self.said.line!r} is a goal and not a fact: {SAY_IT}")
        return self._to_be(clause.subject, clause.predicate, clause.arguments)

    def _to_be(
        self, subject: Nouns | None, predicate: Predicate | None, arguments: Sequence[Argument]
    ) -> None:
        """What follows "should be": a place, a state, or what should have been done."""
        assert subject is not None
        self.said.elliptic, self.said.addressees = "be", []
        places = not self.can_be(subject, THINGS) and self.can_be(subject, PLACES)
        if predicate is not None and predicate.kind == "state":
            return self._made(subject, predicate.words, places)
        if predicate is not None and predicate.kind == "done":
            return self._done_to(subject, predicate, places)
        if places:
            raise NotUnderstood(
                f"{self.said.clause!r} is a place, and places stay where they are: {EXAMPLE}"
            )
        who = self.subjects(subject, THINGS, "an object or a robot")
        frame = framed(predicate.arguments if predicate is not None else arguments)
        where, home = self.whereto(frame, each=True)
        return self.to_target(who, where, home)

    def _made(
        self, subject: Nouns, words: Sequence[Lexeme], places: bool, negated: bool = False
    ) -> None:
        for word in words:
            able = self.stated.able(word)
            if places:
                mentions = self.place_mentions(subject)
            elif self.can_be(subject, ("object",)):
                things = self.subjects(subject, ("object",), "an object")
                mentions = self.those(things, able, word.word)
                self.said.remember(mentions)
            else:
                mentions = [self.resolve(s) for s in self.subjects(subject, ("robot",), "a robot")]
            for mention in mentions:
                self.wish([mention], self.stated.wants(word, mention.subjects[0], negated))

    def _done_to(self, subject: Nouns, predicate: Predicate, places: bool) -> None:
        participle = predicate.words[0]
        frames = self._frames(participle, predicate.arguments, ("PART",))
        problems: list[NotUnderstood] = []
        for frame, phrases in frames:
            try:
                return self._passive(subject, frame, phrases, places)
            except NotUnderstood as problem:
                problems.append(problem)
        raise problems[0] if problems else NotUnderstood(f"{self.said.clause!r}: {EXAMPLE}")

    def _passive(
        self, subject: Nouns, frame: Frame, phrases: Sequence[SkillFrame], places: bool
    ) -> None:
        if phrases:
            return self.skill(replace(frame, themes=(subject, *frame.themes)), phrases)
        relation = next((name for sense, name in _DONE.items() if sense in frame.senses), None)
        if relation is not None and "move" not in frame.senses:
            self.said.elliptic = ""
            if frame.places or frame.themes:
                raise NotUnderstood(f"{self.said.clause!r}: say it as a command")
            return self._has_been(subject, relation)
        if places:
            raise NotUnderstood(f"{self.said.clause!r}: places stay where they are")
        who = self.subjects(subject, THINGS, "an object or a robot")
        where, home = self.whereto(frame, each=True)
        return self.to_target(who, where, home or "tidy" in frame.senses)

    def _has_been(self, subject: Nouns, relation: str) -> None:
        wanted = PLACES if relation == SEARCHED else ("object",)
        if relation == SEARCHED and self.can_be(subject, PLACES):
            return self.searched([n for m in self.place_mentions(subject) for n in m.subjects])
        who = self.subjects(subject, THINGS, "an object")
        mentions = [self.resolve(self.movable(s) if relation == HELD else s) for s in who]
        for mention in mentions:
            if mention.type not in wanted:
                raise NotUnderstood(
                    f"{self.said.clause!r}: {relation} is said of "
                    f"{'places' if relation == SEARCHED else 'objects'} only"
                )
            self.said.draft.add(relation, mention, True)
        return self.said.remember(mentions)

    def on_wanted(self, clause: Clause) -> None:
        assert clause.subject is not None
        if clause.predicate is not None:
            return self._to_be(clause.subject, clause.predicate, clause.arguments)
        self.said.elliptic = "be"
        things = self.subjects(clause.subject, ("object",), "an object")
        speaker = self.vocabulary.speaker
        if speaker is None:
            raise NotUnderstood(f"{self.said.clause!r} does not say where to: name a place")
        from_speaker = Mention((speaker,), "object", clause.first)
        where = self.where([])
        return self.to_target(
            things, replace(where, target=from_speaker.subjects[0], target_type="object"), False
        )

    def on_belongs(self, clause: Clause) -> None:
        assert clause.subject is not None
        self.said.elliptic = "be"
        if not self.can_be(clause.subject, THINGS) and self.can_be(clause.subject, PLACES):
            raise NotUnderstood(f"{self.said.clause!r}: places stay where they are")
        who = self.subjects(clause.subject, THINGS, "an object or a robot")
        where, home = self.whereto(framed(clause.arguments))
        if where.target_type == "robot" or where.source is not None:
            raise NotUnderstood(
                f"{self.said.clause!r} does not say in which place it belongs: {EXAMPLE}"
            )
        return self.to_target(who, where, home)

    # --- what is so, or shall be so after "make sure that" ----------------------------------------
    def on_being(self, clause: Clause) -> None:
        assert clause.subject is not None
        if self.said.elliptic == "be":
            self._to_be(clause.subject, clause.predicate, clause.arguments)
            return
        self._claims()
        predicate = clause.predicate
        if predicate is None:
            raise NotUnderstood(f"{self.said.clause!r} is not understood as a fact: {SAY_IT}")
        if predicate.kind == "placed":
            self.placed(clause.subject, predicate.arguments)
        elif predicate.kind == "state":
            self._are(clause.subject, predicate.words, False)
        else:
            self._were(clause, True)

    def on_there(self, clause: Clause) -> None:
        assert clause.subject is not None
        if self.said.elliptic == "be":
            return self._to_be(clause.subject, None, clause.arguments)
        self._claims()
        return self.placed(clause.subject, clause.arguments)

    # --- what goes on from a clause before --------------------------------------------------------
    def on_bare(self, clause: Clause) -> None:
        """`and the book to the kitchen`, `and the second cup in the hallway`."""
        assert clause.subject is not None
        if self.said.elliptic == "is":
            return self.placed(clause.subject, clause.arguments)
        if self.mode == "fact":
            return self.placed(clause.subject, clause.arguments)
        if not self.said.elliptic:
            subject = clause.subject.items
            shown = self.said.quote(subject[0].first, subject[-1].last)
            raise NotUnderstood(f"{shown!r} is not understood as a goal: {EXAMPLE}")
        who = self.subjects(clause.subject, THINGS, "an object or a robot")
        verb = self.said.verb.split() if self.said.elliptic == "move" else [""]
        fetching = verb[0] in self.tagger.book.fetching
        where, home = self.whereto(framed(clause.arguments), each=True, fetching=fetching)
        return self.to_target(who, where, home)

    def on_whereto(self, clause: Clause) -> None:
        """`and then to the kitchen`."""
        if not self.said.elliptic or not (self.said.recent or self.said.moved):
            raise NotUnderstood(f"{self.said.clause!r} is not understood as a goal: {EXAMPLE}")
        where, home = self.whereto(framed(clause.arguments))
        same: list[Subject] = list(self.said.recent[:1]) or self.said.moved
        return self.to_target(same, where, home)

    def on_named(self, clause: Clause) -> None:
        assert clause.subject is not None
        strange = any("UNK" in w.tags for n in clause.subject.items for w in n.head)
        if self.said.elliptic and not strange and self.can_be(clause.subject, PLACES):
            raise NotUnderstood(
                f"{self.said.clause!r} is one place too many for one thing; if one is to come "
                'after the other, say "then"'
            )
        if self.said.elliptic and not strange:
            raise NotUnderstood(f"{self.said.clause!r} does not say where to: name a place")
        shown = self.said.clause
        raise NotUnderstood(f"{shown!r} is not understood as a goal: {EXAMPLE}")

    def on_enough(self, clause: Clause) -> None:
        """`a bottle in the kitchen would do`: which of what was asked for before, and where to."""
        assert clause.subject is not None
        noun = self.subject(clause.subject.items[0], ("object",), "an object")
        will_do = self.resolve(self.movable(noun)).subjects
        asked = [m for m in self.said.recent if m.open and set(m.subjects) & set(will_do)]
        if len(asked) != 1:
            raise NotUnderstood(
                f"{self.said.clause!r}: nothing was asked for before that it could do for"
            )
        meant = self.said.draft.narrow(asked[0], will_do)
        self.said.remember([meant])
        if clause.arguments:
            where, home = self.whereto(framed(clause.arguments))
            self.to_target([meant], where, home)

    # --- what shall stay, or never be -------------------------------------------------------------
    def on_kept(self, clause: Clause) -> None:
        self.said.always.extend(self._aside(clause.subject, clause.predicate))

    def on_never_be(self, clause: Clause) -> None:
        self.said.never.extend(self._aside(clause.subject, clause.predicate))

    def _aside(self, subject: Nouns | None, predicate: Predicate | None) -> list[Condition]:
        """The conditions that a clause asks for, beside the stages."""
        draft, self.said.draft = self.said.draft, GoalDraft(self.vocabulary.is_at)
        try:
            self._to_be(subject, predicate, ())
            return [c for stage in self.said.draft.conditions() for c in stage]
        finally:
            self.said.draft, self.said.elliptic = draft, ""

    def on_never_do(self, clause: Clause) -> None:
        """`never go to the kitchen`, `the hsr should never enter it`."""
        assert clause.verb is not None
        who = None
        if clause.subject is not None:
            who = self.subjects(clause.subject, ("robot",), "a robot")
        self._never(clause, who)

    def _never(self, clause: Clause, who: Sequence[Subject] | None) -> None:
        assert clause.verb is not None
        frames = self._frames(clause.verb, clause.arguments, ("VERB", "FIN", "GER"))
        going = [frame for frame, _ in frames if "go" in frame.senses]
        making = [(frame, phrases) for frame, phrases in frames if phrases]
        if going:
            where = self._entered(going[0])
            names = [n for s in who or () for n in self.resolve(s).subjects]
            names = names or self.able_to_drive()
            self.said.never.extend(
                Condition(relation=AT, subject=name, value=place)
                for name in names
                for place in where
            )
            return
        if making:
            draft, self.said.draft = self.said.draft, GoalDraft(self.vocabulary.is_at)
            try:
                self.skill(*making[0])
                self.said.never.extend(c for s in self.said.draft.conditions() for c in s)
            finally:
                self.said.draft = draft
            return
        raise NotUnderstood(f'"{self.said.clause}" {reason_for([("not", "not")], "a goal")}'[0:200])

    def _entered(self, frame: Frame) -> list[str]:
        nouns = list(frame.themes) + [p.nouns for p in frame.places if p.nouns is not None]
        if not nouns or frame.particle_words:
            raise NotUnderstood(f"{self.said.clause!r} does not say which place: name it")
        return [n for each in nouns for m in self.place_mentions(each) for n in m.subjects]

    def on_avoid(self, clause: Clause) -> None:
        """`avoid the kitchen`, `without entering the kitchen`."""
        if clause.verb is not None:
            return self._never(clause, self.said.addressees or None)
        assert clause.subject is not None
        self.said.never.extend(
            Condition(relation=AT, subject=name, value=place)
            for name in self.able_to_drive()
            for m in self.place_mentions(clause.subject)
            for place in m.subjects
        )
        return None

    # --- questions that are goals, for those who cannot be answered -------------------------------
    def on_where(self, clause: Clause) -> None:
        assert clause.subject is not None
        if self.mode == "goal":
            if self.can_be(clause.subject, ("robot",)) and not self.can_be(
                clause.subject, ("object",)
            ):
                text = self.said.clause
                subject = clause.subject.items
                text = self.said.quote(subject[0].first, subject[-1].last)
                raise NotUnderstood(f"{text!r}: {ROBOTS_TELL}")
            return self.find_these(clause.subject, ())
        self.ask_where(clause)
        return None


def _whereto(frame: Frame) -> bool:
    return bool(frame.places) or frame.home or "back" in frame.particle_words


def _fitted(
    frame: Frame, behind: Sequence[Phrase], senses: frozenset[str], verb: str
) -> Frame | None:
    """The frame as that of a verb with these words behind it; `None`: they are not there."""
    left = list(frame.particles)
    places = list(frame.places)
    themes = frame.themes
    for i, chunk in enumerate(behind):
        one = next((p for p in left if p.lexeme.words == chunk), None)
        rest = tuple(word for later in behind[i:] for word in later)
        if one is not None:
            left.remove(one)
            continue
        at = next((p for p in places if tuple(p.preposition.split()) == rest), None)
        if at is None or (themes and "find" in senses):
            return None
        if senses & {"find", SKILL} and not themes and at.nouns is not None:
            places.remove(at)
            themes = (at.nouns,)
        break
    return Frame(verb, senses, themes, tuple(places), tuple(left), frame.but)
