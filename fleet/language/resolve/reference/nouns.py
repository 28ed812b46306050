"""What noun phrases can mean, in this world and in this text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.reference.lists import at_each, check_list, shared_kind
from fleet.language.resolve.reference.mentions import (
    NounPhrase,
    Subject,
    determined_as,
    with_article,
)
from fleet.language.resolve.reference.owners import Owners
from fleet.language.resolve.reference.parts import Parts
from fleet.language.resolve.reference.pronouns import PERSONAL, Pronouns, either
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.reference.salience import Salience
from fleet.language.resolve.reference.unknown_nouns import unknown_noun
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.lexicon import CATEGORIES, ENTITY_TYPES, Entity, EntityType
from fleet.language.tree.nodes import (
    Noun,
    Nouns,
    Quantity,
)
from fleet.language.words.folding import folded
from fleet.language.words.tokens import tokens_like

_ALL_OF_IT = (Quantity.THE, Quantity.ALL, Quantity.BARE)
_SINGULAR = ("ss", "us", "is")


class NounResolver:
    """Finds out whom noun phrases mean."""

    def __init__(self, scene: Scene, who: Referents) -> None:
        self.scene = scene
        self.who = who
        self.parts = Parts(scene)
        self.shared: tuple[Entity, ...] = ()
        """The kind of what follows in the list that is read."""
        self.shared_plural = False
        self.pronouns = Pronouns(scene)
        self.salience = Salience(scene)
        self.owners = Owners(scene, who, self)
        self.located: Callable[[Noun, NounPhrase], NounPhrase] = lambda noun, made: made

    def subjects(
        self,
        nouns: Nouns,
        types: Sequence[EntityType],
        what: str,
        within: tuple[Entity, ...] = (),
    ) -> list[Subject]:
        """All that a list of noun phrases means; `within`: of those, if their words fit any.

        Raises:
            NotUnderstood: one of them is nothing known of these types.
        """
        nouns = at_each(nouns)
        if len(nouns.items) == 1 and nouns.items[0].words[:1] in (("them",), ("they",)):
            recent = [m for m in self.scene.said.recent if m.type in types]
            if len(recent) > 1:
                return list(recent)
        found = []
        for i, noun in enumerate(nouns.items):
            kind = shared_kind(self.scene.lexicon, nouns.items[i:], types, self.kind)
            (self.shared_plural, self.shared) = kind if kind[1] else (False, within)
            found.append(self.subject(noun, types, what))
        self.shared, self.shared_plural = (), False
        check_list(nouns, found, self.scene.said)
        if nouns.either:
            one_of_them = found[0]
            for other in found[1:]:
                one_of_them = either(one_of_them, with_article(other, found[0]))
            return [one_of_them]
        lead = found[0]
        for i in range(1, len(found)):
            one = found[i] = determined_as(with_article(found[i], found[i - 1]), lead)
            if not isinstance(one, NounPhrase) or one.plural or one.quantity is not Quantity.BARE:
                lead = one
        return found

    def subject(self, noun: Noun, types: Sequence[EntityType], what: str) -> Subject:
        """Whom one noun phrase or pronoun means."""
        if noun.form in ("pronoun", "me") and (noun.places or noun.relatives or noun.but):
            text = self.scene.said.quote(noun.first, noun.last)
            raise NotUnderstood(f"{text!r} does not say who that is: name it, and then say where")
        if noun.form == "pronoun":
            return self.pronouns.pronoun(noun, types)
        if noun.form == "me":
            return self.pronouns.speaker(noun, "object")
        return self.noun(noun, types, what)

    def can_be(self, nouns: Nouns, types: Sequence[EntityType]) -> bool:
        """Whether all of them can be of one of these types, by their words."""
        for noun in at_each(nouns).items:
            if noun.form == "pronoun":
                if noun.words[0] in PERSONAL and self.scene.said.person is not None:
                    if "object" not in types:
                        return False
                elif (
                    "object" not in types
                    and "place" in types
                    and (self.scene.said.last_place or self.scene.said.rooms)
                ):
                    continue
                elif not any(m.type in types for m in self.scene.said.recent):
                    return False
            elif noun.form == "me":
                if self.scene.vocabulary.speaker is None or "object" not in types:
                    return False
            else:
                try:
                    self.noun(noun, types, "")
                except NotUnderstood:
                    return False
        return True

    def noun(self, noun: Noun, types: Sequence[EntityType], what: str) -> NounPhrase:
        """What a noun phrase can mean; its own words may say where it is.

        Raises:
            NotUnderstood: nothing known of these types; the message lists what is.
        """
        made = self.located(noun, self._described_by_words(noun, types, what))
        chosen = self.scene.said.chosen.get(noun.first)
        if chosen is not None and set(chosen) <= set(made.names):
            several = Quantity.ALL if len(chosen) > 1 else made.quantity
            return replace(made.among(chosen), quantity=several, exact=True, source=None)
        return self.salience.meant(made)

    def _described_by_words(self, noun: Noun, types: Sequence[EntityType], what: str) -> NounPhrase:
        text = self.scene.said.quote(noun.first, noun.last)
        if noun.floor:  # it can be cleaned; what lies on it is in the place, and nowhere in it
            if "place" not in types or {"robot", "object"} & set(types):
                raise self.unknown(noun, types, what)
            types = ("place",)
        made = NounPhrase((), text, noun.first, noun.quantity, count=noun.count)
        made = self._headed(noun, made, types, what)
        made = self.owners.owned(noun, made)
        if noun.use is not None:
            made = self._useful(made, noun.use)
        for adjective in noun.adjectives:
            able = self.scene.stated.able(adjective) & set(made.names)
            if "SINGLE" in adjective.tags and (made.generic or not able):
                continue  # "the whole kitchen", "the whole thing"
            made = self.scene.stated.narrowed(made, adjective, self.scene.said)
        if noun.determiner == "any" and (noun.adjectives or noun.relatives):
            made = replace(made, quantity=Quantity.ALL)  # "any plant that is dry"
        for relative in noun.relatives:
            if relative.state is not None:
                made = self.scene.stated.narrowed(
                    made, relative.state, self.scene.said, relative.negated
                )
        if noun.but is not None and noun.ordinals:
            raise NotUnderstood(f"{made.text!r} leaves something out of one thing")
        if noun.but is not None:
            made = self._without(made, noun.but, types, what)
        if noun.unlike is not None:
            known = types if self.can_be(noun.unlike, types) else ENTITY_TYPES
            gone = set(self.who.all_of(self.subjects(noun.unlike, known, what)))
            made = made.among(set(made.names) - gone) if not gone >= set(made.names) else made
        made = replace(made, plural=made.plural and not noun.part)
        if len(noun.ordinals) > 1:
            return self._numbered_each(made, noun.ordinals)
        if noun.ordinals:
            made = replace(made, ordinal=noun.ordinals[0])
        return self._others(made, noun.other) if noun.other else made

    def _headed(
        self, noun: Noun, made: NounPhrase, types: Sequence[EntityType], what: str
    ) -> NounPhrase:
        if noun.form == "whatever":
            found = tuple(e for e in self.scene.lexicon.entities if e.type == "object")
            if "object" not in types or not found:
                raise self.unknown(noun, types, what)
            return replace(made, found=found, generic=True)
        if noun.form == "general":
            return self._general(noun, made, types, what)
        if noun.form == "headless" or (noun.form == "one" and len(noun.head) == 1):
            kin = tuple(e for e in self.shared or self.kind if e.type in types)
            if not kin:
                raise self.unknown(noun, types, what)
            plural = noun.form == "one" and noun.head[0].spoken == "ones"
            return replace(made, found=kin, plural=plural)
        if noun.form != "noun" and noun.form != "one":
            raise self.unknown(noun, types, what)
        head = noun.head[0].words
        two = len(noun.head) > 1 and noun.form == "noun"
        if two or any("UNK" in word.tags for word in noun.head):
            raise self.unknown(noun, types, what)
        named = self._named(head, noun.head[0].text, types)
        if named and not noun.numbers:
            self._remember_kind(named[0])
            self.owners.remember(named, head)
            return replace(made, found=named, exact=True)
        return self._described(noun, made, types, what)

    def _named(
        self, words: tuple[str, ...], text: str, types: Sequence[EntityType]
    ) -> tuple[Entity, ...]:
        """Those whose whole name it is; a kind that has several members is none."""
        end, found = self.scene.lexicon.exact(tokens_like(words), 0, types)
        if end != len(words):
            return ()
        raw = folded(text)
        if len(found) > 1:
            found = tuple(e for e in found if folded(e.id) == raw) or found
        if found and self.scene.lexicon.is_several(words, types):
            found = tuple(e for e in found if folded(e.id) == raw)
        return found

    def _described(
        self, noun: Noun, made: NounPhrase, types: Sequence[EntityType], what: str
    ) -> NounPhrase:
        words = noun.head[0].words
        collective = self.scene.tagger.book.collective
        tokens = tokens_like(words)
        end, found = self.scene.lexicon.described(tokens, 0, types)
        # "The kitchen" is the place of that name, and no table that is called by it, too.
        named_end, named = self.scene.lexicon.exact(tokens, 0, ENTITY_TYPES)
        other = named and named_end == len(words) and all(e.type == "place" for e in named)
        other = other and self.scene.lexicon.kind(tokens, 0, len(words), types) is None
        if end != len(words) or not found or (other and "place" not in types):
            raise self.unknown(noun, types, what)
        plural, generic, mass = False, False, False
        kind = self.scene.lexicon.kind(tokens, 0, end, types)
        if kind is not None and (of_kind := tuple(e for e in found if e in kind[1])):
            plural, found = kind[0], of_kind
            plural = plural or (words[-1].endswith("s") and not words[-1].endswith(_SINGULAR))
            mass = not plural and words[-1] in collective and noun.quantity in _ALL_OF_IT
            plural = plural or mass
            category = any(words[0] in (c, f"{c}s") for cs in CATEGORIES.values() for c in cs)
            generic = len(words) == 1 and len(found) == len(kind[1]) and category
        if kind is None and not named:  # "the red and the green mug"
            found = tuple(e for e in found if e in self.shared) or found
            plural = self.shared_plural and set(found) <= set(self.shared)
        if noun.of:
            found = self._of_what(noun, found, types, what)
        said_plainly = noun.quantity is Quantity.THE and not plural
        if noun.ordinals or noun.numbers or said_plainly:  # the first cup is no mug
            closest = tuple(e for e in found if self.scene.lexicon.is_kin(words, e))
            found = closest or found
        if noun.form == "noun":
            headed = self._headed_by(words, found)
            if not headed:
                raise self.unknown(noun, types, what, found)
            found = headed
        if noun.form == "one":  # "the red one", of the kind that was spoken of
            kin = self.shared or self.kind
            found = tuple(e for e in found if e in kin) or found
        self._remember_kind(found[0], found)
        if noun.form == "one":
            return replace(made, found=found, plural=noun.head[-1].spoken == "ones")
        if not noun.numbers:
            return replace(made, found=found, plural=plural, generic=generic, mass=mass)
        chosen = tuple(e for number in noun.numbers for e in _numbered(found, number, made.text))
        quantity = Quantity.ALL if len(noun.numbers) > 1 else noun.quantity
        return replace(made, found=chosen, quantity=quantity, exact=True)

    def _headed_by(self, words: tuple[str, ...], found: tuple[Entity, ...]) -> tuple[Entity, ...]:
        """Those of whom the words say what they are; "the small", of the kind spoken of."""
        if words[-1] in self.scene.tagger.book.describing:
            return found
        headed = tuple(e for e in found if e.is_headed(words))
        return headed or tuple(e for e in found if e in self.kind)

    def _of_what(
        self, noun: Noun, found: tuple[Entity, ...], types: Sequence[EntityType], what: str
    ) -> tuple[Entity, ...]:
        words = tuple(word for lexeme in noun.of if "NOUN" in lexeme.tags for word in lexeme.words)
        if any("UNK" in lexeme.tags for lexeme in noun.of):
            raise self.unknown(noun, types, what)
        named = self.scene.lexicon.meant(words)
        narrower = tuple(e for e in found if e in named)
        if not narrower:
            inside = {name for whole in named for name in self.parts.belonging(whole.stands_for)}
            narrower = tuple(e for e in found if e.stands_for in inside)
        if not narrower:
            raise self.unknown(noun, types, what)
        return narrower

    def _general(
        self, noun: Noun, made: NounPhrase, types: Sequence[EntityType], what: str
    ) -> NounPhrase:
        tags = noun.head[0].tags
        entity_type: EntityType = "robot" if "EVERYONE" in tags else "object"
        quantity = Quantity.ANY if "SOMETHING" in tags else Quantity.ALL
        found = tuple(e for e in self.scene.lexicon.entities if e.type == entity_type)
        if entity_type not in types or not found:
            raise self.unknown(noun, types, what)
        made = replace(made, found=found, quantity=quantity, generic=entity_type == "object")
        narrowed = noun.relatives or noun.places or noun.but or noun.use
        if "EVERYTHING" not in tags or narrowed or noun.first in self.scene.said.chosen:
            return made
        listed_ = self.salience.listed()
        return replace(made.among(listed_), generic=False, exact=True) if listed_ else made

    def _useful(self, made: NounPhrase, verb: str) -> NounPhrase:
        known = {use for e in self.scene.lexicon.entities if e.type == "object" for use in e.uses}
        found = tuple(e for e in made.found if verb in e.uses)
        if not found:
            raise NotUnderstood(
                f"{made.text!r}: nothing of that kind is known to be good for that; say so with "
                f'the field "uses" of its kind; known uses are {listed(sorted(known))}'
            )
        return replace(made, found=found, generic=False)

    def _without(
        self, made: NounPhrase, but: Nouns, types: Sequence[EntityType], what: str
    ) -> NounPhrase:
        gone = set(self.who.all_of(self.subjects(but, types, what, made.found)))
        names = set(made.names)
        if stray := sorted(gone - names):
            raise NotUnderstood(f"{made.text!r}: {one_of(stray)} is none of {one_of(made.names)}")
        left = made.among(names - gone)
        several = made.quantity is Quantity.ALL or (made.quantity is Quantity.THE and made.plural)
        if made.quantity is Quantity.ANY and not made.plural and left.found:
            return left
        if not left.found or not several or made.count is not None:
            raise NotUnderstood(f"{made.text!r} leaves nothing, or does not say all of what")
        return replace(left, quantity=Quantity.ALL)

    def _numbered_each(self, made: NounPhrase, ordinals: Sequence[int]) -> NounPhrase:
        names = [
            name
            for ordinal in ordinals
            for name in replace(made, ordinal=ordinal, count=None, plural=False).resolve().subjects
        ]
        by_name = {e.stands_for: e for e in made.found}
        return replace(
            made,
            found=tuple(by_name[name] for name in names),
            ordinal=None,
            quantity=Quantity.ALL,
            exact=True,
            plural=True,
        )

    def _others(self, made: NounPhrase, other: str) -> NounPhrase:
        """Those of the kind that were not spoken of yet.

        After "a cup", which may be any, "the other one" is any too if there are two, and "another
        cup" always: that they differ follows from where they are wanted.
        """
        known = set(made.names)
        gone = [m for m in self.scene.said.mentioned if known & set(m.subjects)]
        opened = {m.key for m in gone if m.open}
        left = made.among(known - {s for m in gone if not m.open for s in m.subjects})
        spare = len(left.names) - sum({m.key: m.least for m in gone if m.open}.values())
        if opened and made.count is not None and made.count == spare:  # "the other two"
            return replace(left, quantity=Quantity.ANY)
        many = spare > 1 or made.plural
        if not gone or spare < 1 or (opened and other != "another" and many):
            raise NotUnderstood(f"{made.text!r} could be {one_of(made.names)}: call it by its name")
        return replace(left, quantity=Quantity.ANY) if opened else left

    @property
    def kind(self) -> tuple[Entity, ...]:
        """Whom "one" may mean in "the second one"."""
        said = self.scene.said
        if said.kind_of is None:
            return ()
        kin = self.scene.lexicon.kin(said.kind_of)  # "the dirty ones", after "the clean dishes"
        return (*kin, *(entity for entity in said.of_kind if entity not in kin))

    def _remember_kind(self, entity: Entity, found: tuple[Entity, ...] = ()) -> None:
        if entity.type in ("object", "robot") and not entity.person:
            self.scene.said.kind_of, self.scene.said.of_kind = entity, found

    def unknown(
        self, noun: Noun, types: Sequence[EntityType], what: str, near: Sequence[Entity] = ()
    ) -> NotUnderstood:
        """The phrase names nothing known of these types; `near` are called something like it."""
        return unknown_noun(self.scene, noun, types, what, near)


def _numbered(found: tuple[Entity, ...], number: int, text: str) -> tuple[Entity, ...]:
    """Those that are called by a number; where none is, the one in that place of those whose names
    have no number: "cup 1" is not the first of cups 0 and 2."""
    chosen = tuple(e for e in found if any(str(number) in name for name in e.names)) or tuple(
        e
        for e in found
        if e.ordinal == number and not any(word.isdecimal() for name in e.names for word in name)
    )
    if not chosen:
        known = listed(dict.fromkeys(e.stands_for for e in found))
        raise NotUnderstood(f"{text!r}: there is no number {number}; known are {known}")
    return chosen
