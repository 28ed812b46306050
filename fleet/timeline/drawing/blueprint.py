"""How the viewer is laid out: 3D above the Gantt chart; task graph, utilisation, events."""

from __future__ import annotations

from math import cos, hypot, radians, sin
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import encodings

from fleet.timeline.drawing.sink import SIM_TIME, end_unused_streams

Rectangle = tuple[float, float, float, float]

DEFAULT_FLOOR_M: Rectangle = (0.0, 0.0, 10.0, 6.0)
DEFAULT_SPAN_S = (0.0, 60.0)
LANE_SHARE = 0.018
"""A third of a lane of the Gantt chart, as a part of the height of a 900 pixel window."""

ELEVATION_DEG = 68.0
AWAY = 0.97
"""Distance of the eye from the middle of the floor, in diagonals of the floor and for a view as
high as the window; a lower view shows as much of the width from nearer by."""


NEAREST = 0.68
"""Nearer than this a wide view would cut the floor off at the top and the bottom."""

LEGEND = 5
"""With more robots the legend would hide the lines."""


class Layout(rrb.Blueprint):
    """Remembers the stream by which Rerun hands it on, which holds itself until it is told to end.

    Two threads and some hundred kB a layout are too much where files roll.
    """

    handed_on_by: rr.RecordingStream | None = None

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        self.handed_on_by = stream

    def send(self, stream: rr.RecordingStream) -> None:
        """Lay out a recording so, and leave nothing behind."""
        stream.send_blueprint(self)
        if self.handed_on_by is not None:
            self.handed_on_by.disconnect()
            self.handed_on_by = None
        end_unused_streams()


def blueprint(
    floor_m: Rectangle | None = None,
    span_s: tuple[float, float] = DEFAULT_SPAN_S,
    lanes: int = 2,
) -> Layout:
    """The layout, its eye south of and above the floor `(x_min, y_min, x_max, y_max)` [m].

    `span_s` is the fleet time [s] that the Gantt chart and the utilisation show from side to
    side; the chart gets room for so many `lanes`, up to half of the height.
    """
    chart = min(0.5, (4 + 3 * max(2, lanes)) * LANE_SHARE)
    return Layout(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(
                    name="World",
                    origin="/world",
                    contents="/world/**",
                    eye_controls=_eye(floor_m or DEFAULT_FLOOR_M, 1.0 - chart),
                    line_grid=rrb.LineGrid3D(visible=False),
                    background=[24, 26, 30],
                ),
                rrb.StateTimelineView(
                    name="Who does what",
                    origin="/robots",
                    contents="/robots/**",
                    time_view=_time(span_s),
                ),
                row_shares=[1.0 - chart, chart],
            ),
            rrb.Vertical(
                rrb.GraphView(name="Task graph", origin="/fleet/dag", contents="/fleet/dag/**"),
                rrb.TimeSeriesView(
                    name="Busy share since the first task",
                    origin="/fleet/utilisation",
                    contents="/fleet/utilisation/**",
                    axis_x=_time(span_s),
                    axis_y=rrb.ScalarAxis(range=(-0.05, 1.05)),
                    plot_legend=rrb.PlotLegend(
                        visible=lanes <= LEGEND, corner=rrb.Corner2D.LeftBottom
                    ),
                ),
                rrb.TextLogView(
                    name="Events", origin="/fleet/log", contents="/fleet/log/**", columns=_columns()
                ),
                row_shares=[0.5, 0.19, 0.31],
            ),
            column_shares=[0.62, 0.38],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=SIM_TIME),
        auto_layout=False,
        auto_views=False,
    )


def _eye(floor_m: Rectangle, height: float) -> Any:
    x0, y0, x1, y1 = floor_m
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    away_m = max(AWAY * height, NEAREST) * max(2.0, hypot(x1 - x0, y1 - y0))
    up = radians(ELEVATION_DEG)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(middle[0], middle[1] - away_m * cos(up), away_m * sin(up)),
        look_target=(middle[0], middle[1], 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )


def _time(span_s: tuple[float, float]) -> Any:
    low, high = (rr.TimeRangeBoundary.absolute(seconds=edge) for edge in span_s)
    return rrb.archetypes.TimeAxis(view_range=rr.TimeRange(start=low, end=high))


def _columns() -> Any:
    kind = encodings.TextLogColumnKind
    return rrb.archetypes.TextLogColumns(
        timeline_columns=[encodings.TimelineColumn(SIM_TIME)],
        text_log_columns=[
            encodings.TextLogColumn(kind.LogLevel, visible=True),
            encodings.TextLogColumn(kind.Body, visible=True),
        ],
    )
