"""One export: into the frame that the format carries, then to its writer.

`process` and `insgnss export` both come here, so that a format, a frame and a refusal are the same
in either.
"""

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError, UsageError, near
from ...base.files import atomic_writes
from ...base.output.staging import together
from ...base.units import METRE
from ...geodesy.crs import is_globe, undulation
from ...geodesy.projection import MapProjection
from ...io.formats.exports import EXPORTS, Export
from ...io.formats.orientation.exported import UnfitName, check_names
from ...navigation.noise_model.model import NoiseModel, load_noise_model
from ...navigation.orient.frame import in_datum, in_frame
from ...navigation.orient.relative import gyro_figures, relative_control
from ...records import Array, ExteriorOrientation, FramedOrientation
from ...records.framed import FRAME_KINDS, GEOGRAPHIC, PROJECTED, TANGENT
from ...records.relative import RelativeControl
from .rename import other_names, rename_images, write_names
from .replacing import remove_stale

OF_IMAGES = ("image_tags",)
"""Formats that are the images themselves, called as their files are."""
ACCURATE_M = 0.1  # of a datum transformation, beyond which an export says so
# a transformation that moves nothing, of the accuracy to which PROJ takes a continent's datum for
# WGS 84 (ETRS89, JGD2011): the base's coordinates are of that datum as a rule
NULL_M, SAME_M = 1e-3, 1.0


@dataclass(frozen=True)
class ExportFrame:
    """The frame that is asked for.

    Parameters
    ----------
    crs : projected CRS as `MapProjection` takes it, or a geographic one: the datum of the export.
    geoid : grid of geoid heights.
    frame : tangent, geocentric, geographic or a kind of `records.framed.KINDS` where no CRS is
        named; None for the format's own.
    ground_m : height of the ground, from which heights in a projected CRS are scaled.
    """

    crs: str | None = None
    geoid: Path | None = None
    frame: str | None = None
    ground_m: float | None = None

    def __post_init__(self) -> None:
        if self.frame == "tangent":
            object.__setattr__(self, "frame", TANGENT)
        if self.crs is not None and self.frame not in (None, PROJECTED):
            raise UsageError(f"frame {self.frame!r} has no CRS to choose; leave one of them out")
        if self.crs is None and self.geoid is not None and self.frame == PROJECTED:
            raise UsageError("a projected frame needs its CRS, such as EPSG:2056")


