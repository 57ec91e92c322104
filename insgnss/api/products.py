"""The verbs of the command line that take or give products, as functions of Python: export,
compare, figures, ppk.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..base.advance import heard, logged
from ..base.errors import UsageError
from ..base.inputs import Source, reading
from ..io.options.comparison_options import ComparisonOptions
from ..records import ExteriorOrientation, Trajectory
from .keywords import options_of_record, path_of

if TYPE_CHECKING:
    from ..flight.exporting.export import Exported
    from ..gnss.ppk import PpkResult
    from ..navigation.noise_model.model import NoiseModel
    from ..photogrammetry.comparison.result import Comparison
    from ..records.relative import RelativeControl

FRAMES = ("tangent", "geocentric", "geographic")


@reading()
def export(
    eo: ExteriorOrientation | Source,
    format: str,
    path: Source,
    *,
    crs: str | None = None,
    geoid: Source | None = None,
    frame: Literal["tangent", "geocentric", "geographic"] | None = None,
    ground_m: float | None = None,
    rename: Sequence[str | Path] = (),
    **options: Any,
) -> "Exported":
    """Write an exterior orientation in the format of a bundle adjustment.

    Parameters
    ----------
    eo : the exterior orientation or a part of it (``eo[:20]``), or the eo.json of a run.
    format : a format by name, such as "metashape"; `insgnss export --help` lists them.
    path : file to write; a new directory where the format has several files.
    crs : projected CRS, "EPSG:32632", "EPSG:25832+7837" (with heights), or WKT.
    geoid : grid of geoid heights, for heights above sea level.
    frame : axes where no CRS is named; None: what the format takes first.
    ground_m : height of the ground, from which heights are scaled as the projection scales the
        plan.
    rename : rules by which images are called otherwise in this file, one after the other: "safe"
        (letters, digits and . _ - alone), "basename" (without folders), "OLD=NEW", or the path of a
        table old,new as CSV; the table of both names goes beside the file.
    **options : of the format, such as ``unit="gon"``.

    Returns
    -------
    What was written: `file`, `frame`, and `notes` that its reader must know.

    Raises
    ------
    UsageError : the format or an option is unknown, or the format cannot carry the frame.
    InputError : eo.json cannot be read, there are no images, or the CRS does not reach the flight.
    """
    from ..flight.exporting.export import ExportFrame
    from ..flight.exporting.export import export as write
    from .readers import read_eo

    if frame is not None and frame not in FRAMES:
        raise UsageError(
            f"export: frame {frame!r} is unknown; it is one of {', '.join(FRAMES)}, or give a CRS"
        )
    target = ExportFrame(crs, path_of(geoid), frame, ground_m)
    orientation = eo if isinstance(eo, ExteriorOrientation) else read_eo(eo)
    return write(orientation, format, Path(path), target, rename, **options)


@reading()
def relative_control(
    eo: ExteriorOrientation,
    noise: "str | os.PathLike[str] | NoiseModel" = "navchip",
    *,
    form: Literal["mapping", "camera"] = "mapping",
    gap_s: float = 10.0,
) -> "RelativeControl":
    """Return the relative control between neighbouring images of the same flight line.

    Parameters
    ----------
    eo : the exterior orientation, in the tangent plane.
    noise : model by whose gyroscopes one of the three weightings goes.
    form : "mapping": offsets and rotations in the frame's axes; "camera": pose of one camera in the
        other.
    gap_s : greatest time between the images of a pair, s.

    Returns
    -------
    The relative poses with three weightings side by side.

    Raises
    ------
    UsageError : the form is unknown, or the gap is not positive.
    InputError : the covariances between neighbours are not known, or the noise model is wrong.
    """
    from ..flight.exporting.export import relative_of
    from ..navigation.orient.frame import in_frame
    from ..records.framed import TANGENT

    return relative_of(in_frame(eo, TANGENT), eo, noise, form=form, gap_s=gap_s)


@heard
@reading()
@options_of_record(ComparisonOptions)
def compare(
    a: ExteriorOrientation | Trajectory | Source,
    b: ExteriorOrientation | Trajectory | Source,
    **options: Any,
) -> "Comparison":
    """Compare two orientations or trajectories, and say which convention explains a difference.

    Parameters
    ----------
    a, b : records, or files of any readable format; differences are b minus a.
    form_a, form_b : formats of files that do not show it.
    undulation_a_m, undulation_b_m : geoid above the ellipsoid, to be added to heights of positions
        of GNSS that are above the geoid.
    origin : latitude deg, longitude deg, height m of a tangent plane whose file does not say it.
    crs : of coordinates whose file does not name it, such as "EPSG:2056".
    coordinate_shift : what was subtracted from projected coordinates, in their unit.
    geoid : grid of geoid heights, for projected heights above sea level.
    gps_week : of files with the time of week only.
    time_shift_s : to be added to the times of b.

    Returns
    -------
    The differences: `components` with their statistics, `findings`, `summary()`, `figure()`.

    Raises
    ------
    InputError : a file cannot be read.
    UsageError : a format is unknown.
    DataError : nothing tells which poses belong together.
    """
    from ..photogrammetry.comparison.compare import compare_files

    sources = [x if isinstance(x, ExteriorOrientation | Trajectory) else Path(x) for x in (a, b)]
    return compare_files(*sources, **options)


def figures(
    source: Source,
    *,
    form: Literal["pdf", "svg", "png"] = "pdf",
    out: Source | None = None,
    only: Sequence[str] = (),
    width_mm: float = 174.0,
    force: bool = False,
) -> tuple[Path, ...]:
    """Draw the charts of a page into files, one a chart, named by it.

    Parameters
    ----------
    source : a page that insgnss wrote, such as report.html, or the JSON document beside it.
    form : of the files.
    out : directory of the files; None: `figures` beside the page.
    only : names of charts; all of them where empty.
    width_mm : of each figure: 84 fills one column of a journal, 174 two of them.
    force : whether to overwrite files.

    Returns
    -------
    The files.

    Raises
    ------
    InputError : the page is not there, of another run than the JSON document, or damaged.
    UsageError : a chart or form is unknown, or a file exists already.
    """
    from ..report.charts.files import figure_files

    return figure_files(Path(source), form, path_of(out), only, width_mm, force).files


@heard
@reading()
def ppk(
    rover: Source,
    base: Source,
    navigation: Source | Sequence[Source],
    *,
    base_position: tuple[float, float, float] | None = None,
    base_point: Literal["apc", "arp", "marker"] | None = None,
    events: Source | bool | None = None,
    images: Source | None = None,
    camera_delay_s: float = 0.0,
    wet_delay: bool = True,
    ionosphere: bool = True,
    velocity: bool = True,
    out: Source | None = None,
    progress: Callable[[str], None] = logged,
    **options: Any,
) -> "PpkResult":
    """Solve antenna positions with honest covariances from RINEX of rover and base, by RTKLIB.

    Parameters
    ----------
    rover, base : observations, RINEX 2 or 3, plain or packed.
    navigation : broadcast ephemerides, one file or several.
    base_position : latitude deg, longitude deg, ellipsoidal height m; None: the header's.
    base_point : what stands there, the antenna's phase centre (apc), its reference point (arp) or
        the marker; None: the phase centre, with a note.
    events : camera events: another file of them, True or False for those of the rover's file; None:
        the rover's where it has some.
    images : directory of the images, or list of their names in order, that name the events.
    camera_delay_s : from the event to the middle of the exposure.
    wet_delay : whether to take the wet delay between base and rover off the heights.
    ionosphere : whether to take the ionosphere between base and rover off the positions.
    velocity : whether to find velocities from the rover's carrier phase.
    out : directory that keeps the engine's solutions and ppk.pos; None: nothing is kept.
    progress : is called with the name of each step.
    **options : of the engine, fields of `insgnss.EngineOptions`, such as ``frequencies=1``.

    Returns
    -------
    The result: `fixes`, `events`, `checks`, `verdict`, `quality` and `write(path)`.

    Raises
    ------
    UsageError : an option is unknown or beyond its range, or there is no engine.
    InputError : a file cannot be read, or the base's position is not known.
    DataError : the observations do not support a solution.
    """
    from ..flight.config.changes import with_changes
    from ..gnss.options import options_at
    from ..gnss.ppk import PpkInput, solve_ppk
    from ..io.exposures.naming import ImageMatch

    if base_position is None and base_point is not None:
        raise UsageError("ppk: base_point belongs to base_position; give the coordinates")
    engine = options_at(base_position, base_point=base_point if base_position else None)
    several = [navigation] if isinstance(navigation, str | os.PathLike) else navigation
    request = PpkInput(
        rover=Path(rover),
        base=Path(base),
        navigation=tuple(Path(file) for file in several),
        options=with_changes(engine, options),
        wet_delay=wet_delay,
        ionosphere=ionosphere,
        velocity=velocity,
        events=Path(events) if isinstance(events, str | os.PathLike) else events,
        match=ImageMatch(path_of(images)),
        camera_delay_s=camera_delay_s,
        base_point_chosen=base_position is None or base_point is not None,
    )
    return solve_ppk(request, path_of(out), progress)
