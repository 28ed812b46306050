"""How the viewer is laid out: 3D above the Gantt chart; task graph, utilisation, events."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, hypot, radians, sin
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import encodings

from fleet.timeline.drawing.sink import SIM_TIME, end_unused_streams

Rectangle = tuple[float, float, float, float]

DEFAULT_FLOOR_M: Rectangle = (0.0, 0.0, 10.0, 6.0)
DEFAULT_SPAN_S = (0.0, 60.0)
LANE_SHARE, AXIS_SHARE = 0.0475, 0.075
"""What a lane of the Gantt chart takes of the height of a 900 pixel window; its title and axis."""
ABREAST = 7
"""With one lane more than this the chart stands below all the rest, in columns of so many."""
COLUMNS = 4
"""More columns would be too narrow for the words in the bars: then they have more lanes."""
MOST_SHARE = 0.7
"""Of the height, for the chart: up to 52 lanes."""

ELEVATION_DEG = 68.0
AWAY = 0.97
"""Distance of the eye from the middle of the floor, in diagonals of the floor and for a view as
high as the window; a lower view shows as much of the width from nearer by."""


NEAREST = 0.68
"""Nearer than this a wide view would cut the floor off at the top and the bottom."""

MARGIN_PX = 40.0
"""Around the task graphs: the viewer puts a frame with a name around each."""

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
    lanes: Sequence[str] = (),
    graphs_px: tuple[float, float] | None = None,
    charge: bool = False,
    programs: bool = False,
) -> Layout:
    """The layout, its eye south of and above the floor `(x_min, y_min, x_max, y_max)` [m].

    `span_s` is the fleet time [s] that the Gantt chart and the utilisation show from side to
    side; `lanes` are the entities of the chart's lanes, all of which it has room for.
    `graphs_px` is how wide and how high the task graphs become; else the viewer fits them itself.
    With `charge` batteries have a tab beside the utilisation, with `programs` their texts one
    beside the events.
    """
    columns = lane_columns(lanes)
    chart = chart_share(max(map(len, columns)))
    world = rrb.Spatial3DView(
        name="World",
        origin="/world",
        contents="/world/**",
        eye_controls=_eye(floor_m or DEFAULT_FLOOR_M, 1.0 - chart),
        line_grid=rrb.LineGrid3D(visible=False),
        background=[24, 26, 30],
    )
    charts = [
        rrb.StateTimelineView(
            name="Who does what" + (f" ({number} of {len(columns)})" if columns[1:] else ""),
            origin="/robots",
            contents=list(column) or "/robots/**",
            time_view=_time(span_s),
        )
        for number, column in enumerate(columns, 1)
    ]
    busy = rrb.TimeSeriesView(
        name="Busy share since the first task",
        origin="/fleet/utilisation",
        contents="/fleet/utilisation/**",
        axis_x=_time(span_s),
        axis_y=rrb.ScalarAxis(range=(-0.05, 1.05)),
        plot_legend=rrb.PlotLegend(visible=len(lanes) <= LEGEND, corner=rrb.Corner2D.LeftBottom),
    )
    events = rrb.TextLogView(
        name="Events", origin="/fleet/log", contents="/fleet/log/**", columns=_columns()
    )
    told = rrb.Vertical(
        rrb.GraphView(
            name="Task graph",
            origin="/fleet/dag",
            contents="/fleet/dag/**",
            visual_bounds=None if graphs_px is None else _bounds(*graphs_px),
        ),
        rrb.Tabs(busy, _charge(span_s), active_tab=0) if charge else busy,
        rrb.Tabs(events, _programs(), active_tab=0) if programs else events,
        row_shares=[0.5, 0.19, 0.31],
    )
    shares = [1.0 - chart, chart]
    if columns[1:]:
        above = rrb.Horizontal(world, told, column_shares=[0.62, 0.38])
        whole: Any = rrb.Vertical(above, rrb.Horizontal(*charts), row_shares=shares)
    else:
        left = rrb.Vertical(world, *charts, row_shares=shares)
        whole = rrb.Horizontal(left, told, column_shares=[0.62, 0.38])
    return Layout(
        whole,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=SIM_TIME),
        auto_layout=False,
        auto_views=False,
    )


def lane_columns(lanes: Sequence[str]) -> list[tuple[str, ...]]:
    """The lanes in columns side by side, of equal length: one column of few."""
    count = min(COLUMNS, max(1, ceil(len(lanes) / ABREAST)))
    length = max(1, ceil(len(lanes) / count))
    return [tuple(lanes[at : at + length]) for at in range(0, max(1, len(lanes)), length)]


def chart_share(lanes: int) -> float:
    """The part of the height that a column of so many lanes takes."""
    return min(MOST_SHARE, AXIS_SHARE + LANE_SHARE * max(2, lanes))


def _charge(span_s: tuple[float, float]) -> Any:
    return rrb.TimeSeriesView(
        name="Charge, %",
        origin="/fleet/charge",
        contents="/fleet/charge/**",
        axis_x=_time(span_s),
        axis_y=rrb.ScalarAxis(range=(-5.0, 105.0)),
    )


def _programs() -> Any:
    return rrb.TextDocumentView(name="Program", origin="/fleet/program")


def _bounds(wide_px: float, high_px: float) -> Any:
    return rrb.VisualBounds2D(
        x_range=(-MARGIN_PX, wide_px + MARGIN_PX), y_range=(-2 * MARGIN_PX, high_px)
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
