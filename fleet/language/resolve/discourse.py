"""What a text has said so far: whom pronouns mean, where "there" is, what is wanted and so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fleet.errors import NotUnderstood
from fleet.language.resolve.reference.mentions import Mention, Subject
from fleet.language.resolve.stages import GoalDraft
from fleet.language.tagging.lexicon import Entity
from fleet.language.words.times import TimePhrase
from fleet.language.words.tokens import Token
from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition


@dataclass(frozen=True)
class Ahead:
    """What is wanted before all else, under fewer conditions than that."""

    draft: GoalDraft
    when: tuple[Condition, ...]
    only_if: tuple[Condition, ...]


@dataclass
class Discourse:
    """The state in which a clause is resolved; every reading of a text has one of its own."""

    text: str
    tokens: Sequence[Token]
    draft: GoalDraft
    is_person: Callable[[str], bool] = lambda name: False
    recent: list[Mention] = field(default_factory=list)
    """Whom "it" and "them" may mean."""
    mentioned: list[Mention] = field(default_factory=list)
    """Whom "the other cup" does not mean."""
    named: list[tuple[str, ...]] = field(default_factory=list)
    """Whom and what was named, the last one last: "the bowl" is the one that was named."""
    kind_of: Entity | None = None
    """Of whose kind "the second one" is."""
    of_kind: tuple[Entity, ...] = ()
    """Whom the words could mean that named it last, without what told them apart."""
    moved: list[Subject] = field(default_factory=list)
    last_place: str | None = None
    rooms: tuple[str, ...] = ()
    """Places to which something was done last: "vacuum and mop the kitchen and the hall"."""
    elliptic: str = ""
    """`move`: "and the book to the kitchen" may follow; `be`: "and the book in the hallway"."""
    verb: str = ""
    addressees: list[Subject] = field(default_factory=list)
    chosen: dict[int, tuple[str, ...]] = field(default_factory=dict)
    """Whom a noun phrase means of several, by the token at which it begins, while that is asked."""
    extra: list[tuple[Mention, tuple[tuple[str, Value], ...]]] = field(default_factory=list)
    """States that are wanted as well: "bring me a cooked egg"."""
    person: str | None = None
    """Whom "him" and "her" mean."""
    carrier: str | None = None
    """What something was put in or on last: "put the cup inside"."""
    methods: list[Any] = field(default_factory=list)
    """How tasks are done that were called by name."""
    goals: list[Any] = field(default_factory=list)
    """Goals that ended with their sentence, for which a time or condition was said."""
    same: Any = None
    """The last clause that "the fork, too" can go on from."""
    front: Any = ()
    """Phrases before the first clause of the sentence: "in the kitchen, close … and open …"."""
    again: Any = None
    """The verb and arguments of the last clause: "and then the second one"."""
    clauses: int = 0
    """How many clauses of the sentence there were that ask for or say something."""
    remarks: list[str] = field(default_factory=list)
    """Clauses that ask for nothing."""
    left_out: list[str] = field(default_factory=list)
    """What is not wanted, though the words could be taken so, in sentences."""
    offer: Any = None
    """The last clause that named who shall have what: "bring Anna a cup and Ben a mug"."""
    began: int = 0
    ended: int = 0
    facts: dict[FactKey, Value] = field(default_factory=dict)
    told: list[tuple[FactKey, Value]] = field(default_factory=list)
    """All that was told, one after the other, also what was told before."""
    presumed: list[Literal] = field(default_factory=list)
    always: list[Condition] = field(default_factory=list)
    never: list[Condition] = field(default_factory=list)
    when: list[Condition] = field(default_factory=list)
    only_if: list[Condition] = field(default_factory=list)
    whenever: list[Condition] = field(default_factory=list)
    ahead: Ahead | None = None
    """What is looked for, whether or not it is found: "search … for it, and bring it if …"."""
    keeps: str = ""
    """The kind of the last clause, if that says what shall always or never be so."""
    begun: int = 0
    """How much was wished for before the last clause."""
    begun_then: bool = False
    """Whether that is for after what was wished for before."""
    either: list[tuple[Condition, ...]] = field(default_factory=list)
    """Conditions of which, beside `only_if`, one is enough."""
    severally: bool = False
    """Whether a condition is said of several things, one by one: "if the windows are open"."""
    once_more: bool = False
    """Whether the sentence is the one before, under another condition of which one is enough."""
    asked: tuple[tuple[Condition, ...], ...] = ()
    """The conditions of the last goals, of which one was enough: "otherwise" is if none holds."""
    otherwise: bool = False
    """Whether what is said is for when the condition of the last goal does not hold."""
    as_long_as: bool = False
    """Whether a condition says how long, too."""
    times: list[TimePhrase] = field(default_factory=list)
    urgent: int = 0
    time_words: str = ""
    telegraphic: bool = False
    """Whether the sentence has no articles."""
    done: bool = False
    """Whether the sentence asks that something be done, rather than be so."""

    def copy(self) -> Discourse:
        """The same, for another reading to go on from."""
        return replace(
            self,
            draft=self.draft.copy(),
            recent=list(self.recent),
            mentioned=list(self.mentioned),
            named=list(self.named),
            moved=list(self.moved),
            addressees=list(self.addressees),
            facts=dict(self.facts),
            told=list(self.told),
            presumed=list(self.presumed),
            always=list(self.always),
            never=list(self.never),
            when=list(self.when),
            only_if=list(self.only_if),
            whenever=list(self.whenever),
            either=list(self.either),
            times=list(self.times),
            chosen=dict(self.chosen),
            extra=list(self.extra),
            goals=list(self.goals),
            remarks=list(self.remarks),
            left_out=list(self.left_out),
            methods=list(self.methods),
        )

    def begin_sentence(self, telegraphic: bool, urgent: int) -> None:
        """What holds of one sentence only begins anew.

        Raises:
            NotUnderstood: it is urgent where another one has time, or the other way round.
        """
        self.elliptic, self.addressees, self.done, self.again = "", [], False, None
        self.telegraphic, self.clauses, self.offer = telegraphic, 0, None
        self.front, self.keeps = (), ""
        if self.urgent * urgent < 0:
            raise NotUnderstood(
                f"{self.line!r} is urgent, and has time as well: say it in two goals"
            )
        self.urgent = self.urgent or urgent

    def check_going_on(self) -> None:
        """Whether a sentence that begins with "then" can go on with the goal before it.

        Raises:
            NotUnderstood: that is wanted under a condition, and it is not said if the rest is, too.
        """
        if self.only_if or self.either:
            raise NotUnderstood(
                f"{self.line!r}: it is not said whether what comes then depends on the condition, "
                'too; say "and then" in the same sentence if it does, or give it as another goal'
            )

    def conditions_of(self, role: str) -> list[Condition]:
        """Those that a clause after "when" or "whenever", or after "if" or "unless", adds to."""
        return {"when": self.when, "whenever": self.whenever}.get(role, self.only_if)

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """All conditions under which what is being said is wanted."""
        either = (row for rows in self.either for row in rows)
        return (*self.when, *self.only_if, *self.whenever, *either)

    def quote(self, first: int, last: int) -> str:
        """The text of some tokens, as it was written."""
        chosen = self.tokens[first:last]
        return " ".join(self.text[chosen[0].start : chosen[-1].end].split()) if chosen else ""

    def spoken_of(self, names: Sequence[str]) -> None:
        """If it is one person, they are whom "him" means from now on."""
        if len(names) == 1 and self.is_person(names[0]):
            self.person = names[0]

    @property
    def clause(self) -> str:
        """The clause that is being read, as it was written."""
        return self.quote(self.began, self.ended)

    @property
    def line(self) -> str:
        """The whole text on one line."""
        return " ".join(self.text.split())

    def remember(self, mentions: Sequence[Mention]) -> None:
        """These are whom a pronoun means from now on."""
        mentions = [
            m if m.whole is None else replace(m, subjects=(m.whole,), whole=None) for m in mentions
        ]
        self.mentioned.extend(mentions)
        for mention in mentions:
            self.spoken_of(mention.subjects)
            if not mention.open:
                self.named.append(mention.subjects)
        if len(mentions) > 1 and not any(m.open for m in mentions):
            names = tuple(dict.fromkeys(s for m in mentions for s in m.subjects))
            self.recent = [Mention(names, mentions[0].type, mentions[0].key)]
        else:
            self.recent = list(mentions)
