"""The result of a run: its products, and what it found on the way."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...records import (
    Diagnostics,
    Estimate,
    ExteriorOrientation,
    Finding,
    ImuBiases,
    Innovations,
    Trajectory,
)
from ...records.strips import CommonErrors, StripCovariance
from ...report.charts.chart import Chart
from ...report.charts.run import charts
from ...report.notebook import Charted
from ...report.page import run_document


@dataclass(frozen=True, repr=False)
class ProcessResult(Charted):
    """The products of a run, and what it found on the way.

    Parameters
    ----------
    report : dict
        What report.json holds: figures of merit, checks, the resolved flight file, versions.
    files : tuple of Path
        The files that were written.
    eo : ExteriorOrientation or None
        The orientation of the images; None without camera events.
    trajectory : Trajectory
        The trajectory of the IMU's navigation centre, on the output grid.
    diagnostics : Diagnostics
        What the report shows: filter and smoothed sigmas, innovations, biases.
    strips : tuple of StripCovariance
        The covariance of all poses of each flight line, where the flight file asks for it.
    common : CommonErrors or None
        The errors that all flight lines share, beside `strips`.
    """

    report: dict[str, Any]
    files: tuple[Path, ...]
    eo: ExteriorOrientation | None
    trajectory: Trajectory
    diagnostics: Diagnostics
    strips: tuple[StripCovariance, ...] = ()
    common: CommonErrors | None = None

    @property
    def checks(self) -> tuple[Finding, ...]:
        """Every check of the run, those that found nothing wrong among them."""
        return self.diagnostics.checks

    @property
    def states(self) -> tuple[Estimate, ...]:
        """Constants that were estimated besides biases: scale factors, lever arm, time offset."""
        return self.diagnostics.states

    @property
    def biases(self) -> ImuBiases:
        """Biases of the IMU over time, with standard deviations."""
        return replace(self.diagnostics.biases, gps_week=self.trajectory.gps_week)

    @property
    def innovations(self) -> Innovations:
        """Position fixes against what the filter predicted of them."""
        return replace(self.diagnostics.innovations, gps_week=self.trajectory.gps_week)

    def __repr__(self) -> str:
        """Return what there is and the headline of the report."""
        return f"<ProcessResult {self.trajectory!r}, {self.eo!r}: {self.report['headline']}>"

    def charts(self) -> tuple[Chart, ...]:
        """Return the charts of the report, without those of the source of the fixes."""
        return charts(self.diagnostics, self.eo, self.report["standing"])

    def summary(self) -> str:
        """Return the text for the terminal."""
        return run_document(self.report, files=self.files).text()

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json holds."""
        return self.report
