"""What all charts over time mark in the same way.

Numbered lines, stationary periods, times without fixes, segments.
"""

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Diagnostics, ExteriorOrientation
from .charts.chart import Shade
from .coverage import outages, segments, stationary_periods
from .flightlines import flight_lines


@dataclass(frozen=True, eq=False)
class Marks:
    """Pieces (k, 2) of the flight, minutes from its start, and exposures (n,).

    The pieces are lines, stationary periods, times without fixes and without solution.

    Parameters
    ----------
    parts : the rows of the diagnostics of each part that was solved by itself.
    label : of the axis of time.
    span : of the flight, minutes.
    start : the first epoch, s.
    """

    start: float
    label: str
    lines: Array
    stationary: Array
    outages: Array
    nothing: Array
    exposures: Array
    parts: tuple[slice, ...]
    span: tuple[float, float]

    def minutes(self, time: Array) -> Array:
        """Return minutes since the first epoch of instants, s."""
        return (time - self.start) / 60.0

    @property
    def shades(self) -> tuple[Shade, ...]:
        """All pieces as a chart shades them, lines with their numbers."""
        kinds: tuple[tuple[Array, Literal["rest", "outage", "other"]], ...] = (
            (self.stationary, "rest"),
            (self.outages, "outage"),
            (self.nothing, "other"),
        )
        return (
            *(Shade(a, b, "line", str(k)) for k, (a, b) in enumerate(self.lines.tolist(), 1)),
            *(Shade(a, b, kind) for pieces, kind in kinds for a, b in pieces.tolist()),
        )

    def broken(self, minutes: Array, y: Array) -> Array:
        """Return y (n,) at `minutes`, not a number in the first row of each part but the first.

        A line is broken there.
        """
        if not self.nothing.size:
            return y
        rows = np.searchsorted(minutes, self.nothing.mean(axis=1))
        out = y.copy()
        out[rows[(rows > 0) & (rows < y.size)]] = np.nan
        return out


def slices(edges: NDArray[np.int64], size: int) -> tuple[slice, ...]:
    """Pieces of `size` rows that begin at zero and at `edges`."""
    return tuple(slice(a, b) for a, b in itertools.pairwise([0, *edges.tolist(), size]) if b > a)


def marks_of(run: Diagnostics, eo: ExteriorOrientation | None) -> Marks:
    """The marks of a run."""
    start = float(run.time[0])

    def minutes(t: Array) -> Array:
        return (t - start) / 60.0

    whole, without = segments(run), outages(run)
    lines = np.array(
        [(run.time[x.first], run.time[x.last]) for x in flight_lines(run, eo)]
    ).reshape(-1, 2)
    nothing = np.stack([whole[:-1, 1], whole[1:, 0]], axis=1)
    return Marks(
        start=start,
        label=f"time after the start at TOW {start:.1f} s, min",
        lines=minutes(lines),
        stationary=minutes(stationary_periods(run)),
        outages=minutes(np.stack([without[:, 0], without.sum(axis=1)], axis=1)),
        nothing=minutes(nothing),
        exposures=np.zeros(0) if eo is None else minutes(eo.time),
        parts=slices(np.searchsorted(run.time, nothing.mean(axis=1)), run.time.size),
        span=(0.0, float(minutes(run.time[-1]))),
    )
