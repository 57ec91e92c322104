"""The diagnostics of a run: what the report shows of its segments."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...geodesy.rotation import rpy_from_rotation
from ...navigation.diagnosis.estimated import (
    combine_estimates,
    constant_states,
    state_verdicts,
    time_correlated_errors,
)
from ...navigation.filter.codes import (
    AZ,
    BAROMETER_ROW,
    COVARIANCE_RESET,
    NAV,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    USED,
    VELOCITY_ROW,
)
from ...navigation.filter.trajectory import trajectory
from ...navigation.innovations.sensor_trial import heading_with
from ...records import Array, Diagnostics, Finding, Trajectory
from ...records.series import ConstantSeries
from ...records.states import OF_LEVER_ARM, TIME_OFFSET
from ...report.rules.accuracy import GOOD_HEADING_DEG
from ..config.flight_file import Flight
from ..sensors.trials import ANTENNA_PAIR, trial_sensors
from .recording import Recording
from .segment import Segment

# epochs of a flight up to which every sensor is tried: each takes a pass of filter and smoother,
# half a second there
MOST_TRIED_EPOCHS = 15_000
SENSOR_HELPS = 0.8  # of the sigma without it: less gain is no reason to buy a sensor (chosen)


@dataclass(frozen=True)
class ReportRows:
    """The rows of a segment that the report shows.

    Parameters
    ----------
    epochs : ndarray, shape (k,)
        The epochs of the solution.
    trajectory : Trajectory
        The poses at these epochs.
    """

    epochs: np.ndarray
    trajectory: Trajectory


def report_rows(segments: Sequence[Segment], gps_week: int) -> list[ReportRows]:
    """Choose the rows that the report shows.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.
    gps_week : int
        The GPS week whose seconds the stamps count.

    Returns
    -------
    list of ReportRows
        One for each segment: the epochs of which all covariances are kept, some thousands
        (`navigation.filter.blocks.ROWS`) and all exposures.
    """
    rows = []
    for solution in (segment.solution for segment in segments):
        epochs = solution.rows
        rows.append(ReportRows(epochs, trajectory(solution, epochs, gps_week)))
    return rows


def run_diagnostics(
    segments: Sequence[Segment],
    rows: Sequence[ReportRows],
    stationary: Array,
    checks: tuple[Finding, ...],
) -> Diagnostics:
    """Gather the diagnostics of a run.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.
    rows : sequence of ReportRows
        The rows of each segment that the report shows.
    stationary : ndarray, shape (k, 2), s
        First and last instant of each stationary period.
    checks : tuple of Finding
        All checks of the run.

    Returns
    -------
    Diagnostics
        Those of all segments, joined.
    """
    of_segments = [_of_segment(*pair, stationary) for pair in zip(segments, rows, strict=True)]
    return replace(Diagnostics.joined(of_segments), checks=checks)


def constants_of(flight: Flight, segments: Sequence[Segment]) -> list[dict[str, Any]]:
    """Return what a flight by itself says of the constants of its fixes, as report.json has it.

    Parameters
    ----------
    flight : Flight
        The flight file, whose values these correct.
    segments : sequence of Segment
        The solved segments.

    Returns
    -------
    list of dict
        Lever arm IMU to antenna in body axes, time offset of the fixes and rate of their clock, as
        far as the flight tells: correction and sigma, and the value that it corrects.
    """
    lever = flight.mounting.antenna_lever_b.tolist()
    stated = dict(zip(OF_LEVER_ARM, lever, strict=True))
    stated[TIME_OFFSET] = flight.gnss.time_offset_s
    return [
        {
            "name": e.name,
            "correction": e.value,
            "sigma": e.sigma,
            "assumed": stated.get(e.state, 0.0),
        }
        for e in combine_estimates([segment.constants for segment in segments])
    ]


def _of_segment(segment: Segment, rows: ReportRows, stationary: Array) -> Diagnostics:
    """Gather the diagnostics of one segment."""
    solution, epochs = segment.solution, rows.epochs
    bias, bias_sigma = solution.channel_bias(epochs)
    time, verdict = solution.time, solution.verdict
    fix = np.flatnonzero(verdict[:, POSITION_ROW] != NOT_MEASURED)
    velocity, barometer = (
        np.flatnonzero(verdict[:, kind] != NOT_MEASURED) for kind in (VELOCITY_ROW, BAROMETER_ROW)
    )
    return Diagnostics(
        time=time[epochs],
        position=solution.nav[epochs, :3],
        velocity=solution.nav[epochs, 3:6],
        rpy=rpy_from_rotation(rows.trajectory.C_nb),
        event=np.searchsorted(epochs, solution.event_epochs),
        filter_sigma=solution.filter_sigma[epochs, NAV],
        smoothed_sigma=np.sqrt(solution.variance(epochs)[:, NAV]),
        bias=bias,
        bias_sigma=bias_sigma,
        fix_time=time[fix],
        innovation=solution.innovation[fix, :3],
        innovation_sigma=solution.innovation_sigma[fix, :3],
        nis=solution.nis[fix, POSITION_ROW],
        nis_limit=solution.problem.gate,
        used=verdict[fix, POSITION_ROW] != REJECTED,
        covariance_resets=time[verdict[:, POSITION_ROW] == COVARIANCE_RESET],
        separation_time=time[solution.separation_epoch],
        separation=solution.separation,
        separation_sigma=solution.separation_sigma,
        gaps=solution.problem.inc.gaps,
        passes=solution.passes,
        velocity_nis=solution.nis[velocity, VELOCITY_ROW] if velocity.size else None,
        velocity_used=verdict[velocity, VELOCITY_ROW] == USED if velocity.size else None,
        barometer_nis=solution.nis[barometer, BAROMETER_ROW] if barometer.size else None,
        barometer_used=verdict[barometer, BAROMETER_ROW] == USED if barometer.size else None,
        stationary=stationary[(stationary[:, 1] > time[0]) & (stationary[:, 0] < time[-1])],
        states=state_verdicts(solution, segment.time_offset_s, segment.stated, segment.requested),
        segments=((float(time[0]), float(time[-1])),),
        time_correlated=time_correlated_errors(solution),
        residuals=segment.residuals,
        withheld=solution.problem.epochs.withheld[fix],
        constants=_constants(segment, epochs),
    )


def _constants(segment: Segment, epochs: np.ndarray) -> ConstantSeries | None:
    """Return the constants that a segment estimates besides biases, at the rows of the report."""
    solution, layout = segment.solution, segment.solution.problem.layout
    states = constant_states(solution, segment.stated)
    if not states:
        return None
    columns = np.array(states)
    rows = NAV.stop + columns
    value = solution.x[np.ix_(epochs, columns)]
    if layout.offset in states:
        value[:, states.index(layout.offset)] += segment.time_offset_s
    variance = solution.variance(epochs)[:, rows]
    return ConstantSeries(
        tuple(layout.states[s] for s in states),
        value,
        np.sqrt(np.maximum(variance, 0.0)),
        solution.row_sigma[:, rows],
    )


def tried_sensors(recording: Recording, segments: Sequence[Segment]) -> dict[str, float]:
    """Return what further sensors would have left of an uncertain heading of the images.

    Parameters
    ----------
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments, with their increments.

    Returns
    -------
    dict of str to float
        By sensor the median of the standard deviations, deg, of those that help; none where the
        heading is good, or further sensors take part. Of long flights the antennas alone are tried.
    """
    solutions = [s.solution for s in segments if s.solution.event_epochs.size]
    if recording.measurements or not solutions:
        return {}

    def median_deg(sigmas: list[Array]) -> float:
        return float(np.degrees(np.median(np.concatenate(sigmas))))

    before_deg = median_deg(
        [np.sqrt(s.nav_covariance(s.event_epochs)[:, AZ, AZ]) for s in solutions]
    )
    if before_deg <= GOOD_HEADING_DEG:
        return {}
    short = sum(s.time.size for s in solutions) <= MOST_TRIED_EPOCHS
    tried_deg = {
        name: median_deg([heading_with(s, sensor)[s.event_epochs] for s in solutions])
        for name, sensor in trial_sensors().items()
        if short or name == ANTENNA_PAIR
    }
    return {name: deg for name, deg in tried_deg.items() if deg < SENSOR_HELPS * before_deg}
