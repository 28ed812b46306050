"""How the viewer is laid out: 3D above the Gantt chart; task graph, utilisation, events."""

from __future__ import annotations

from math import cos, hypot, radians, sin
from typing import Any

import rerun.blueprint as rrb
from rerun.blueprint import encodings

from fleet.timeline.sink import SIM_TIME

Rectangle = tuple[float, float, float, float]

DEFAULT_FLOOR_M: Rectangle = (0.0, 0.0, 10.0, 6.0)
ELEVATION_DEG = 52.0
AWAY = 1.02
"""Distance of the eye from the middle of the floor, in diagonals of the floor."""


def blueprint(floor_m: Rectangle | None = None) -> rrb.Blueprint:
    """The layout, its eye south of and above the floor `(x_min, y_min, x_max, y_max)` [m]."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(
                    name="World",
                    origin="/world",
                    contents="/world/**",
                    eye_controls=_eye(floor_m or DEFAULT_FLOOR_M),
                    line_grid=rrb.LineGrid3D(visible=False),
                    background=[24, 26, 30],
                ),
                rrb.StateTimelineView(
                    name="Who does what", origin="/fleet/gantt", contents="/fleet/gantt/**"
                ),
                row_shares=[0.66, 0.34],
            ),
            rrb.Vertical(
                rrb.GraphView(name="Task graph", origin="/fleet/dag", contents="/fleet/dag/**"),
                rrb.TimeSeriesView(
                    name="Busy share since the first task",
                    origin="/fleet/utilisation",
                    contents="/fleet/utilisation/**",
                    axis_y=rrb.ScalarAxis(range=(0.0, 1.0)),
                    plot_legend=rrb.PlotLegend(visible=True, corner=rrb.Corner2D.RightTop),
                ),
                rrb.TextLogView(
                    name="Events", origin="/fleet/log", contents="/fleet/log/**", columns=_columns()
                ),
                row_shares=[0.5, 0.2, 0.3],
            ),
            column_shares=[0.58, 0.42],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=SIM_TIME),
        auto_layout=False,
        auto_views=False,
    )


def _eye(floor_m: Rectangle) -> Any:
    x0, y0, x1, y1 = floor_m
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    away_m = AWAY * max(2.0, hypot(x1 - x0, y1 - y0))
    up = radians(ELEVATION_DEG)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(middle[0], middle[1] - away_m * cos(up), away_m * sin(up)),
        look_target=(middle[0], middle[1], 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )


def _columns() -> Any:
    kind = encodings.TextLogColumnKind
    return rrb.archetypes.TextLogColumns(
        timeline_columns=[encodings.TimelineColumn(SIM_TIME)],
        text_log_columns=[
            encodings.TextLogColumn(kind.LogLevel, visible=True),
            encodings.TextLogColumn(kind.Body, visible=True),
        ],
    )
