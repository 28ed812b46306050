"""What single verbs ask for: finding, searching, picking up, patrolling."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.goals.tidying import Tidying
from fleet.language.phrases.locations import PLACES
from fleet.language.phrases.mentions import Mention
from fleet.language.phrases.subjects import Subject
from fleet.language.words.wordlists import ANYWHERE, WHOLE_HOUSE
from keyexpr_schema.facts import AT, HELD, LOCATED, SEARCHED
from keyexpr_schema.payloads.world import Feature

_ROBOTS_TELL = "robots say themselves where they are; see their states"


class Clauses(Tidying):
    """Turns the clauses of one text into wishes."""

    # --- finding, picking up, searching -----------------------------------------------------------
    def find(self) -> None:
        """`find NP`, perhaps with where to look."""
        cursor, start = self.cursor, self.cursor.at
        if self.nouns.starts(("robot",)) and not self.nouns.starts(("object",)):
            raise NotUnderstood(f"{cursor.quote(*cursor.phrase())!r}: {_ROBOTS_TELL}")
        found = self.subjects.read("an object", ("object",))
        if any(isinstance(s, Mention) and s.type == "robot" for s in found):
            raise NotUnderstood(_ROBOTS_TELL)
        mentions = [self.subjects.resolve(subject) for subject in found]
        if not cursor.take_of(ANYWHERE) and (places := self._where_to_look(start)):
            self.searched(places, start)
        for mention in mentions:
            self.draft.add(LOCATED, mention, True)
        self.subjects.remember(mentions)

    def _where_to_look(self, start: int) -> tuple[str, ...]:
        """`in PLACE`, `in PLACE and PLACE`, `everywhere`; nothing if nothing of it comes next."""
        cursor, here = self.cursor, self.cursor.at
        cursor.take_word(("in", "throughout"))
        if self.vocabulary.places and cursor.take_of(WHOLE_HOUSE):
            return tuple(self.vocabulary.places)
        cursor.at = here
        locatives, _ = self.locatives()
        where = self.where(locatives, each=True)
        if where.target_type == "robot" or any(p.preposition == "to" for p in locatives):
            raise NotUnderstood(f"{cursor.quote(start)!r}: things are looked for in places")
        if where.each:
            return where.each
        found = [place] if (place := where.target or where.source) else []
        while found:
            here = cursor.at
            if not cursor.take_joint():
                break
            cursor.preposition()
            if not self.nouns.starts(PLACES):
                cursor.at = here
                break
            found.extend(self.places())
        return tuple(dict.fromkeys(found))

    def pick(self) -> None:
        """`pick up NP`, perhaps with where it is."""
        cursor = self.cursor
        picked = [self.subjects.movable(s) for s in self.subjects.read("an object", ("object",))]
        if any(isinstance(s, Mention) and s.type == "robot" for s in picked):
            raise NotUnderstood("a robot cannot be picked up: name an object")
        cursor.take("up")
        start = cursor.at
        locatives, home = self.locatives()
        where = self.where(locatives)
        if home or any(locative.preposition == "to" for locative in locatives):
            raise NotUnderstood(f'{cursor.quote(start)!r}: to move a thing, say "bring"')
        mentions = [self.subjects.resolve(s, where.target or where.source) for s in picked]
        for mention in mentions:
            self.draft.add(HELD, mention, True)
        self.subjects.remember(mentions)

    def search(self) -> None:
        """`search PLACE`, perhaps with what for."""
        start = self.cursor.at
        self.searched(tuple(dict.fromkeys(self._route())), start)
        if self.cursor.take("for"):
            self.find()

    def patrol(self, who: Sequence[Subject]) -> None:
        """`ROBOT, patrol PLACE and PLACE`: it goes from one to the next, in that order.

        Raises:
            NotUnderstood: several robots, who could share the places or go to each of them.
        """
        mentions = [self.subjects.resolve(self.subjects.drivers(subject)) for subject in who]
        if len(mentions) != 1 or not mentions[0].single:
            raise NotUnderstood(
                f"{self.clause!r} does not say which robot goes where: say it of "
                "one robot at a time, or leave the robots out"
            )
        for i, place in enumerate(self._route()):
            if i:
                self.draft.next_stage()
            self.draft.add(AT, mentions[0], self.place_of(place))
            self.last_place = place
        self.subjects.remember(mentions)

    def _route(self) -> tuple[str, ...]:
        """The places where somebody shall look around, in the order of the words."""
        cursor, start = self.cursor, self.cursor.at
        cursor.preposition()
        cursor.take_word(("around", "through"))
        bare = cursor.at_border() or cursor.word() in ("for", "and", "there", "it")
        if bare and cursor.at > start:
            raise cursor.unknown("a place", ("place",))
        if bare:
            cursor.take_word(("there", "it"))
            if self.last_place is None:
                raise NotUnderstood(
                    'it does not say where to look around: name a place, or say "everywhere"'
                )
            return (self.last_place,)
        named = self.place_mentions()
        if named is None:
            return tuple(self.vocabulary.places)
        return tuple(name for mention in named for name in mention.subjects)

    def searched(self, places: Sequence[str], key: int) -> None:
        """Wish that somebody looked around in these places, or into these things."""
        places = [self._searchable(place) for place in places]
        self.draft.add(SEARCHED, Mention(tuple(places), "place", key), True)
        if len(places) == 1:
            self.last_place = places[0]

    def _searchable(self, name: str) -> str:
        """What is looked into: a thing that others can be in; else the place where it is."""
        inside = Feature.CONTAINS in self.vocabulary.good_for.get(name, ())
        return name if inside else self.place_of(name)