@dataclass(frozen=True)
class Exported:
    """What was written, and what its reader must know: one sentence each.

    `files` are the export and the table of both names, where images are called otherwise in it;
    `helpers` are those by which the program reads it.
    """

    file: Path
    frame: str
    notes: tuple[str, ...]
    files: tuple[Path, ...] = ()
    helpers: tuple[Path, ...] = ()
    format: str = ""

    def summary(self) -> str:
        """Return the files, one a line, and the notes."""
        return "\n".join([*map(str, self.all_files), *(f"note: {note}" for note in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        files = list(self.all_files)
        return {"format": self.format, "file": files[0], "files": files, "notes": list(self.notes)}

    @property
    def all_files(self) -> tuple[Path, ...]:
        """All that was written, the export first."""
        return (*(self.files or (self.file,)), *self.helpers)


def known_format(name: str) -> Export:
    """The registered format of that name; UsageError that names the nearest."""
    if name not in EXPORTS:
        raise UsageError(f"export: format {name!r} is unknown; {near(name, EXPORTS)}")
    return EXPORTS[name]


def export(
    eo: ExteriorOrientation,
    name: str,
    path: Path,
    target: ExportFrame | None = None,
    rename: Sequence[str | Path] = (),
    **options: Any,
) -> Exported:
    """Write `eo` as format `name` to `path`, a directory where the format has several files.

    Scripts and descriptions by which the program reads it go beside it, where the format has some;
    those of an earlier export to `path` that do not belong to this one are removed.

    Parameters
    ----------
    rename : rules of `rename_images`, by which images are called otherwise in the export; the table
        of both names goes beside it.
    options : of the format. Raises UsageError for an unknown format, an option that it does not
        take, a frame that it cannot carry and heights that it needs and does not get; InputError
        where a CRS does not reach the flight.
    """
    known_format(name)
    with together() as staging:
        eo, names = rename_images(eo, rename if name not in OF_IMAGES else ())
        with _remedy():
            exported = _export(eo, name, path, target or ExportFrame(), options)
        remove_stale(path, staging)
        if not names:
            return exported
        table = path.with_name(f"{path.stem}_names.csv")
        write_names(names, table)
    old, new = next(iter(names.items()))
    note = (
        f"{len(names)} of {len(eo.images)} images have another name in this export, such as "
        f"{new!r} for {old!r}; rename the image files accordingly ({table.name} lists all)"
    )
    return replace(exported, notes=(note, *exported.notes), files=(exported.file, table))


@contextmanager
def _remedy() -> Iterator[None]:
    """Say of a name that does not fit how to export all the same."""
    try:
        yield
    except UnfitName as error:
        raise InputError(
            f"{error} itself, or only in the export with --rename (output.rename)"
        ) from None


def refuse_names(images: Sequence[str], names: Sequence[str], rename: Sequence[str | Path]) -> None:
    """Refuse names of images that one of the formats `names` cannot hold, before any work.

    Raises
    ------
    InputError
        The first such name; UsageError for a rule that is none.
    """
    separators = {EXPORTS[name].separator for name in names} - {""}
    for separator in sorted(separators):
        with _remedy():
            check_names(other_names(images, rename), None if separator == " " else separator)


def _export(
    eo: ExteriorOrientation, name: str, path: Path, target: ExportFrame, options: dict[str, Any]
) -> Exported:
    """Write `eo` as format `name` in the target frame; refuse options that do not fit it."""
    form = EXPORTS[name]
    _refuse_unfit(eo, name, form, options)
    if form.frames == ():
        if target != ExportFrame():
            raise UsageError(
                f"export: {name} has its own frame; leave CRS, geoid, frame and ground out"
            )
        control = _relative(name, in_frame(eo, TANGENT), eo, options) if options else None
        form.write(eo, path, relative=control)
        return Exported(path, "tangent plane", (), format=name)
    notes = []
    if target.crs is not None and is_globe(target.crs):
        if eo.datum is None:
            notes.append(
                "the datum of the positions is not stated (gnss.datum): WGS 84 is assumed for "
                f"{target.crs}, which may be wrong by some metres"
            )
        eo, target = in_datum(eo, target.crs), replace(target, crs=None, frame=GEOGRAPHIC)
    kind = _kind(name, form, target)
    projection = None
    if kind == PROJECTED:
        crs = str(target.crs)
        projection = MapProjection(crs, target.geoid, eo.datum, eo.epoch, form.any_unit)
    above_ground = bool(form.without_geoid) and options.get("altitude", "absolute") != "absolute"
    if "sea level" in (form.heights, options.get("heights")) and not above_ground:
        options = options | {"undulation_m": _undulation(eo, name, target)}
    elif projection is None and target.geoid is not None:
        raise UsageError(
            f"export: {name} in a frame of kind {kind} takes heights above the ellipsoid; leave the"
            " geoid out or name a CRS"
        )
    framed = form.in_own_frame(in_frame(eo, kind, projection, target.ground_m))
    if form.relative:
        notes += form.write(_relative(name, framed, eo, options), path) or ()
    else:
        notes += form.write(framed, path, **options) or ()
    scripts = form.helpers(framed, path)
    if scripts:
        atomic_writes(scripts)
    notes += _notes(form, projection, framed, eo, target, "length_unit" in options)
    return Exported(path, framed.frame.name, tuple(notes), helpers=tuple(scripts), format=name)


def _refuse_unfit(
    eo: ExteriorOrientation, name: str, form: Export, options: Mapping[str, Any]
) -> None:
    """Refuse images without or with shared names, and options that the format does not take."""
    if not eo.images:
        raise InputError(
            f"export: {name}: there are no images; process a flight with camera events"
        )
    if doubles := [image for image, count in Counter(eo.images).items() if count > 1]:
        raise InputError(
            f"export: {name}: image {doubles[0]!r} occurs {eo.images.count(doubles[0])} times; "
            "give every image its own name"
        )
    if unknown := [key for key in options if key not in form.options]:
        takes = f"it takes {', '.join(form.options)}" if form.options else "it takes none"
        raise UsageError(f"export: {name} has no option {unknown[0]!r}; {takes}")
    if eo.rig is not None and (single := [key for key in options if key in form.of_one_camera]):
        raise UsageError(
            f"export: {name}: {single[0]} holds for one camera, but the orientation has "
            f"{', '.join(eo.rig.names)}; export each camera alone (--camera NAME, "
            "eo.of_camera(NAME) in Python)"
        )


def on_area(projection: MapProjection, lat: Array, lon: Array) -> Iterator[str]:
    """What to know of a CRS that is made for another area than that of n images.

    Parameters
    ----------
    projection : the CRS.
    lat, lon : (n,) geodetic latitude and longitude, rad.
    """
    outside = projection.outside(lat, lon)
    if outside:
        yield (
            f"{outside} of {lat.size} images lie outside of the area of {projection.name} "
            f"({projection.horizontal.area_of_use.name}); check the CRS"
        )


def _relative(
    name: str, framed: FramedOrientation, eo: ExteriorOrientation, options: dict[str, Any]
) -> RelativeControl:
    """Relative control by the options noise, form and gap_s.

    noise is a noise model's name, path, or itself.
    """
    noise = options.pop("noise", None)
    if noise is None:
        raise UsageError(
            f"export: {name} needs the noise of the gyroscopes for its weights; name the IMU's "
            "noise model, such as --set noise=navchip"
        )
    return relative_of(framed, eo, noise, **options)


def relative_of(
    framed: FramedOrientation,
    eo: ExteriorOrientation,
    noise: str | os.PathLike[str] | NoiseModel,
    **how: Any,
) -> RelativeControl:
    """Relative control of `eo` in its frame, weighed by the gyroscopes of a noise model besides;
    how : of `relative_control`.
    """
    model = load_noise_model(noise)
    length = float(eo.time[-1] - eo.time[0])
    wandering = [
        [gm.sigma for gm in axis.gauss_markov if gm.correlation_time_s < length]
        for axis in model.gyro
    ]
    longest = max(map(len, wandering))
    figures = gyro_figures(
        np.array([axis.white_noise for axis in model.gyro]),
        np.array([row + [0.0] * (longest - len(row)) for row in wandering]),
    )
    return relative_control(framed, figures, **how)


def _kind(name: str, form: Export, target: ExportFrame) -> str:
    usual = next((kind for kind in form.frames if kind != PROJECTED), PROJECTED)
    kind = PROJECTED if target.crs is not None else target.frame or usual
    if kind not in FRAME_KINDS:
        raise UsageError(
            f"export: frame {kind!r} is unknown; it is one of {', '.join(FRAME_KINDS)}"
        )
    if kind not in form.frames:
        raise UsageError(
            f"export: {name} cannot carry a frame of kind {kind}; it carries"
            f" {', '.join(form.frames)}"
        )
    if kind == PROJECTED and target.crs is None:
        raise UsageError(f"export: {name} needs a projected CRS; name it, such as EPSG:2056")
    return kind


def _undulation(eo: ExteriorOrientation, name: str, target: ExportFrame) -> Any:
    """Height (n,) m of the geoid above the ellipsoid at the images."""
    if target.geoid is None:
        raise UsageError(
            f"export: {name} has heights above sea level; name a grid of geoid heights (--geoid"
            f" GRID, output.geoid){EXPORTS[name].without_geoid}"
        )
    return undulation(target.geoid, *in_frame(eo, GEOGRAPHIC).geodetic[:, :2].T)


def _notes(
    form: Export,
    projection: MapProjection | None,
    framed: FramedOrientation,
    eo: ExteriorOrientation,
    target: ExportFrame,
    units_chosen: bool,
) -> Iterator[str]:
    """What to know of the frame, of its units, and of how the datum was reached."""
    if projection is None:
        if form.frames[0] == PROJECTED and target.frame is None:
            yield f"coordinates are those of the {framed.frame.name}, since no CRS is named (--crs)"
        if eo.datum is not None:
            in_epoch = "" if eo.epoch is None else f", epoch {eo.epoch:g}"
            yield f"coordinates are of the datum of the positions, {eo.datum}{in_epoch}"
        return
    yield from on_area(projection, *framed.geodetic[:, :2].T)
    if projection.units != (METRE, METRE) and not units_chosen:
        plan, height = (unit.plural for unit in projection.units)
        units = plan if plan == height else f"{plan}, heights in {height}"
        yield (f"coordinates in {projection.name} and their standard deviations are in {units}")
    operation, accuracy = projection.operation()
    costs_nothing = 0.0 <= accuracy <= SAME_M and projection.shift_m(*framed.geodetic.T) < NULL_M
    if (accuracy < 0.0 or accuracy > ACCURATE_M) and not costs_nothing:
        how = "unknown accuracy" if accuracy < 0.0 else f"an accuracy of {accuracy:g} m"
        yield (
            f"datum of {projection.name}: reached by {operation}, of {how}; control points in "
            "that CRS may be off by as much; name the datum of the base's coordinates (gnss.datum)"
        )
    if projection.northing_first and not form.crs_order:
        yield (
            f"the file has easting before northing, unlike {projection.name}; check the order "
            "when importing"
        )
    if not projection.crs.is_compound and projection.geoid is None:
        yield f"heights are {projection.heights}, not above sea level"
    if framed.frame.scaled_from_m is None:
        yield (
            "heights are true heights, not multiplied by the map scale factor, as tools with "
            "control points expect; --ground (ground_m in Python) scales heights"
        )
