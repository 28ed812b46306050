"""Clauses about where things and robots shall be: bringing, giving, putting back, going."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.goals.stages import GoalDraft
from fleet.language.phrases.cursor import Cursor
from fleet.language.phrases.locations import SPOTS, Locations, Locative, Where
from fleet.language.phrases.mentions import Mention, NounPhrase
from fleet.language.phrases.noun_phrases import NounPhrases
from fleet.language.phrases.subjects import THINGS, Subject, Subjects
from fleet.language.refusals import listed, one_of
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.lexicon import EntityType, lexicon_of
from fleet.language.words.morphology import gerund
from fleet.language.words.verb_senses import PARTICLES
from fleet.language.words.wordlists import HOME, RELATIVE, SPEAKER
from keyexpr_schema.facts import AT, HELD, IN, ON
from keyexpr_schema.payloads.world import Feature

HOME_HINT = 'give it one with the field "home" of the object'


_OFFERING = frozenset(
    form
    for verb in ("bring", "give", "hand", "fetch", "get", "take", "pass")
    for form in (verb, gerund(verb))
)
"""Verbs that may name the receiver first: "give the robot the cup"."""


class Moving:
    """Turns clauses about where things and robots shall be into wishes."""

    def __init__(self, text: str, vocabulary: Vocabulary, what: str = "a goal") -> None:
        self.vocabulary = vocabulary
        self.cursor = Cursor(text, lexicon_of(vocabulary), what)
        self.nouns = NounPhrases(self.cursor)
        self.subjects = Subjects(self.cursor, self.nouns, vocabulary)
        self.locations = Locations(self.cursor, self.nouns, vocabulary)
        self.draft = GoalDraft(vocabulary.is_at)
        self.moved: list[Subject] = []  # what "and then to the kitchen" is about
        self.last_place: str | None = None
        self.verb = ""
        self.began = 0  # the token at which the clause began

    @property
    def clause(self) -> str:
        """The clause as far as it is read, as it was written."""
        return self.cursor.quote(self.began)

    # --- moving ----------------------------------------------------------------------------------
    def move(self, *, tidy: bool = False, give: bool = False, fetch: bool = False) -> None:
        """`bring NP to PLACE`, `give NP to ROBOT`, `give ROBOT NP`, `put NP back`.

        `fetch`: a later clause may say where to, as in "fetch the cup and put it in the kitchen".
        """
        cursor = self.cursor
        to_speaker = cursor.take_word(SPEAKER) is not None
        moved = self.subjects.read("an object", THINGS)
        first = moved[0]
        to_robot = (
            self.verb in _OFFERING
            and len(moved) == 1
            and isinstance(first, NounPhrase)
            and (first.type == "robot" or all(map(self.vocabulary.is_person, first.names)))
        )
        if to_robot and not cursor.at_border() and self.nouns.starts(("object",)):
            assert isinstance(first, NounPhrase)
            moved = self.subjects.read("an object", ("object",))
            return self.to_target(moved, Where(None, *self._receiver(first)), False)
        locatives, home = self.locatives()
        where = self.where(locatives, each=not give)
        if to_speaker and where.target is None and not where.each and not home:
            where = replace(where, target=self.vocabulary.speaker, target_type="object")
        if give and where.target is not None and not self._receives(where):
            people = sorted(filter(self.vocabulary.is_person, self.vocabulary.objects))
            known = listed([*cursor.lexicon.known(("robot",)), *people])
            raise NotUnderstood(
                f"{where.target!r} is no {'robot or person' if people else 'robot'} that something "
                f"could be given to; known are {known}"
            )
        whereto = where.target is not None or bool(where.each) or home
        if fetch and not whereto and (cursor.at_border() or self._and_next()):
            return self._fetched(moved, where)
        return self.to_target(moved, where, home or (tidy and where.target is None))

    def _receives(self, where: Where) -> bool:
        return where.target_type == "robot" or self.vocabulary.is_person(where.target or "")

    def _and_next(self) -> bool:
        return self.cursor.word() in ("and", "then")

    def _fetched(self, moved: Sequence[Subject], where: Where) -> None:
        if any(subject.type == "robot" for subject in moved):
            raise self._no_target()
        mentions = [self._from(self.subjects.movable(s), where) for s in moved]
        for mention in mentions:
            self.draft.add(HELD, mention, True, whereto=True)
        self.subjects.remember(mentions)

    def _from(self, subject: Subject, where: Where) -> Mention:
        """Who is meant, told apart by where they are."""
        return self.subjects.resolve(subject, where.source, where.source_surface)

    def _receiver(self, noun: NounPhrase) -> tuple[str, EntityType]:
        mention = noun.resolve()
        if mention.open or len(mention.subjects) != 1:
            raise NotUnderstood(f"{noun.text!r} does not say which {noun.type}: name it")
        return mention.subjects[0], mention.type

    def locatives(self) -> tuple[list[Locative], bool]:
        """The prepositional phrases and particles that come next; whether they say "home"."""
        cursor, home, belongs = self.cursor, False, False
        locatives: list[Locative] = []
        while True:
            before = cursor.at
            if self._home():
                home = belongs = True
            elif cursor.take("there") or cursor.take("back", "there") or cursor.take("to", "there"):
                locatives.append(self._there(before))
            elif cursor.take_of(RELATIVE) and cursor.preposition() is None:
                cursor.at = before
                break
            elif cursor.at > before:
                locatives.append(self.locations.locative("in"))
            elif (preposition := cursor.preposition()) is not None:
                locatives.append(self.locations.locative(preposition))
            elif cursor.word() in PARTICLES:
                home = home or cursor.word() in ("back", "away")
                cursor.at += 1
            else:
                break
        placed = any(locative.preposition != "from" for locative in locatives)
        if placed and belongs:
            raise NotUnderstood(f'{self.clause!r} names a place and says "home": say one of them')
        return locatives, home and not placed

    def _home(self) -> bool:
        """Whether "home" comes next, and nothing known is called so."""
        cursor = self.cursor
        phrase = cursor.next_of(HOME)
        if phrase is None:
            return False
        for ahead in range(len(phrase)):
            if cursor.lexicon.exact(cursor.tokens, cursor.at + ahead, SPOTS)[1]:
                return False
        cursor.at += len(phrase)
        return True

    def _there(self, start: int) -> Locative:
        if self.last_place is None:
            raise NotUnderstood('"there" refers to no place before it: name the place')
        found = tuple(e for e in self.cursor.lexicon.entities if e.id == self.last_place)
        found = tuple(e for e in found if e.type == "place")
        return Locative("to", NounPhrase(found, self.cursor.quote(start), start, exact=True))

    def where(self, locatives: Sequence[Locative], each: bool = False) -> Where:
        """Source and target of prepositional phrases; the target is what "there" means next.

        Raises:
            NotUnderstood: they say "every room", and not `each` of several can be meant.
        """
        where = self.locations.where(locatives)
        if where.each and not each:
            raise self._which_of(where)
        if where.target is not None and where.target_type != "robot":
            self.last_place = where.target
        elif where.source in self.vocabulary.places:
            self.last_place = where.source
        return where

    @staticmethod
    def _which_of(where: Where) -> NotUnderstood:
        return NotUnderstood(f"{where.text!r} could be {one_of(where.each)}: say which")

    def _to_each(self, moved: Sequence[Subject], where: Where) -> None:
        """Wish that another one is in each of several places: "a cup in every room".

        Raises:
            NotUnderstood: what is moved is said by name, and cannot be everywhere.
        """
        able = [self.subjects.drivers(self.subjects.movable(subject)) for subject in moved]
        mentions = [self._from(subject, where) for subject in able]
        if len(mentions) != 1 or not mentions[0].open:
            raise self._which_of(where)
        if len(mentions[0].subjects) < len(where.each):
            raise NotUnderstood(
                f"{where.text!r} are {len(where.each)}, and there are only "
                f"{len(mentions[0].subjects)} for them: {one_of(mentions[0].subjects)}"
            )
        for number, place in enumerate(where.each, 1):
            # Each is one of its own: negative keys are those of no word.
            one = replace(mentions[0], key=-(1000 * (mentions[0].key + 1) + number))
            if one.type == "robot":
                self.draft.add(AT, one, self.place_of(place))
            else:
                self.to_spot(one, place)
        self.moved = []
        self.subjects.remember([])

    def to_target(self, moved: Sequence[Subject], where: Where, home: bool) -> None:
        """Wish that these are at the target, or at home."""
        if where.each:
            return self._to_each(moved, where)
        self.moved = list(moved)
        able = [self.subjects.drivers(self.subjects.movable(subject)) for subject in moved]
        mentions = [self._from(subject, where) for subject in able]
        for mention in mentions:
            if home:
                self.home(mention)
            elif where.target is None:
                raise self._no_target()
            elif where.target_type == "robot" and mention.type == "robot":
                raise NotUnderstood("a robot goes to a place, not to a robot: name the place")
            else:
                self._put(mention, where, where.target)
        self.subjects.remember(mentions)
        if where.target is not None and where.target_type == "robot":
            receiver = Mention((where.target,), "robot", self.cursor.at)
            self.subjects.recent = [*self.subjects.recent, receiver]
        return None

    def _put(self, mention: Mention, where: Where, target: str) -> None:
        if mention.type == "robot":
            return self.draft.add(AT, mention, self.place_of(target))
        kept = tuple(name for name in mention.subjects if name != target)
        if not kept:
            raise NotUnderstood(f"{self.clause!r}: nothing can be on or in itself")
        others = replace(mention, subjects=kept, open=mention.open and len(kept) > 1)
        handed = where.target_type == "robot" or self.vocabulary.is_person(target)
        return self.draft.add(where.relation, others, target, on_robot=handed)

    def place_of(self, target: str) -> str:
        """The place where somebody goes who goes there.

        Raises:
            NotUnderstood: it is a thing, and not known where.
        """
        place = self.vocabulary.place_of(target)
        if place is None:
            raise NotUnderstood(f"it is not known in which place {target} is: name the place")
        return place

    def _no_target(self) -> NotUnderstood:
        cursor = self.cursor
        if not cursor.at_border() and cursor.word() != "and":
            shown, before = cursor.quote(*cursor.phrase()), self.clause
            return cursor.refusal(
                f"{shown!r} is not understood after {before!r}: say where to; known are "
                f"{listed(cursor.lexicon.known(('place',)))}"
            )
        return NotUnderstood(
            f"{self.clause!r} does not say where to: name a place; known are "
            f"{listed(cursor.lexicon.known(('place',)))}"
        )

    def home(self, mention: Mention) -> None:
        """Wish that each is where it belongs.

        Raises:
            NotUnderstood: it belongs nowhere in particular.
        """
        homes = {
            n: self.vocabulary.objects[n].home
            for n in mention.subjects
            if n in self.vocabulary.objects
        }
        homeless = [n for n in mention.subjects if not self.is_spot(homes.get(n))]
        if homeless or (mention.open and len(set(homes.values())) > 1):
            name = homeless[0] if homeless else mention.subjects[0]
            raise NotUnderstood(f"it is not known where {name} belongs: {HOME_HINT}")
        if mention.open:
            self.to_spot(mention, homes[mention.subjects[0]])
            return
        for name in mention.subjects:
            self.to_spot(Mention((name,), "object", mention.key), homes[name])

    def is_spot(self, name: str | None) -> bool:
        """Whether things can belong there: in a place, or on or in a thing."""
        return name in self.vocabulary.places or name in self.vocabulary.good_for

    def to_spot(self, mention: Mention, spot: str | None) -> None:
        """Wish that it is in that place, or on or in that thing."""
        good_for = self.vocabulary.good_for.get(spot or "", ())
        on = Feature.SUPPORTS in good_for
        within = Feature.CONTAINS in good_for
        self.draft.add(AT if on == within else ON if on else IN, mention, spot)

    # --- going -----------------------------------------------------------------------------------
    def go(self, who: Sequence[Subject] | None) -> None:
        """`go to PLACE`; any robot goes if nobody is named."""
        locatives, home = self.locatives()
        if home:
            raise NotUnderstood("a robot has no home: name the place where it shall go")
        where = self.where(locatives)
        if where.target is None or where.target_type == "robot":
            raise self.cursor.unknown("a place", ("place",))
        if who is not None:
            return self.to_target(who, where, False)
        self.moved = [robot := self.subjects.some_robot()]
        self.draft.add(AT, robot, self.place_of(where.target), means=True)
        return None
