"""What single verbs ask for: finding, searching, picking up, tidying."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fleet.core.language.locations import PLACES
from fleet.core.language.mentions import Mention
from fleet.core.language.moving import HOME_HINT, Moving
from fleet.core.language.refusals import one_of
from fleet.core.language.subjects import Subject
from fleet.core.language.verbs import EXAMPLE
from fleet.core.language.wordlists import ANYWHERE, WHOLE_HOUSE
from fleet.errors import NotUnderstood

_ROBOTS_TELL = "robots say themselves where they are; see their states"


class Clauses(Moving):
    """Turns the clauses of one text into wishes."""

    def tidy(self) -> None:
        """`tidy up`, `tidy up the kitchen`, `put the cups away`."""
        cursor = self.cursor
        cursor.take("up")
        start = cursor.at
        preposed = cursor.preposition() is not None
        about_things = cursor.word() in ("it", "them") or (
            not cursor.next_of(WHOLE_HOUSE) and self.nouns.starts(("object",))
        )
        if not preposed and about_things:
            return self.move(tidy=True)
        where: Sequence[str] | None = None
        if preposed or not (cursor.at_border() or cursor.word() == "and"):
            where = self._tidied()
            cursor.take("up")
        cursor.take_word(("up", "away"))
        homes = {
            o.object: o.home
            for o in self.words.objects.values()
            if o.movable and o.home and o.home in self.words.places
        }
        names = tuple(homes) if where is None else self._misplaced(homes, where)
        if not names:
            raise NotUnderstood(f"nothing has a home: {HOME_HINT}")
        for name in names:
            self.draft.add("at", Mention((name,), "object", start), homes[name])
        self.subjects.remember([Mention(names, "object", start)])
        return None

    def _tidied(self) -> tuple[str, ...] | None:
        """The places that come next; `None` for all of them."""
        named = self.place_mentions()
        for mention in named or ():
            if mention.sort == "surface":
                raise self.by_surface(self.cursor.said(self.began), mention.subjects)
        names = dict.fromkeys(n for m in named or () for n in m.subjects)
        everywhere = named is None or (len(names) > 1 and set(names) == set(self.words.places))
        return None if everywhere else tuple(names)

    def _misplaced(self, homes: Mapping[str, str], where: Sequence[str]) -> tuple[str, ...]:
        """What is believed to be in these places and belongs elsewhere.

        Raises:
            NotUnderstood: there is nothing of that kind in one of them.
        """
        at = self.words.whereabouts
        names = tuple(n for n, home in homes.items() if at.get(n) in where and at[n] != home)
        if tidy := [place for place in where if place not in {at[name] for name in names}]:
            raise NotUnderstood(
                f"nothing that belongs elsewhere is believed to be in {one_of(tidy)}: have it "
                'searched first, or say where things belong with the field "home" of the object'
            )
        return names

    @staticmethod
    def by_surface(said: str, places: Sequence[str]) -> NotUnderstood:
        """Things on a surface cannot be told from other things in its place."""
        return NotUnderstood(
            f"{said!r}: name the things and where to bring them, or say "
            f'"tidy up {one_of(places)}"; it is known in which place things are, not on which '
            "surface"
        )

    # --- finding, picking up, searching -----------------------------------------------------------
    def find(self) -> None:
        """`find NP`, perhaps with where to look."""
        cursor, start = self.cursor, self.cursor.at
        if self.nouns.starts(("robot",)) and not self.nouns.starts(("object",)):
            raise NotUnderstood(f"{cursor.said(*cursor.phrase())!r}: {_ROBOTS_TELL}")
        found = self.subjects.read("an object", ("object",))
        if any(isinstance(s, Mention) and s.sort == "robot" for s in found):
            raise NotUnderstood(_ROBOTS_TELL)
        mentions = [self.subjects.settle(subject) for subject in found]
        if not cursor.take_of(ANYWHERE):
            parts, _ = self.parts()
            where = self.where(parts)
            if where.target_sort == "robot" or any(p.preposition == "to" for p in parts):
                raise NotUnderstood(f"{cursor.said(start)!r}: things are looked for in places")
            if place := where.target or where.source:
                self.searched((place,), start)
        for mention in mentions:
            self.draft.add("located", mention, True)
        self.subjects.remember(mentions)

    def pick(self) -> None:
        """`pick up NP`, perhaps with where it is."""
        cursor = self.cursor
        picked = [self.subjects.movable(s) for s in self.subjects.read("an object", ("object",))]
        if any(isinstance(s, Mention) and s.sort == "robot" for s in picked):
            raise NotUnderstood("a robot cannot be picked up: name an object")
        cursor.take("up")
        start = cursor.at
        parts, home = self.parts()
        where = self.where(parts)
        if home or any(part.preposition == "to" for part in parts):
            raise NotUnderstood(f'{cursor.said(start)!r}: to move a thing, say "bring"')
        mentions = [self.subjects.settle(s, where.target or where.source) for s in picked]
        for mention in mentions:
            self.draft.add("held", mention, True)
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
        mentions = [self.subjects.settle(self.subjects.drivers(subject)) for subject in who]
        if len(mentions) != 1 or not mentions[0].single:
            raise NotUnderstood(
                f"{self.cursor.said(self.began)!r} does not say which robot goes where: say it of "
                "one robot at a time, or leave the robots out"
            )
        for i, place in enumerate(self._route()):
            if i:
                self.draft.next_stage()
            self.draft.add("at", mentions[0], place)
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
            return tuple(self.words.places)
        return tuple(name for mention in named for name in mention.subjects)

    def searched(self, places: Sequence[str], key: int) -> None:
        """Wish that somebody looked around in these places."""
        self.draft.add("searched", Mention(tuple(places), "place", key), True)
        if len(places) == 1:
            self.last_place = places[0]

    def places(self) -> tuple[str, ...]:
        """The places that come next: one, several, or all of them."""
        named = self.place_mentions()
        if named is None:
            return tuple(self.words.places)
        return tuple(dict.fromkeys(name for m in named for name in m.subjects))

    def place_mentions(self) -> list[Mention] | None:
        """The places that come next, and places of surfaces; `None` for the whole house."""
        cursor = self.cursor
        named = cursor.lexicon.exact(cursor.tokens, cursor.at, PLACES)[1]
        if not named and self.words.places and cursor.take_of(WHOLE_HOUSE):
            return None
        found = self.subjects.read("a place", PLACES)
        mentions = [self.subjects.settle(subject) for subject in found]
        for mention in mentions:
            if mention.open or mention.sort not in PLACES:
                raise NotUnderstood(f"it does not say which place: {EXAMPLE}")
        return mentions
