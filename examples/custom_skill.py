"""A skill of your own: count the things in a place, kind by kind, and tell everybody.

    python examples/custom_skill.py locobot [tcp/127.0.0.1:7447 [DATA_FOLDER]]

runs the worker of `locobot` with the household skills and this one, in front of a simulation that
runs already (`robotctl sim two-cups`). For the fleet to use it, the robot's file has to name it
(`skills: [navigate, search, count]`), and the planner has to know what it is for
(`robotctl planner --skills my_skills.yaml`):

    skills:
      count:
        about: Count the things in a place.
        parameters: {robot: robot, place: place}
        needs: {robot: [see]}
        before: [at(robot) = place]
        after: [counted(place) = true]
        duration_s: 10

In a package of your own, name it as an entry point in the group `robotfleet.skills` instead: then
every `robotctl worker` on that host has it.
"""

from __future__ import annotations

import sys
from pathlib import Path

from keyexpr_schema import SchemaError
from sim import sim_embodiment
from workers import (
    HOUSEHOLD,
    ParameterKind,
    SkillContext,
    SkillFailed,
    WorkerError,
    run_worker,
    skill,
)

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"


@skill("count", parameters={"place": ParameterKind.PLACE})
async def count(ctx: SkillContext, place: str) -> None:
    """Count the things that lie in a place, kind by kind."""
    kinds = sorted({thing.kind for thing in ctx.world.objects.values()})
    if not kinds:
        # Trying again would not help: the worker reports the failure at once.
        raise SkillFailed("no object is registered, so there is nothing to count", retryable=False)
    await ctx.be_in(place)
    seen = await ctx.look()  # what it sees elsewhere than believed becomes a fact by itself
    for kind in kinds:
        alike = (d for d in seen if d.kind == kind)
        here = [d for d in alike if ctx.world.place_of(ctx.world.whereabouts(d)) == place]
        ctx.log(f"sees {len(here)} of kind {kind} in {place}")
        ctx.observe(f"count_{kind}", place, len(here))
    ctx.observe("counted", place, True)


def main() -> None:
    """Run the worker until it is told to end."""
    words = sys.argv[1:]
    if not 1 <= len(words) <= 3:
        sys.exit(__doc__)
    router = words[1] if len(words) > 1 else DEFAULT_ROUTER
    data_dir = Path(words[2] if len(words) > 2 else "runs/custom-skill")
    try:
        run_worker(
            words[0],
            (router,),
            "robotfleet",
            data_dir,
            sim_embodiment,
            skills=(*HOUSEHOLD, count),
        )
    except (SchemaError, WorkerError) as error:
        sys.exit(f"custom_skill: {error}")


if __name__ == "__main__":
    main()
