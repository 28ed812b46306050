"""What a worker has observed, and when, over all its attempts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.world import Fact


class SeenFacts:
    """When facts were observed, by `running_s`, which of each variable was observed last, and of
    which something waits to be sent."""

    def __init__(self) -> None:
        self._seen_s: dict[Fact, float] = {}
        self._last: dict[FactKey, Fact] = {}
        self._waiting: dict[int | FactKey, FactKey] = {}
        self._waits: Counter[FactKey] = Counter()

    def __len__(self) -> int:
        return len(self._seen_s)

    def note(self, fact: Fact, seen_s: float) -> None:
        """It was observed then."""
        self._seen_s.pop(fact, None)
        self._seen_s[fact] = seen_s
        last = self._last.get(fact.key)
        if last is None or self._seen_s[last] <= seen_s:
            self._last[fact.key] = fact

    def seen_s(self, fact: Fact | None) -> float | None:
        """When it was observed; None: never, or so long ago that it is forgotten."""
        return None if fact is None else self._seen_s.get(fact)

    def last(self, variable: FactKey) -> Fact | None:
        """What was observed last of a variable."""
        return self._last.get(variable)

    def all_last(self) -> Iterator[Fact]:
        """What was observed last of each variable."""
        return iter(self._last.values())

    def forget_first(self, beyond: int) -> None:
        """Forget what was noted first, if there is more than `beyond`: what was observed once more
        since, and one that was not, which may have to be sent yet."""
        while len(self._seen_s) > beyond:
            first = next(iter(self._seen_s))
            del self._seen_s[first]
            if self._last.get(first.key) == first:
                del self._last[first.key]
                return

    def wait(self, name: int | FactKey, variable: FactKey) -> None:
        """What has this name in the journal waits to be sent, and is about this variable."""
        if name not in self._waiting:
            self._waiting[name] = variable
            self._waits[variable] += 1

    def sent(self, name: int | FactKey) -> None:
        """It waits no more: the store has it, or what was said later."""
        if (variable := self._waiting.pop(name, None)) is not None:
            self._waits[variable] -= 1
            if not self._waits[variable]:
                del self._waits[variable]

    def waits(self, variable: FactKey) -> bool:
        """Whether the store may still come to hear something of a variable that was seen before."""
        return variable in self._waits
