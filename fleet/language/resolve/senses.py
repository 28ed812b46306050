"""What verbs ask for besides moving: finding, searching, picking up, tidying, and skills."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.nouns import PLACES
from fleet.language.resolve.places import WHERE
from fleet.language.resolve.wishes import EXAMPLE, HOME_HINT, Frame, Wishes
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tree.nodes import Nouns, Place
from fleet.language.vocabulary import SkillPhrase
from keyexpr_schema.facts import AT, HELD, LOCATED, SEARCHED, Value
from keyexpr_schema.payloads.world import Feature

ROBOTS_TELL = "robots say themselves where they are; see their states"


class Senses(Wishes):
    """Turns what verbs ask for into wishes."""

    # --- finding, picking up, searching -----------------------------------------------------------
    def find(self, frame: Frame) -> None:
        """`find NP`, perhaps with where to look."""
        themes, places = list(frame.themes), list(frame.places)
        if not themes and places and places[0].role == "for" and places[0].nouns:
            themes = [places.pop(0).nouns or Nouns(())]
        if len(themes) != 1:
            raise NotUnderstood(f"{self.said.clause!r} does not say what to look for")
        self.find_these(themes[0], places)

    def find_these(self, nouns: Nouns, places: Sequence[Place]) -> None:
        """Wish that it is known where these are, and that somebody looked in these places."""
        text = self.said.quote(nouns.items[0].first, nouns.items[-1].last)
        if self.can_be(nouns, ("robot",)) and not self.can_be(nouns, ("object",)):
            raise NotUnderstood(f"{text!r}: {ROBOTS_TELL}")
        found = self.subjects(nouns, ("object",), "an object")
        if any(isinstance(s, Mention) and s.type == "robot" for s in found):
            raise NotUnderstood(ROBOTS_TELL)
        mentions = [self.resolve(subject) for subject in found]
        self._look_in([p for p in places if p.special != "anywhere"])
        for mention in mentions:
            self.said.draft.add(LOCATED, mention, True)
        self.said.remember(mentions)

    def _look_in(self, places: Sequence[Place]) -> None:
        if not places:
            return None
        if any(p.role not in ("in", "from", "around") and p.special != "house" for p in places):
            raise NotUnderstood(f"{self.said.clause!r}: things are looked for in places")
        if len(places) > 1 and all(p.nouns and len(p.nouns.items) == 1 for p in places):
            where = self.where([self.locative(p) for p in places])
            names: tuple[str, ...] = tuple(filter(None, (where.target or where.source,)))
            return self.searched(names)
        found = [name for place in places for name in self.places(place)]
        return self.searched(tuple(dict.fromkeys(found)))

    def pick(self, frame: Frame) -> None:
        """`pick up NP`, perhaps with where it is."""
        if len(frame.themes) != 1:
            raise NotUnderstood(f"{self.said.clause!r} does not say what to pick up")
        picked = [self.movable(s) for s in self.subjects(frame.themes[0], ("object",), "an object")]
        if any(isinstance(s, Mention) and s.type == "robot" for s in picked):
            raise NotUnderstood("a robot cannot be picked up: name an object")
        locatives, home = self.locatives(frame)
        if home or any(locative.role == "to" for locative in locatives):
            raise NotUnderstood(f'{self.said.clause!r}: to move a thing, say "bring"')
        where = self.where(locatives, fetching=True)
        if where.source in self.vocabulary.places:
            self.said.last_place = where.source
        mentions = [self.resolve(s, where.source, where.source_surface) for s in picked]
        for mention in mentions:
            self.said.draft.add(HELD, mention, True)
        self.said.remember(mentions)

    def search(self, frame: Frame) -> None:
        """`search PLACE`, perhaps with what for."""
        sought = [p.nouns for p in frame.places if p.role == "for" and p.nouns is not None]
        places = tuple(dict.fromkeys(self.route(frame)))
        self.searched(places)
        for nouns in sought:
            self.find_these(nouns, ())

    def patrol(self, frame: Frame, who: Sequence[Subject]) -> None:
        """`ROBOT, patrol PLACE and PLACE`: it goes from one to the next, in that order.

        Raises:
            NotUnderstood: several robots, who could share the places or go to each of them.
        """
        if sought := [p for p in frame.places if p.role == "for"]:
            text = self.said.quote(sought[0].first, sought[0].last)
            raise NotUnderstood(
                f"{text!r} is not understood after "
                f"{self.said.quote(self.said.began, sought[0].first)!r}"
            )
        mentions = [self.resolve(self.drivers(subject)) for subject in who]
        if len(mentions) != 1 or not mentions[0].single:
            raise NotUnderstood(
                f"{self.said.clause!r} does not say which robot goes where: say it of "
                "one robot at a time, or leave the robots out"
            )
        for i, place in enumerate(self.route(frame)):
            if i:
                self.said.draft.next_stage()
            self.said.draft.add(AT, mentions[0], self.place_of(place))
            self.said.last_place = place
        self.said.remember(mentions)

    def route(self, frame: Frame) -> tuple[str, ...]:
        """The places where somebody shall look around, in the order of the words."""
        places = [p for p in frame.places if p.role != "for" and p.special != "there"]
        if len(frame.themes) > 1:
            raise NotUnderstood(f"{self.said.clause!r} does not say where to look around")
        if any(p.role not in ("in", "around", "via", "to", "above", "under") for p in places):
            raise NotUnderstood(f"{self.said.clause!r}: places are searched, and in them")
        if frame.themes and not (
            len(frame.themes[0].items) == 1 and frame.themes[0].items[0].form == "pronoun"
        ):
            named = [name for m in self.place_mentions(frame.themes[0]) for name in m.subjects]
            if places:
                where = self.where([self.locative(p) for p in places])
                inside = where.target or where.source
                named = [n for n in named if self.vocabulary.place_of(n) == inside or n == inside]
                if not named:
                    raise NotUnderstood(f"{self.said.clause!r} names two places")
            return tuple(named)
        if places:
            if len(places) > 1 and all(p.nouns and len(p.nouns.items) == 1 for p in places):
                where = self.where([self.locative(p) for p in places])
                return tuple(filter(None, (where.target or where.source,)))
            return tuple(name for place in places for name in self.places(place))
        if self.said.last_place is None:
            raise NotUnderstood(
                'it does not say where to look around: name a place, or say "everywhere"'
            )
        return (self.said.last_place,)

    def searched(self, places: Sequence[str]) -> None:
        """Wish that somebody looked around in these places, or into these things."""
        places = [self._searchable(place) for place in places]
        key = self.said.began
        self.said.draft.add(SEARCHED, Mention(tuple(places), "place", key), True)
        if len(places) == 1:
            self.said.last_place = places[0]

    def _searchable(self, name: str) -> str:
        """What is looked into: a thing that others can be in; else the place where it is."""
        inside = Feature.CONTAINS in self.vocabulary.good_for.get(name, ())
        return name if inside else self.place_of(name)

    def places(self, place: Place) -> tuple[str, ...]:
        """The places behind a preposition: one, several, or all of them."""
        if place.special == "house":
            return tuple(self.vocabulary.places)
        if place.special == "there" and self.said.last_place is not None:
            return (self.said.last_place,)
        if place.nouns is None:
            raise NotUnderstood(f"{self.said.quote(place.first, place.last)!r} is no place")
        return tuple(
            dict.fromkeys(name for m in self.place_mentions(place.nouns) for name in m.subjects)
        )

    def place_mentions(self, nouns: Nouns) -> list[Mention]:
        """The places that noun phrases name, and places of surfaces."""
        if not self.vocabulary.places:
            raise NotUnderstood("no place is known yet: register one")
        if (
            len(nouns.items) == 1
            and nouns.items[0].form == "general"
            and self.can_be(nouns, ("object",))
        ):  # "everything"
            return [Mention(tuple(self.vocabulary.places), "place", nouns.items[0].first)]
        mentions = []
        for subject in self.subjects(nouns, PLACES, "a place"):
            mention = self.resolve(subject)
            if mention.open or mention.type not in PLACES:
                raise NotUnderstood(f"it does not say which place: {EXAMPLE}")
            surfaces = subject.surfaces
            mentions.append(replace(mention, surfaces=surfaces))
        return mentions

    # --- skills -----------------------------------------------------------------------------------
    def skill(
        self, frame: Frame, frames: Sequence[SkillFrame], who: Sequence[Subject] | None = None
    ) -> None:
        """`vacuum the hallway and the kitchen`, `switch the lamp off`.

        Raises:
            NotUnderstood: it cannot be done to what is named; of several skills of that name, the
                first says why.
        """
        tools = [p for p in frame.places if p.role == "with"]
        if tools and any(f.tool for f in frames) and tools[0].nouns is not None:
            for subject in self.subjects(tools[0].nouns, ("object",), "an object"):
                self.resolve(subject)
            frame = replace(frame, places=tuple(p for p in frame.places if p not in tools))
        themes = frame.themes or tuple(p.nouns for p in frame.places[:1] if p.nouns is not None)
        house = next((p for p in frame.places if p.special == "house"), None)
        places = frame.places if frame.themes else frame.places[1:]
        phrases = [f.phrase for f in frames]
        phrase = phrases[0]
        if phrase.type == "robot":
            return self._done_by(frame, phrase, who)
        if phrase.type == "place":
            if house is not None:
                names = self.places(house)
                mentions = [Mention((name,), "place", self.said.began) for name in names]
                return self.wish(mentions, phrase.wants)
            if len(themes) != 1:
                known = listed(self.lexicon.known(("place",)))
                raise NotUnderstood(
                    f"{self.said.clause!r} ends where a place is missing; known are {known}"
                )
            named = self.place_mentions(themes[0])
            each = dict.fromkeys(name for m in named for name in m.subjects)
            return self.wish([Mention((n,), "place", self.said.began) for n in each], phrase.wants)
        if len(themes) != 1:
            known = listed(self.lexicon.known(("object",)))
            raise NotUnderstood(
                f"{self.said.clause!r} ends where an object is missing; known are {known}"
            )
        things = self.subjects(themes[0], ("object",), "an object")
        where = None
        if places:
            if stray := [p for p in places if p.role not in WHERE or p.role == "to"]:
                text = self.said.quote(stray[0].first, stray[0].last)
                raise NotUnderstood(f"{text!r} is not understood after {frame.verb!r}")
            where = self.where([self.locative(p) for p in places], fetching=True)
        if frame.particle_words:
            raise NotUnderstood(
                f"{sorted(frame.particle_words)[0]!r} is not understood after {frame.verb!r}"
            )
        able = {
            o.object for o in self.vocabulary.objects.values() if any(p.fits(o) for p in phrases)
        }
        source, surface = (where.source, where.source_surface) if where else (None, None)
        mentions = self.those(things, able, phrase.verb, source, surface)
        self.said.remember(mentions)
        for mention in mentions:
            meant = [self.vocabulary.objects[n] for n in mention.subjects]
            fitting = next((p for p in phrases if all(map(p.fits, meant))), phrase)
            self.wish([mention], fitting.wants)
        return None

    def _done_by(self, frame: Frame, phrase: SkillPhrase, who: Sequence[Subject] | None) -> None:
        """`dock`: a robot does it with itself; any that can, where nobody is named."""
        if frame.themes or frame.places or frame.particle_words:
            raise NotUnderstood(f"{self.said.clause!r}: that is done to nothing and nowhere")
        able = [n for n, spec in self.vocabulary.robots.items() if phrase.skill in spec.skills]
        if who is None:
            if not able:
                raise NotUnderstood(f"no robot that can {phrase.verb} is known")
            mentions = [Mention(tuple(sorted(able)), "robot", self.said.began, len(able) > 1)]
        else:
            mentions = [self.resolve(s) for s in who]
        return self.wish(mentions, phrase.wants)

    def those(
        self,
        things: Sequence[Subject],
        able: Collection[str],
        verb: str,
        source: str | None = None,
        surface: str | None = None,
    ) -> list[Mention]:
        """Who is meant, of those that it can be done to.

        Raises:
            NotUnderstood: it cannot be done to what is named.
        """
        found = []
        for thing in things:
            left = thing
            if isinstance(thing, NounPhrase) and thing.quantity.name == "THE" and not thing.exact:
                left = thing.among(able) if thing.among(able).found else thing
            fit = self.fit(left, able, verb)
            found.append(self.resolve(fit, source, surface))
        return found

    def wish(self, mentions: Sequence[Mention], wants: Sequence[tuple[str, Value]]) -> None:
        """Wish that this holds of these."""
        for mention in mentions:
            for relation, value in wants:
                self.said.draft.add(relation, mention, value)

    # --- order ------------------------------------------------------------------------------------
    def tidy(self, frame: Frame) -> None:
        """`tidy up`, `tidy up the kitchen`, `tidy up the coffee table`, `put the cups away`."""
        homes = {
            o.object: o.home
            for o in self.vocabulary.objects.values()
            if o.is_a(Feature.MOVABLE) and o.home and self.is_spot(o.home)
        }
        names = tuple(homes)
        house = any(p.special == "house" for p in frame.places)
        theme = frame.themes[0] if frame.themes else None
        whole = theme is not None and len(theme.items) == 1 and theme.items[0].form == "general"
        if theme is not None and not (whole and not frame.places):
            if whole or (self._about_things(theme) and not self._furniture(theme)):
                return self.move(replace(frame, senses=frame.senses | {"tidy", "move"}))
            names = self._within(self.place_mentions(theme), homes)
            if frame.places:
                raise NotUnderstood(f"{self.said.clause!r} names places twice: name one")
        elif frame.places and not house:
            mentions = []
            for place in frame.places:
                if place.role != "in" or place.nouns is None:
                    raise NotUnderstood(f"{self.said.clause!r}: say what or where to tidy up")
                mentions.extend(self.place_mentions(place.nouns))
            names = self._within(mentions, homes)
        if not names:
            raise NotUnderstood(f"nothing has a home: {HOME_HINT}")
        return self._to_their_homes(names, homes)

    def _about_things(self, theme: Nouns) -> bool:
        return self.can_be(theme, ("object",))

    def _furniture(self, theme: Nouns) -> bool:
        """Whether it is things that stay where they are, and have others on them."""
        if any(noun.form == "pronoun" for noun in theme.items):
            return False
        things = self.vocabulary.objects
        subjects = self.subjects(theme, ("object",), "an object")
        names = [n for s in subjects for n in (s.names if isinstance(s, NounPhrase) else ())]
        return all(
            n in self.vocabulary.good_for and not things[n].is_a(Feature.MOVABLE) for n in names
        )

    def clear(self, frame: Frame) -> None:
        """`clear TABLE`, after the verb: what lies on it goes where it belongs."""
        things = self.vocabulary.objects.values()
        homes = {o.object: o.home for o in things if o.is_a(Feature.MOVABLE) and o.home}
        nouns = frame.themes[0] if frame.themes else None
        nouns = nouns or next((p.nouns for p in frame.places if p.nouns is not None), None)
        mentions = self.place_mentions(nouns) if nouns is not None else []
        if not mentions or any(mention.type != "surface" for mention in mentions):
            places = [name for m in mentions for name in m.subjects] or list(self.vocabulary.places)
            raise NotUnderstood(
                f"{self.said.clause!r}: name the things and where to bring them, or say "
                f'"tidy up {one_of(places)}"'
            )
        self._to_their_homes([n for m in mentions for n in self._lying_on(m, homes)], homes)

    def _to_their_homes(self, names: Sequence[str], homes: Mapping[str, str]) -> None:
        start = self.said.began
        for name in names:
            self.to_spot(Mention((name,), "object", start), homes[name])
        self.said.remember([Mention(tuple(names), "object", start)])

    def _within(self, mentions: Sequence[Mention], homes: Mapping[str, str]) -> tuple[str, ...]:
        """What is to be tidied up in these places."""
        places = dict.fromkeys(n for m in mentions if m.type == "place" for n in m.subjects)
        if len(places) > 1 and set(places) == set(self.vocabulary.places):
            return tuple(homes)
        on_tables = [n for m in mentions if m.type == "surface" for n in self._lying_on(m, homes)]
        in_rooms = self._misplaced(homes, tuple(places)) if places else ()
        return tuple(dict.fromkeys((*in_rooms, *on_tables)))

    def _misplaced(self, homes: Mapping[str, str], where: Sequence[str]) -> tuple[str, ...]:
        """What is believed to be in these places and belongs elsewhere.

        Raises:
            NotUnderstood: there is nothing of that kind in one of them.
        """
        at = self.vocabulary.is_at
        names = tuple(
            n for n, home in homes.items() if any(at(n, p) for p in where) and not at(n, home)
        )
        if tidy := [place for place in where if not any(at(name, place) for name in names)]:
            raise NotUnderstood(
                f"nothing that belongs elsewhere is believed to be in {one_of(tidy)}: have it "
                'searched first, or say where things belong with the field "home" of the object'
            )
        return names

    def _lying_on(self, table: Mention, homes: Mapping[str, str]) -> list[str]:
        """What is believed to lie on a surface, all of which must have its home elsewhere.

        Raises:
            NotUnderstood: there is nothing, or not all of it is known, or some cannot go anywhere.
        """
        surface, vocabulary = one_of(table.surfaces), self.vocabulary
        place = self.place_of(table.subjects[0])
        there = [n for n, where in vocabulary.whereabouts.items() if where == place]
        things = vocabulary.objects
        there = [n for n in there if n in things and things[n].is_a(Feature.MOVABLE)]
        searched = f"have {place} searched first"
        if unsure := [name for name in there if name not in vocabulary.rests]:
            raise NotUnderstood(
                f"it is not known whether {one_of(unsure)} lies on {surface}: {searched}, or name "
                "the things and where to bring them"
            )
        on = table.surfaces
        names = [n for n in there if any(vocabulary.is_at(n, s) for s in on)]
        if not names:
            raise NotUnderstood(f"nothing is believed to lie on {surface}: {searched}")
        if stuck := [n for n in names if homes.get(n, place) in (place, *on)]:
            raise NotUnderstood(
                f"of what lies on {surface}, {' and '.join(stuck)} has no home in another place: "
                "say where to bring it"
            )
        return names

    def check_robots(self, who: Sequence[Subject]) -> None:
        """Whether only robots are told to do something."""
        if any(subject.type != "robot" for subject in who):
            raise NotUnderstood(f"{self.said.clause!r}: only robots do something")

    @staticmethod
    def any_robot(subject: Subject) -> bool:
        """Whether it leaves open which robot."""
        return isinstance(subject, NounPhrase) and subject.generic and subject.count is None

    def check_who(self, who: Sequence[Subject]) -> None:
        """Whether it can be said who does it.

        Raises:
            NotUnderstood: one robot of several is named.
        """
        self.check_robots(who)
        for subject in who:
            names = subject.names if isinstance(subject, NounPhrase) else subject.subjects
            if not self.any_robot(subject) and len(self.vocabulary.robots) > 1:
                raise NotUnderstood(
                    f"{' and '.join(names)} cannot be told to do it: a goal says what must hold, "
                    "and the allocator finds who does it; leave the name out"
                )
