"""What single verbs ask for: finding, searching, picking up, tidying."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.core.language.locations import PLACES
from fleet.core.language.mentions import Mention
from fleet.core.language.moving import HOME_HINT, Moving
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
        homes = {o.object: o.home for o in self.words.objects.values() if o.movable and o.home}
        where: Sequence[str] = tuple(self.words.places)
        if preposed or not (cursor.at_border() or cursor.word() == "and"):
            where = self.places()
            cursor.take("up")
        cursor.take_word(("up", "away"))
        names = tuple(name for name, home in homes.items() if home in where)
        if not names:
            what = f" in {', '.join(where)}" if cursor.at > start else ""
            raise NotUnderstood(f"nothing has a home{what}: {HOME_HINT}")
        for name in names:
            self.draft.add("at", Mention((name,), "object", start), homes[name])
        self.subjects.remember([Mention(names, "object", start)])
        return None

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
            places: Sequence[str] = (self.last_place,)
        else:
            places = self.places()
        self.searched(places, start)
        if cursor.take("for"):
            self.find()

    def searched(self, places: Sequence[str], key: int) -> None:
        """Wish that somebody looked around in these places."""
        self.draft.add("searched", Mention(tuple(places), "place", key), True)
        if len(places) == 1:
            self.last_place = places[0]

    def places(self) -> tuple[str, ...]:
        """The places that come next: one, several, or all of them."""
        cursor = self.cursor
        named = cursor.lexicon.exact(cursor.tokens, cursor.at, PLACES)[1]
        if not named and self.words.places and cursor.take_of(WHOLE_HOUSE):
            return tuple(self.words.places)
        found = self.subjects.read("a place", PLACES)
        mentions = [self.subjects.settle(subject) for subject in found]
        for mention in mentions:
            if mention.open or mention.sort not in PLACES:
                raise NotUnderstood(f"it does not say which place: {EXAMPLE}")
        return tuple(dict.fromkeys(name for m in mentions for name in m.subjects))
