"""The summary of a demo, for a person."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text

from cli.demo.summary import Summary
from cli.demo.verdict import Verdict
from cli.views.console import table
from cli.views.text import seconds, skill_call
from keyexpr_schema.payloads.goals import GoalState

MARKS = {Verdict.HOLDS: "✓", Verdict.FAILS: "✗", Verdict.NOT_JUDGED: "?"}


def summary_page(summary: Summary) -> Group:
    """Verdicts, tasks, times."""
    width = max((len(verdict.goal) for verdict in summary.goals), default=0)
    goals = [
        Text.assemble(
            (f"{MARKS[verdict.physics]} ", "green" if verdict.agreed else "red"),
            (verdict.goal.ljust(width), "bold"),
            f"  physics: {verdict.physics.value}; planner: {verdict.planner.value}; ",
            verdict.sentence,
        )
        for verdict in summary.goals
    ]
    tasks = table(
        ["task", "call", "robot", "attempt", "tries", "start", "end", "duration", "state"],
        (
            (
                f"{line.plan}/{line.task}",
                skill_call(line.skill, line.args, leave_out=line.robot),
                line.robot,
                line.attempt,
                line.tries,
                seconds(line.start_s),
                seconds(line.end_s),
                seconds(line.duration_s),
                line.state.value,
            )
            for line in summary.tasks
        ),
    )
    robots = table(
        ["robot", "busy", "idle"],
        (
            (robot, seconds(busy), seconds(summary.idle_s[robot]))
            for robot, busy in summary.busy_s.items()
        ),
    )
    contacts = "not counted"
    if summary.contacts is not None:
        with_robots, with_walls = summary.contacts.robot_robot, summary.contacts.robot_wall
        contacts = f"{with_robots} robot with robot, {with_walls} with walls"
    factor = summary.real_time_factor
    facts = [
        f"makespan          {seconds(summary.makespan_s)} simulated",
        f"contacts          {contacts}",
        f"wall time         {seconds(summary.wall_s)}",
        f"real-time factor  {factor:.1f}" if factor is not None else "real-time factor  unknown",
        f"recording         {summary.recording or 'none'}",
        f"logs              {summary.out}",
    ]
    return Group("", _title(summary), *goals, "", tasks, "", robots, "", *facts)


def _title(summary: Summary) -> Text:
    if summary.ok:
        return Text("Every goal is reached: the physics and the planner agree.", "bold green")
    wrong = [verdict for verdict in summary.goals if not verdict.agreed]
    if wrong and all(
        verdict.physics is Verdict.NOT_JUDGED and verdict.planner is GoalState.REACHED
        for verdict in wrong
    ):
        return Text(
            "The planner says that every goal is reached; the physics cannot see all of it, so it "
            "does not count as shown.",
            "bold red",
        )
    return Text("Not every goal is reached, or physics and planner disagree.", "bold red")
