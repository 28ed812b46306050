"""The skills that come with RobotFleet."""

from __future__ import annotations

from workers.skill_registry import Skill
from workers.skills.charge import charge
from workers.skills.hand_over import hand_over
from workers.skills.look_into import look_into
from workers.skills.navigate import navigate
from workers.skills.opening import close_thing, open_thing, switch_off, switch_on
from workers.skills.pick import pick
from workers.skills.pick_from_robot import pick_from_robot
from workers.skills.place import place
from workers.skills.place_on_robot import place_on_robot
from workers.skills.put_at import place_in, place_on
from workers.skills.search import search

HOUSEHOLD: tuple[Skill, ...] = (
    navigate,
    search,
    look_into,
    pick,
    pick_from_robot,
    place,
    place_on,
    place_in,
    place_on_robot,
    open_thing,
    close_thing,
    switch_on,
    switch_off,
    hand_over,
    charge,
)
"""Every worker has these."""
