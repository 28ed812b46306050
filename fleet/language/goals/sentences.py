"""Sentences that ask for something: with a verb in front, or with a subject and "should"."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.goals.clauses import Clauses
from fleet.language.phrases.locations import PLACES
from fleet.language.phrases.mentions import NounPhrase
from fleet.language.phrases.subjects import THINGS, Subject
from fleet.language.refusals import suggestion
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.tokens import words_in
from fleet.language.words.verb_senses import (
    BASE_VERBS,
    EXAMPLE,
    FINITE,
    IMPERATIVES,
    PARTICIPLES,
    VerbSense,
)
from fleet.language.words.wordlists import CLOSERS, COPULAR_VERBS, HOME, MODALS, OPENERS, SITUATED
from keyexpr_schema.facts import HELD, LOCATED, SEARCHED

_RELATIONS = {VerbSense.FIND: LOCATED, VerbSense.PICK: HELD, VerbSense.SEARCH: SEARCHED}
"""What holds when it has been done: "the book should be found"."""
_QUESTIONS = frozenset(words_in("is are was were does did has what who why how which whose"))


class Sentences(Clauses):
    """Clauses with who shall do it, or what shall be so."""

    def __init__(self, text: str, vocabulary: Vocabulary) -> None:
        super().__init__(text, vocabulary)
        self.addressees: list[Subject] = []  # whom the sentence speaks to: "HSR, go … and …"
        self.elliptic = ""  # "move": "and the book to the kitchen" may follow; "be": "… is in …"

    def polite(self) -> bool:
        """Go past words of politeness; never past a name."""
        cursor, start = self.cursor, self.cursor.at
        opener = cursor.next_of(OPENERS) or cursor.next_of(CLOSERS)
        if opener is None:
            return False
        end = cursor.lexicon.exact(cursor.tokens, start, (*THINGS, "place", "surface"))[0]
        if end > start or cursor.verb_next():
            return False
        cursor.at += len(opener)
        return True

    # --- verbs -----------------------------------------------------------------------------------
    def imperative(self) -> None:
        """`bring …`, `go to …`: a verb comes next."""
        cursor = self.cursor
        verb = cursor.longest(IMPERATIVES)
        assert verb is not None
        cursor.at += len(verb)
        self.verb, senses = verb[0], IMPERATIVES[verb]
        if VerbSense.GO in senses and cursor.verb_next() and not cursor.next_of(HOME):
            return self.imperative()  # "go get", "come find"
        return self.do(senses, self.addressees or None)

    def do(self, senses: frozenset[VerbSense], who: Sequence[Subject] | None) -> None:
        """What follows a verb; `who` is named before it, if anybody is."""
        self.elliptic = "move" if senses & {VerbSense.MOVE, VerbSense.GO, VerbSense.GIVE} else ""
        if VerbSense.GO in senses and (VerbSense.MOVE not in senses or self._whereto_next()):
            return self.go(who)
        if VerbSense.PATROL in senses and any(not self._any_robot(s) for s in who or ()):
            self._check_robots(who or ())
            return self.patrol(who or ())
        if who is not None:
            self._check_who(who)
        if VerbSense.MOVE in senses:
            return self.move(fetch=VerbSense.FETCH in senses, tidy=VerbSense.TIDY in senses)
        if VerbSense.GIVE in senses:
            return self.move(give=True)
        if VerbSense.TIDY in senses:
            return self.tidy()
        if VerbSense.FIND in senses:
            return self.find()
        if VerbSense.PICK in senses:
            return self.pick()
        return self.search()

    def _whereto_next(self) -> bool:
        cursor, start = self.cursor, self.cursor.at
        found = cursor.preposition() is not None or cursor.word() in ("back", "there")
        cursor.at = start
        return found or bool(cursor.next_of(HOME))

    @staticmethod
    def _any_robot(subject: Subject) -> bool:
        return isinstance(subject, NounPhrase) and subject.generic and subject.count is None

    def _check_robots(self, who: Sequence[Subject]) -> None:
        if any(subject.type != "robot" for subject in who):
            raise NotUnderstood(f"{self.clause!r}: only robots do something")

    def _check_who(self, who: Sequence[Subject]) -> None:
        self._check_robots(who)
        for subject in who:
            names = subject.names if isinstance(subject, NounPhrase) else subject.subjects
            if not self._any_robot(subject) and len(self.vocabulary.robots) > 1:
                raise NotUnderstood(
                    f"{' and '.join(names)} cannot be told to do it: a goal says what must hold, "
                    "and the allocator finds who does it; leave the name out"
                )

    # --- sentences with a subject -----------------------------------------------------------------
    def there_should_be(self) -> None:
        """`there should be NP in PLACE`, after "there"."""
        cursor = self.cursor
        if not (cursor.take_of(MODALS) and cursor.take("be")) and not cursor.take_word(
            ("is", "are")
        ):
            raise self.no_clause()
        things = self.subjects.read("an object", THINGS)
        self._to_be(things)

    def declarative(
        self, *, states: bool = False, wanted: bool = False, bare_infinitive: bool = False
    ) -> None:
        """`NP should be …`, `NP, go to …`, and `NP to …` after another clause.

        `states`: "make sure that" came before; `wanted`: "I need"; `bare_infinitive`: "let".
        """
        cursor, start = self.cursor, self.cursor.at
        self.addressees = []
        types = THINGS if self.nouns.starts(THINGS) or cursor.word() in ("it", "them") else PLACES
        who = self.subjects.read("an object or a robot" if types == THINGS else "a place", types)
        robots = all(s.type == "robot" for s in who)
        comma = robots and self.cursor.take(",")
        while comma and self.polite():
            pass
        modal = bool(cursor.take_of(MODALS)) or bare_infinitive
        infinitive = (wanted or bare_infinitive or states) and cursor.take("to")
        if (infinitive or wanted) and cursor.take("be"):
            modal = True
        elif cursor.take_word(COPULAR_VERBS):
            if not (modal or states or self.elliptic == "be"):
                raise NotUnderstood(
                    f"{self.cursor.line!r} states a fact; a goal says what should be: "
                    '"the cup should be in the hallway"'
                )
            cursor.take("been")
        elif cursor.take("have", "been") or cursor.take("has", "been"):
            modal = True
        elif cursor.take_word(("belongs", "belong")):
            return self._belongs(who)
        elif robots and (verb := cursor.longest(FINITE)):
            cursor.at += len(verb)
            self.addressees = [s for s in who if not (isinstance(s, NounPhrase) and s.generic)]
            return self.do(FINITE[verb], who)
        elif not (wanted or self.elliptic) or comma or modal:
            raise self.no_clause(start)
        return self._to_be(who)

    def _to_be(self, who: Sequence[Subject]) -> None:
        """What follows "should be": a place, or what should have been done."""
        self.elliptic = "be"
        if all(s.type == "object" for s in who) and (made := self.state()) is not None:
            return self.made_so(who, made)
        done = self._done()
        relation = next((name for sense, name in _RELATIONS.items() if sense in done), None)
        if relation is not None and VerbSense.MOVE not in done:
            self.elliptic = ""
            return self._has_been(who, relation)
        if any(s.type in PLACES for s in who):
            shown = self.clause
            raise NotUnderstood(
                f"{shown!r} is one place too many for one thing; if one is to come after the "
                'other, say "then"'
                if self.moved
                else f"{shown!r} is a place, and places stay where they are: {EXAMPLE}"
            )
        locatives, home = self.locatives()
        return self.to_target(who, self.where(locatives, each=True), home or VerbSense.TIDY in done)

    def _belongs(self, who: Sequence[Subject]) -> None:
        """`NP belongs in PLACE`, after the verb."""
        self.elliptic = "be"
        if any(s.type in PLACES for s in who):
            raise NotUnderstood(f"{self.clause!r}: places stay where they are")
        locatives, home = self.locatives()
        where = self.where(locatives)
        if where.target_type == "robot" or where.source is not None:
            raise NotUnderstood(
                f"{self.clause!r} does not say in which place it belongs: {EXAMPLE}"
            )
        return self.to_target(who, where, home)

    def _done(self) -> frozenset[VerbSense]:
        """The participle that comes next, past words such as "located" and "now"."""
        cursor = self.cursor
        while True:
            verb = cursor.longest(PARTICIPLES)
            start = cursor.at
            if verb is not None:
                cursor.at += len(verb)
                senses = PARTICIPLES[verb]
                if not senses & {VerbSense.FIND} or self._ends():
                    return senses
                cursor.at = start
            if not cursor.take_of(SITUATED):
                return frozenset()

    def _ends(self) -> bool:
        return self.cursor.at_border() or self.cursor.word() == "and"

    def _has_been(self, who: Sequence[Subject], relation: str) -> None:
        mentions = [self.subjects.resolve(self.subjects.movable(s)) for s in who]
        wanted = PLACES if relation == SEARCHED else ("object",)
        for mention in mentions:
            if mention.type not in wanted:
                raise NotUnderstood(
                    f"{self.clause!r}: {relation} is said of "
                    f"{'places' if relation == SEARCHED else 'objects'} only"
                )
            self.draft.add(relation, mention, True)
        if relation != SEARCHED:
            self.subjects.remember(mentions)

    # --- refusals --------------------------------------------------------------------------------
    def no_clause(self, start: int | None = None) -> NotUnderstood:
        """What comes next is nothing that a goal could say."""
        cursor = self.cursor
        first = cursor.at if start is None else start
        special = cursor.refusal("")
        cursor.at = first
        if cursor.word() == "another" or cursor.word(1) == "other":
            self.nouns.noun("an object", THINGS)  # says itself what is wrong with it
            cursor.at = first
        shown = cursor.quote(*cursor.phrase())
        if shown and shown.split()[0].casefold() in _QUESTIONS:
            return NotUnderstood(
                f"{self.cursor.line!r} is a question; a goal says what should hold: {EXAMPLE}"
            )
        hint = suggestion(shown.split()[0], BASE_VERBS) if shown and start is None else ""
        if str(special):
            return special
        return NotUnderstood(f"{shown!r} is not understood as a goal{hint}: {EXAMPLE}")
