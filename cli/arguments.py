"""What several commands take: names, each with what the shell completes it with, and reasons."""

from __future__ import annotations

from typing import Annotated

import typer

from cli import completion

GoalArgument = Annotated[
    str, typer.Argument(metavar="GOAL", help="Its name.", autocompletion=completion.goals)
]
GoalsArgument = Annotated[
    list[str],
    typer.Argument(metavar="GOAL", help="Their names.", autocompletion=completion.goals),
]
AnyGoalsArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="GOAL", help="Their names.", autocompletion=completion.goals),
]
GoalsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--goal",
        metavar="GOAL",
        help="Take this goal in, too; repeatable.",
        autocompletion=completion.goals,
    ),
]
SchedulesArgument = Annotated[
    list[str],
    typer.Argument(metavar="SCHEDULE", help="Which.", autocompletion=completion.schedules),
]
AnySchedulesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SCHEDULE", help="Which; else all.", autocompletion=completion.schedules
    ),
]
PlanArgument = Annotated[
    str, typer.Argument(metavar="PLAN", help="Its name.", autocompletion=completion.plans)
]
AnyPlanArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="PLAN", help="Its name, where it is one alone.", autocompletion=completion.plans
    ),
]
PlansArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="PLAN", help="Which plans.", autocompletion=completion.plans),
]
TaskArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="TASK", help="Its name; or PLAN/TASK in one.", autocompletion=completion.tasks
    ),
]
RobotArgument = Annotated[
    str, typer.Argument(metavar="ROBOT", help="Its name.", autocompletion=completion.robots)
]
RobotsArgument = Annotated[
    list[str],
    typer.Argument(metavar="ROBOT", help="Which robots.", autocompletion=completion.robots),
]
AnyRobotsArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="ROBOT", help="Which robots.", autocompletion=completion.robots),
]
RobotsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--robot",
        metavar="NAME",
        help="Which; may be repeated.",
        autocompletion=completion.robots,
    ),
]
MissionArgument = Annotated[
    str,
    typer.Argument(
        metavar="MISSION",
        help="A mission's file, or name as two-cups.",
        autocompletion=completion.missions,
    ),
]


def plan_and_task(plan: str, task: str | None) -> tuple[str, str]:
    """What `PLAN TASK` names, or `PLAN/TASK`, as `status` and `why` write it.

    Raises:
        BadParameter: no task is named.
    """
    if task is None:
        plan, _, task = plan.partition("/")
    if not task:
        raise typer.BadParameter(f"say which task, such as {plan} t1")
    return plan, task


def one_line(reason: str) -> str:
    """A reason as it stands within a sentence: on one line, so that it passes for no other."""
    return " ".join(reason.split())


WhyOption = Annotated[
    str,
    typer.Option("--why", metavar="TEXT", help="For those who read it.", callback=one_line),
]
