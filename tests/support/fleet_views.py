"""What robotctl sees of a model of the fleet, as if its documents were on keys."""

from __future__ import annotations

from typing import Any

from cli.client.fleet_view import FleetView
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import GOAL_SPEC, HOLD, ROBOT_SPEC, STOP
from keyexpr_schema.transport.session import Change
from tests.support.fleet_model import FleetModel


def view_of(model: FleetModel) -> FleetView:
    """Documents of the planner, and what people have put."""
    view, state = FleetView(), model.state

    def put(key: Any, address: Any, value: Any) -> None:
        view.apply(Change(key, address, value, ""))

    for keyexpr, document in model.documents.items():
        key = key_of(keyexpr)
        put(key, key.parse(keyexpr), document)
    for key, table in (
        (GOAL_SPEC, state.goals),
        (ROBOT_SPEC, state.robots),
        (STOP, state.stops),
        (HOLD, state.holds),
    ):
        for name, value in table.items():
            put(key, key.address(name), value)
    return view
