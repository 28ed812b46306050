"""What is too much for robots, said of all of them in one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

UNITS = {"mass": "kg", "height": "m"}
"""Of what is measured of things."""
_OF_THING = {"mass": "{} weighs", "height": "the highest surface in {} is at"}
_OF_ROBOT = {"grip": " lifts", "reach": " reaches"}


class Shortfall(str):
    """`cup_1 weighs 1.5 kg; hsr lifts 1.2 kg, locobot 0.3 kg`: a sentence that knows what it says.

    `about` is the thing, what is measured of it, how much that is, and the capability that is too
    little; `robots` how much of that each has.
    """

    about: tuple[str, str, float, str]
    robots: Mapping[str, float]

    def __new__(
        cls, thing: str, measure: str, amount: float, capability: str, robots: Mapping[str, float]
    ) -> Shortfall:
        unit, (first, *rest) = UNITS[measure], robots.items()
        verb = _OF_ROBOT.get(capability, f"'s {capability} is")
        able = [f"{first[0]}{verb} {first[1]:g} {unit}"]
        able += [f"{robot} {has:g} {unit}" for robot, has in rest]
        needed = f"{_OF_THING[measure].format(thing)} {amount:g} {unit}"
        made = super().__new__(cls, f"{needed}; {', '.join(able)}")
        made.about, made.robots = (thing, measure, amount, capability), dict(robots)
        return made


def told_together(reasons: Iterable[str]) -> list[str]:
    """Each reason once, in order, and what is too much for several robots in one."""
    found: dict[object, str] = {}
    for reason in reasons:
        if isinstance(reason, Shortfall):
            known = found.get(reason.about)
            if isinstance(known, Shortfall):
                reason = Shortfall(*reason.about, {**known.robots, **reason.robots})
            found[reason.about] = reason
        else:
            found[reason] = reason
    return list(found.values())
