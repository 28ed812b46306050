"""What has to hold, or must not, in every state on the way to a goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fleet.core.model import derived
from fleet.core.model.skills import Action
from fleet.planners.symbolic.engine.nodes import Nodes, State
from fleet.planners.symbolic.engine.readings import is_read_off
from keyexpr_schema.facts import AT, IN, ON, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition

ActionKey = tuple[str, tuple[str, ...]]
"""A skill and its arguments."""


def action_key(action: Action) -> ActionKey:
    """What an action is known by."""
    return action.skill.name, tuple(action.args.values())


@dataclass(frozen=True)
class Trajectory:
    """Conditions that hold, or do not, in every state on the way; some do `not_yet`, because
    something else has to hold before."""

    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()
    not_yet: tuple[Condition, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.always or self.avoided)

    @property
    def avoided(self) -> tuple[Condition, ...]:
        """All that holds in no state on the way."""
        return (*self.never, *self.not_yet)


ANYHOW = Trajectory()
"""It does not matter what holds on the way."""


class OnTheWay:
    """A trajectory's conditions over the states of a task."""

    def __init__(self, trajectory: Trajectory, nodes: Nodes) -> None:
        self._trajectory = trajectory
        self._nodes = nodes
        self._world = nodes.world

    def __bool__(self) -> bool:
        return bool(self._trajectory)

    def allows(self, state: State) -> bool:
        """Whether what has to hold on the way holds in a state."""
        read = self._nodes.values(state)
        start = self._nodes.start

        def value_of(key: FactKey) -> Value:
            value = read(key)
            return start.get(key) if value is None else value

        def holds(condition: Condition) -> bool:
            return any(self._holds(literal, value_of) for literal in condition.literals)

        way = self._trajectory
        return all(map(holds, way.always)) and not any(map(holds, way.avoided))

    def broken_by(self, action: Action) -> str | None:
        """What an action breaks wherever it is done, as far as what it needs and what it does
        tells, as a clause; `None` if that is not certain.
        """
        before = {
            literal.variable: literal.value
            for literal in action.before
            if literal.variable.subject in self._nodes.position
            or not is_read_off(literal, self._world)
        }
        written = [derived.written(literal, self._world) for literal in action.after]
        after = {**before, **{literal.variable: literal.value for literal in written}}
        open_ = {effect.variable.relation for effect in action.conditional}
        open_ |= {AT} if open_ & {ON, IN} else set()
        after = {key: value for key, value in after.items() if key.relation not in open_}
        robots = action.skill.robot_parameters
        args = ", ".join(value for name, value in action.args.items() if name not in robots)
        name = f"{action.skill.name}({args})"
        way = self._trajectory
        for condition in way.avoided:
            rule = f"which must {'never hold' if condition in way.never else 'not hold yet'}"
            for known, leads in ((before, "needs"), (after, "leads to")):
                if any(self._surely(literal, known) is True for literal in condition.literals):
                    return f"{name} {leads} {condition}, {rule}"
        for condition in way.always:
            for known in (before, after):
                if all(self._surely(literal, known) is False for literal in condition.literals):
                    return f"{name} goes against {condition}, which must always hold"
        return None

    def _surely(self, literal: Literal, known: dict[FactKey, Value]) -> bool | None:
        """Whether a literal holds where variables have the `known` values; `None` if that depends
        on others that change."""

        def value_of(key: FactKey) -> Value:
            if key in known:
                return known[key]
            if key in self._nodes.number:
                raise _Depends
            return self._nodes.known(key)

        try:
            return self._holds(literal, value_of)
        except _Depends:
            return None

    def _holds(self, literal: Literal, value_of: Callable[[FactKey], Value]) -> bool:
        return derived.holds(literal, value_of, self._world, aboard=True)


class _Depends(Exception):
    """It depends on what changes."""
