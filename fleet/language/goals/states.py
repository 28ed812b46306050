"""What skills make of things, asked for or told by the names of skills: "close the fridge", "switch
the lamp off", "the fridge should be closed", "the lamp is on"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.goals.moving import Moving
from fleet.language.phrases.locations import PLACES
from fleet.language.phrases.mentions import Mention
from fleet.language.phrases.subjects import Subject
from fleet.language.vocabulary import SkillPhrase
from fleet.language.words.morphology import participles
from fleet.language.words.tokens import Phrase, words_of
from fleet.language.words.verb_senses import EXAMPLE, IMPERATIVES
from fleet.language.words.wordlists import WHOLE_HOUSE

_SAME_VERBS = (("turn on", "switch on"), ("turn off", "switch off"), ("shut", "close"))
_ADJECTIVES = (("open", "open"), ("on", "switch on"), ("off", "switch off"))
"""Words for what holds when a skill of that name has been done, beside its participle."""


class States(Moving):
    """Turns clauses about states into wishes, and finds the words for states."""

    def skill_phrase(self) -> SkillPhrase | None:
        """The skill whose name comes next, unless a verb of ours is as long; past it."""
        names = self._verbs()
        verb = self.cursor.longest(names)
        if verb is None or len(self.cursor.longest(IMPERATIVES) or ()) >= len(verb):
            return None
        self.cursor.at += len(verb)
        return names[verb]

    def done_to(self, phrase: SkillPhrase) -> None:
        """`vacuum the hallway and the kitchen`, after the verb."""
        if phrase.type == "place":
            mentions = [Mention((name,), "place", self.cursor.at) for name in self.places()]
            return self._wish(mentions, phrase)
        return self._wish(self._those(self.subjects.read("an object", ("object",)), phrase), phrase)

    def parted_verb(self) -> bool:
        """`switch the lamp off`: whether it comes next; past it, and wished for."""
        cursor, start = self.cursor, self.cursor.at
        verbs = {verb: phrase for verb, phrase in self._verbs().items() if len(verb) == 2}
        head = cursor.word()
        if not any(verb[0] == head and phrase.type != "place" for verb, phrase in verbs.items()):
            return False
        cursor.at += 1
        if self.nouns.starts(("object",)) or cursor.word() in ("it", "them"):
            things = self.subjects.read("an object", ("object",))
            phrase = verbs.get((head, cursor.word()))
            if phrase is not None:
                cursor.at += 1
                self._wish(self._those(things, phrase), phrase)
                return True
        cursor.at = start
        return False

    def state(self) -> SkillPhrase | None:
        """The skill that makes so what comes next, "closed" or "on", of things; past it."""
        cursor = self.cursor
        states: dict[Phrase, SkillPhrase] = {}
        by_name = {phrase.verb: phrase for phrase in self.vocabulary.skill_phrases}
        for verb, phrase in self._verbs().items():
            for participle in participles(verb[0]):
                states[participle, *verb[1:]] = phrase
        states |= {(word,): by_name[verb] for word, verb in _ADJECTIVES if verb in by_name}
        words = cursor.longest({s: p for s, p in states.items() if p.type != "place"})
        if words is None:
            return None
        cursor.at += len(words)
        if words[-1] in ("on", "off") and not (cursor.at_border() or cursor.word() == "and"):
            cursor.at -= len(words)  # "on the table"
            return None
        return states[words]

    def made_so(self, things: Sequence[Subject], phrase: SkillPhrase) -> None:
        """Wish that these are as the skill makes them."""
        self._wish(self._those(things, phrase), phrase)

    def _verbs(self) -> dict[Phrase, SkillPhrase]:
        phrases = {phrase.verb: phrase for phrase in self.vocabulary.skill_phrases}
        phrases |= {
            same: phrases[verb]
            for same, verb in _SAME_VERBS
            if verb in phrases and same not in phrases
        }
        return {words_of(verb): phrase for verb, phrase in phrases.items()}

    def _those(self, things: Sequence[Subject], phrase: SkillPhrase) -> list[Mention]:
        """Who is meant, of those that it can be done to.

        Raises:
            NotUnderstood: it cannot be done to what is named.
        """
        able = {o.object for o in self.vocabulary.objects.values() if phrase.fits(o)}
        return [
            self.subjects.resolve(self.subjects.fit(thing, able, phrase.verb)) for thing in things
        ]

    def _wish(self, mentions: Sequence[Mention], phrase: SkillPhrase) -> None:
        if phrase.type != "place":
            self.subjects.remember(mentions)
        for mention in mentions:
            for relation, value in phrase.wants:
                self.draft.add(relation, mention, value)

    def places(self) -> tuple[str, ...]:
        """The places that come next: one, several, or all of them."""
        named = self.place_mentions()
        if named is None:
            return tuple(self.vocabulary.places)
        return tuple(dict.fromkeys(name for m in named for name in m.subjects))

    def place_mentions(self) -> list[Mention] | None:
        """The places that come next, and places of surfaces; `None` for the whole house."""
        cursor = self.cursor
        named = cursor.lexicon.exact(cursor.tokens, cursor.at, PLACES)[1]
        if not named and self.vocabulary.places and cursor.take_of(WHOLE_HOUSE):
            return None
        mentions = []
        for subject in self.subjects.read("a place", PLACES):
            mention = self.subjects.resolve(subject)
            if mention.open or mention.type not in PLACES:
                raise NotUnderstood(f"it does not say which place: {EXAMPLE}")
            mentions.append(replace(mention, surfaces=subject.surfaces))
        return mentions
