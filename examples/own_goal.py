"""Give the fleet a goal from a program of your own, and follow what becomes of it.

    python examples/own_goal.py "Bring the first cup to the hallway." [tcp/127.0.0.1:7447 [plan]]

A goal is one key that you put, its status one key that the planner puts: nothing else is needed to
talk to the fleet. With `plan` as third word the planner is also asked for a plan, which it then
carries out.
"""

from __future__ import annotations

import asyncio
import sys
import uuid

from keyexpr_schema import (
    ENDED_GOALS,
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_REQUEST,
    Goal,
    GoalAddress,
    GoalState,
    PlanRequest,
    RequestAddress,
    SchemaError,
    SessionConfig,
    open_session,
    slug,
)

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"


async def want(text: str, router: str = DEFAULT_ROUTER, plan: bool = False) -> GoalState:
    """Store the goal `text`; return how it ended, or, with no plan, how it was understood.

    Raises:
        SchemaError: no router answers, or the sentence has no words to name the goal after.
    """
    config = SessionConfig(endpoints=(router,), component="own-goal")
    goal = Goal(goal=slug(text), text=text)
    async with open_session(config) as session:
        # `confirm` returns when the store has it: a bare put is lost while a router restarts.
        await session.confirm(GOAL_SPEC, GoalAddress(goal.goal), goal)
        if plan:
            request = PlanRequest(request=f"req-{uuid.uuid4().hex[:12]}", goals=(goal.goal,))
            await session.confirm(PLAN_REQUEST, RequestAddress(request.request), request)
        # A watch first gives what is stored already, so it does not matter who was faster.
        async with session.watch((GOAL_STATUS, {"goal": goal.goal})) as watch:
            async for change in watch:
                status = change.value
                if status is None:
                    continue
                means = " and ".join(str(condition) for condition in status.conditions)
                print(f"{status.state.value}: {status.reason or means}", flush=True)  # noqa: T201
                if status.state in ENDED_GOALS or not plan:
                    return GoalState(status.state)
    raise AssertionError("a watch ends only with its block")


def main() -> None:
    """Read the command line, run, and exit with 1 if the goal was rejected or failed."""
    words = sys.argv[1:]
    if not 1 <= len(words) <= 3:
        sys.exit(__doc__)
    router = words[1] if len(words) > 1 else DEFAULT_ROUTER
    try:
        state = asyncio.run(want(words[0], router, plan=words[2:] == ["plan"]))
    except SchemaError as error:
        sys.exit(f"Error: {error}")
    sys.exit(1 if state in (GoalState.REJECTED, GoalState.FAILED) else 0)


if __name__ == "__main__":
    main()
