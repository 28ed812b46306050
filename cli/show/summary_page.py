"""The summary of a demo, for a person."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text

from cli.demo.summary import Summary
from cli.judge import Judgement
from cli.show.page import table
from cli.show.words import call, seconds

MARKS = {Judgement.HOLDS: "✓", Judgement.FAILS: "✗", Judgement.NOT_JUDGED: "?"}


def summary_page(summary: Summary) -> Group:
    """Verdicts, tasks, times."""
    goals = [
        Text.assemble(
            (f"{MARKS[verdict.physics]} ", "green" if verdict.agreed else "red"),
            (verdict.goal, "bold"),
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
                call(line.skill, line.args, leave_out=line.robot),
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
    title = (
        Text("Every goal is reached: the physics and the planner agree.", "bold green")
        if summary.ok
        else Text("Not every goal is reached, or physics and planner disagree.", "bold red")
    )
    return Group("", title, *goals, "", tasks, "", robots, "", *facts)
