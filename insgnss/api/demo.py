"""The demonstration: a simulated flight, processed from its files and compared with its truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.ahead import compile_ahead
from ..flight.config.load import load_flight
from ..flight.processing.pipeline import ProcessResult, process
from ..flight.processing.progress import Progress, quiet
from ..geodesy.rotation import vector_from_rotation
from ..records import Array, ExteriorOrientation
from ..report.document import Document, Section, Table
from ..report.verdict import run_verdict


@dataclass(frozen=True)
class DemoResult:
    """The errors of a processed simulated flight against its truth.

    Parameters
    ----------
    process : ProcessResult
        The run.
    images : int
        The number of images.
    position_rms_m, attitude_rms_rad : ndarray, shape (3,)
        Root mean square errors over the images, axes east, north, up.
    position_nse, attitude_nse : ndarray, shape (3,)
        Mean squares of the errors over their variances.
    directory : Path
        The flight and its products.
    """

    process: ProcessResult
    images: int
    position_rms_m: Array
    attitude_rms_rad: Array
    position_nse: Array
    attitude_nse: Array
    directory: Path

    def as_dict(self) -> dict[str, Any]:
        """Return the errors in types that JSON has."""
        return {
            "images": self.images,
            "position_rms_mm": (1e3 * self.position_rms_m).round(3).tolist(),
            "attitude_rms_deg": np.degrees(self.attitude_rms_rad).round(6).tolist(),
            "position_normalised_error_squared": self.position_nse.round(3).tolist(),
            "attitude_normalised_error_squared": self.attitude_nse.round(3).tolist(),
            "directory": str(self.directory),
            "files": [str(file) for file in self.process.files],
        }

    def summary(self) -> str:
        """Return the errors in a small table for the terminal."""
        report = next(file for file in self.process.files if file.name == "report.html")
        rows = [
            (name, *(format(x, form) for x in values))
            for name, values, form in (
                ("position rms, mm", 1e3 * self.position_rms_m, ".2f"),
                ("attitude rms, deg", np.degrees(self.attitude_rms_rad), ".4f"),
                ("error squared over its variance, position", self.position_nse, ".2f"),
                ("the same of attitude", self.attitude_nse, ".2f"),
            )
        ]
        mean = "In the last two rows the mean should be 1; 0.5 to 2 is usual for one flight."
        return Document(
            "Demonstration",
            f"{self.images} images against the simulated truth",
            run_verdict(self.process.report),
            [Section("Errors", [Table(rows, ("", "east", "north", "up"), numbers=True), mean])],
            files=[self.directory, report, report.with_name("metashape.csv")],
        ).text()


def demo(
    directory: Path | None = None, minutes: float = 8.0, seed: int = 0, progress: Progress = quiet
) -> DemoResult:
    """Simulate a block flight with a NavChip, process it from its files and compare with the truth.

    Parameters
    ----------
    directory : Path or None
        Where the flight goes; by default insgnss_demo.
    minutes : float
        The duration of the flight, min.
    seed : int
        Of the simulated errors.
    progress : Progress
        Receives the name of each step.

    Returns
    -------
    DemoResult
        The run and its errors.
    """
    from ..simulation.dataset import write_dataset

    directory = Path("insgnss_demo") if directory is None else Path(directory)
    compile_ahead()
    progress("simulate")
    dataset = write_dataset(directory, "ign8", minutes, imu_rate=500.0, seed=seed)
    result = process(load_flight(dataset.flight_file), None, progress)
    return compare_with_truth(result, dataset.simulated.truth.eo, directory)


def compare_with_truth(
    result: ProcessResult, truth: ExteriorOrientation, directory: Path
) -> DemoResult:
    """Compare a run with the truth of its flight.

    Parameters
    ----------
    result : ProcessResult
        The run.
    truth : ExteriorOrientation
        The true orientations in the same tangent plane, of these images at least.
    directory : Path
        The flight and its products.

    Returns
    -------
    DemoResult
        The errors at the images of the run.
    """
    eo = result.eo
    assert eo is not None
    index = {image: k for k, image in enumerate(truth.images)}
    k = np.array([index[image] for image in eo.images])
    rotation = vector_from_rotation(truth.C_mc[k] @ np.swapaxes(eo.C_mc, -1, -2))
    error = np.concatenate([truth.position_m[k] - eo.position_m, rotation], axis=1)
    nse = np.mean(error**2 / np.diagonal(eo.cov, axis1=1, axis2=2), axis=0)
    rms = np.sqrt(np.mean(error**2, axis=0))
    return DemoResult(result, len(eo.images), rms[:3], rms[3:], nse[:3], nse[3:], directory)
