"""What one clause wants."""

from __future__ import annotations

from dataclasses import dataclass

from keyexpr_schema.facts import AT, IN, ON, Value
from keyexpr_schema.payloads.goals import Condition

PLACED = frozenset({AT, ON, IN})
"""Relations that say where a thing is: all of one variable."""
THEN = 'if one is to come after the other, say "then"'


@dataclass(frozen=True)
class Wish:
    """What one clause wants. `subjects` is one, or with `open` those of whom any will do.

    `means`: somebody goes somewhere in order to do what the sentence says next.
    `whereto`: it was fetched, and the sentence still has to say where to. `by`: the robots that
    shall do it (`None`: it is about where a robot itself is).
    """

    relation: str
    subjects: tuple[str, ...]
    value: Value
    key: int
    open: bool = False
    on_robot: bool = False
    means: bool = False
    whereto: bool = False
    by: tuple[str, ...] | None = ()
    shared: bool = False
    """Whether what fulfils it may fulfil another one, too: pairs of "two of the three"."""
    for_now: bool = False
    """Whether what is said of it later counts: "get me a glass and put it on the table"."""

    def condition(self) -> Condition:
        """The condition that makes it true."""
        return Condition(
            relation=self.relation,
            subject=self.subjects[0],
            value=self.value,
            any_of=self.subjects if self.open else (),
        )
