"""Ground points in photographs as functions of Python: predict_targets, measure_targets."""

from pathlib import Path

from ..base.advance import heard, logged
from ..base.inputs import Source, reading
from ..flight.config.block_file import VehicleTable
from ..photogrammetry.target_measurement import run
from ..photogrammetry.target_measurement.request import Target, TargetRequest
from .keywords import path_of
from .verbs import Progress


@heard
@reading()
def predict_targets(
    eo: Source,
    ground: Source,
    camera: Source,
    out: Source | None = None,
    *,
    crs: str | None = None,
    geoid: Source | None = None,
    vehicle: VehicleTable | None = None,
    write: bool = True,
    progress: Progress = logged,
) -> run.PredictionResult:
    """Predict where the images of a flight show its ground points.

    Parameters
    ----------
    eo : eo.json of a processed flight.
    ground : ground points, a table or a program's file.
    camera : camera.toml.
    out : the table; None: targets/predictions.csv beside `eo`.
    crs : of the ground points; None: the tangent plane of `eo`, or what their file says.
    geoid : grid of geoid heights, for heights above sea level.
    vehicle : table [vehicle] of a block file: `ground` is where a vehicle with a target was.
    write : whether to write the table; False: the predictions are in the result only.
    progress : is called with the name of each step.

    Returns
    -------
    The result: `inputs.predictions` (pixels, covariances, visibility), `figures` and `summary()`.

    Raises
    ------
    InputError : a file cannot be read, or files do not belong together.
    DataError : no ground point lies in any image.
    UsageError : a file is missing, or the table cannot be written.
    """
    request = TargetRequest(
        Path(eo), Path(ground), Path(camera), None, crs, path_of(geoid), vehicle=vehicle
    )
    return run.predict_targets(request, path_of(out), progress, write)


@heard
@reading()
def measure_targets(
    eo: Source,
    ground: Source,
    camera: Source,
    images: Source,
    out: Source | None = None,
    *,
    target: Target | None = None,
    crs: str | None = None,
    geoid: Source | None = None,
    search_px: float = 0.0,
    vehicle: VehicleTable | None = None,
    write: bool = True,
    force: bool = False,
    progress: Progress = logged,
) -> run.MeasurementResult:
    """Measure the targets on ground points in the photographs of a flight.

    Parameters
    ----------
    eo : eo.json of a processed flight.
    ground : ground points, a table or a program's file.
    camera : camera.toml.
    images : directory of the photographs.
    out : directory of the products; None: targets beside `eo`.
    target : what the targets look like; None: quadrant patterns of 0.3 m.
    crs : of the ground points; None: the tangent plane of `eo`, or what their file says.
    geoid : grid of geoid heights, for heights above sea level.
    search_px : standard deviation that is added to both coordinates of a prediction, pixels.
    vehicle : table [vehicle] of a block file: `ground` is where a vehicle with a target was.
    write : whether to write the products; False: the windows are in the result only.
    force : whether to overwrite the results of another flight.
    progress : is called with the name of each step.

    Returns
    -------
    The result: `windows` (each with its measurement, or why there is none), `figures` (what
    targets.json holds), `refusal` (an error where nearly nothing was found, else None), `files` and
    `summary()`.

    Raises
    ------
    InputError : a file cannot be read, or files do not belong together.
    DataError : no ground point lies in an image that has a photograph.
    UsageError : a file is missing, or the products cannot be written.
    """
    request = TargetRequest(
        Path(eo),
        Path(ground),
        Path(camera),
        Path(images),
        crs,
        path_of(geoid),
        target or Target(),
        search_px,
        vehicle=vehicle,
    )
    return run.measure_targets(request, path_of(out), progress, write, force=force)
