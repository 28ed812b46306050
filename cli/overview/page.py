"""The page of `status` and `watch`, in the width and height of a screen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from cli.client.closures import how_to_open
from cli.client.closures import in_words as closed_in_words
from cli.client.holds import how_to_end, in_words
from cli.overview.layout import Section, aligned, fitted, wrapped
from cli.overview.needs import NeedsPerson, needs_of
from cli.overview.situation import Situation, Waiting
from cli.times import moment
from cli.views.schedules import next_lines
from cli.views.text import STATE_STYLE, carried, charge, counted, seconds, skill_call, spent_s
from cli.views.waits import waits_shown
from keyexpr_schema.payloads.goals import GoalStatus
from keyexpr_schema.payloads.plans import PlanStatus
from keyexpr_schema.payloads.tasks import TaskRecord

TALL = 30
"""On a screen of so many lines what needs a person is said in two lines each, else in one."""
_URGENT = {
    "stop": "bold red",
    "diagnostic": "red",
    "trouble": "red",
    "failed": "red",
    "rejected": "red",
}


class FleetPage:
    """What needs a person, what runs, what waits, robots, and what is over.

    With `whole` it is as long as it is, else no longer than the screen. `needs_me` leaves only what
    needs a person, `ended` shows what is over line by line.
    """

    def __init__(
        self,
        situation: Situation,
        head: Sequence[str | Text] = (),
        *,
        whole: bool = False,
        needs_me: bool = False,
        ended: bool = False,
    ) -> None:
        self._of = situation
        self._head = head
        self._whole = whole
        self._needs_me = needs_me
        self._ended = ended

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        height = None if self._whole else console.size.height - 1
        head = wrapped(map(_alone, self._head), console, width, 9)
        lines = [line for item in head for line in item]
        left = None if height is None else max(4, height - len(lines))
        yield from lines
        sections = self._sections(console, width)
        shown = fitted(sections, left)
        if not shown:
            yield Text("Nothing needs a person." if self._needs_me else "Nothing is going on.")
        yield from shown

    def _sections(self, console: Console, width: int) -> list[Section]:
        of = self._of
        most = 99 if self._whole else 2 if console.size.height >= TALL else 1
        needs = []
        for each in needs_of(of):
            lines = 3 if self._needs_me or each.kind == "stop" else 1
            needs += wrapped([_need(each)], console, width, max(most, lines))
        whom = "Needs a person"
        sections = [Section(f"{whom} ({len(needs)})", needs, 6, "robotctl status --needs-me")]
        if self._needs_me:
            return sections
        holds = [
            _held(f"{in_words(hold)}, since {moment(hold.wall_time_s)}", how_to_end(hold))
            for hold in of.holds
        ]
        holds += [_held(closed_in_words(each), how_to_open(each)) for each in of.closures]
        schedules = [] if of.filters.any else next_lines(of.view.schedule_status.values())
        later = map(_alone, schedules)
        goals = sum(each.robot is None for each in of.waiting)
        tasks = len(of.waiting) - goals
        behind = f", {of.behind} behind them" if of.behind else ""
        sections += [
            Section("Held", wrapped(holds, console, width, most), 1),
            Section(
                f"Runs ({counted(len(of.plans), 'plan')}, {counted(len(of.running), 'task')})",
                aligned(list(self._running()), width),
                5,
                "robotctl task list",
            ),
            Section(
                f"Waits ({counted(goals, 'goal')}, {counted(tasks, 'task')} next{behind})",
                aligned([_waits(each) for each in of.waiting], width),
                3,
                "robotctl goal list",
            ),
            Section("Later", wrapped(later, console, width, most), 1, "robotctl schedule list"),
            self._robots(console, width),
            *self._over(width),
        ]
        return sections

    def _running(self) -> Iterable[list[Text | str]]:
        """A line a plan, and under it one for each of its tasks that runs."""
        of, now_s = self._of, self._of.view.now_s
        for status in of.plans:
            (done, all_), (reached, goals) = of.counted(status.plan), of.reached(status)
            yield [
                Text(f"{status.plan} r{status.revision}", "bold"),
                Text(status.state.value, STATE_STYLE.get(status.state.value, "")),
                f"{done}/{all_} tasks, {reached}/{goals} goals",
                Text(waits_shown(status.waits_for, status.plan), "yellow"),
            ]
            for record in of.running:
                if record.plan == status.plan:
                    yield _task(record, now_s)
        plans = {status.plan for status in of.plans}
        yield from (_task(r, now_s) for r in of.running if r.plan not in plans)

    def _robots(self, console: Console, width: int) -> Section:
        robots = self._of.robots
        counts = Counter(activity for _, activity, _ in robots)
        title = f"Robots ({', '.join(f'{n} {word}' for word, n in counts.most_common())})"
        if self._whole or len(robots) <= console.size.height // 4:
            rows: list[list[Text | str]] = [
                [
                    name,
                    activity,
                    *([charge(state)] if any(charge(s) for _, _, s in robots) else []),
                    state.place or "" if state else "",
                    carried(state),
                ]
                for name, activity, state in robots
            ]
            return Section(title, aligned(rows, width), 0, "robotctl robots")
        folded = []
        for word, _ in counts.most_common():
            names = ", ".join(name for name, activity, _ in robots if activity == word)
            folded.append(_alone(Text.assemble((f"{word} ", "bold"), names)))
        return Section(title, wrapped(folded, console, width, 2), 0, "robotctl robots")

    def _over(self, width: int) -> list[Section]:
        goals, plans = self._of.ended()
        if not goals and not plans:
            return []
        counts = [
            ", ".join(f"{n} {state}" for state, n in Counter(s.state.value for s in each).items())
            for each in (goals, plans)
        ]
        words = [f"goals {counts[0]}" if goals else "", f"plans {counts[1]}" if plans else ""]
        title = f"Ended: {'; '.join(word for word in words if word)}"
        if not self._ended:
            return [Section("", [[Text(f"{title} (`--ended`)", "dim")]], 1)]
        rows = [_over(each, each.goal, each.plan or "") for each in goals]
        rows += [_over(each, f"plan {each.plan}", "") for each in plans]
        return [Section(title, aligned(rows, width), 4, "robotctl history")]


def _alone(each: str | Text) -> tuple[Text, Text]:
    return Text(each) if isinstance(each, str) else each, Text()


def _held(sentence: str, hint: str) -> tuple[Text, Text]:
    return Text(sentence, "yellow"), Text(f" (`{hint}`)", "cyan")


def _need(each: NeedsPerson) -> tuple[Text, Text]:
    hint = Text(f" (`{each.hint}`)" if each.hint else "", "cyan")
    return Text(each.sentence, _URGENT.get(each.kind, "yellow")), hint


def _task(record: TaskRecord, now_s: float | None) -> list[Text | str]:
    spent = spent_s(record, now_s)
    about = f" of about {seconds(record.duration_s)}" if record.duration_s else ""
    took = f"{seconds(spent)}{about}" if spent is not None else ""
    since = moment(record.wall_time_s, None)
    said = Text(f"{took}{', since ' if took and since else ''}{since}")
    if record.waits_for:  # first, as what stands last is cut where a screen is narrow
        said = Text(f"{waits_shown(record.waits_for, record.plan)}  ", "red").append(said)
    return [
        Text.assemble("  ", (record.robot or record.actor, "blue")),
        Text(record.state.value, STATE_STYLE[record.state.value]),
        f"{record.task} {skill_call(record.skill, record.args, record.robot)}",
        said,
    ]


def _waits(each: Waiting) -> list[Text | str]:
    plan = each.what.partition("/")[0] if each.robot else None
    why = waits_shown(each.waits_for, plan) or each.stands or "no planner has read it yet"
    return [
        Text(each.what, "bold"),
        Text(each.robot or each.state, "blue" if each.robot else STATE_STYLE.get(each.state, "")),
        why,
    ]


def _over(status: GoalStatus | PlanStatus, name: str, plan: str) -> list[Text | str]:
    return [
        name,
        Text(status.state.value, STATE_STYLE.get(status.state.value, "")),
        moment(status.wall_time_s, status.time_s),
        plan,
        status.reason or "",
    ]
