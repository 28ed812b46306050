"""What the core keeps up as events come in, against the same derived anew from the whole state."""

from __future__ import annotations

from collections import Counter
from typing import Any

from msgspec.structs import asdict, replace

from fleet.core.dispatch.dispatcher import advance
from fleet.core.effects import Effect, all_touches, effects_between
from fleet.core.indexes.touches import UNTOUCHED, Part, Touch
from fleet.core.state import State


def check_derived(before: State, after: State, effects: tuple[Effect, ...]) -> None:
    """The laws of one event that was handled.

    Raises:
        AssertionError: an index is not what it is when derived anew, the effects are not the
            difference of the views, or dispatch would go further if it looked at everything.
    """
    anew = after.reindexed()
    assert _parts(after.index) == _parts(anew.index)
    for plan, entry in after.plans.items():
        assert _parts(entry.index) == _parts(anew.plans[plan].index), plan
    touches = (*all_touches(before, after), Touch(Part.EPOCH))
    whole = effects_between(before, after, touches)
    made, wanted = _counted(effects), _counted(whole)
    assert made == wanted, f"too many: {made - wanted}, missing: {wanted - made}"
    assert advance(_all_touched(after)).bare() == _all_touched(after).bare()


def _all_touched(state: State) -> State:
    touches = UNTOUCHED
    for touch in (*all_touches(State(), state), Touch(Part.TEAM)):
        touches = touches.and_(touch)
    return replace(state, touches=touches)


def _parts(index: Any) -> dict[str, Any]:
    parts = asdict(index)
    parts.pop("graph", None)
    # Only bounds: they may be lower than the time of what could still be late, or due.
    parts.pop("late_s", None)
    parts.pop("wakes_s", None)
    return {name: _plain(value) for name, value in parts.items()}


def _plain(value: Any) -> Any:
    return dict(value) if hasattr(value, "items") else value


def _counted(effects: tuple[Effect, ...]) -> Counter[str]:
    return Counter(map(repr, effects))
