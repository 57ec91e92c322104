"""The verb `export`: its options and what it does with them."""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..base.errors import UsageError
from ..base.output.staging import together
from ..base.wording import spoken_as
from ..flight.config.command_line import names_of
from ..io.options.camera_options import ImageMatch
from ..io.options.kinds import Checked
from ..io.options.schema import Triple, argument
from .console import Progress
from .verb import Result, Verb

if TYPE_CHECKING:
    from ..flight.exporting.export import Exported

EXAMPLE = """  insgnss export 02_Processed/GPS-INS/eo.json metashape --out metashape.csv
  insgnss export eo.json pix4d_matic --crs EPSG:2056 --geoid ch_chgeo2004.gtx
  insgnss export eo.json generic_ascii --set columns=image,x,y,z,omega,phi,kappa --set unit=gon
  insgnss export eo.json colmap --set camera="PINHOLE 5120 3840 5607 5607 2560 1920" --rename safe
  insgnss export DJI_202411_Timestamp.MRK metashape --images photos
  insgnss export photos.csv pix4d_matic --fixes antenna.pos --time-scale utc+02:00
  insgnss export navchip kalibr --set rate=200 --set cluster=10 --out imu.yaml
  insgnss export --proof metashape proof_scene"""


NOISE_SETTINGS = {"rate": "rate_hz", "cluster": "cluster_s", "topic": "topic"}


@dataclass(frozen=True)
class ExportRequest(Checked):
    """Options of the verb."""

    eo: Path = argument(
        ...,
        "the eo.json of a processed flight or its directory; positions without an IMU, for "
        "metashape, pix4d_matic, pix4d_mapper, odm, realitycapture_accuracy, generic_ascii and "
        "geojson: .MRK, _events.pos, camera_positions.csv, references of Metashape or Pix4D, any "
        "events with --fixes; or a noise model by name or file (with --proof: a format below)",
        cli="EO",
    )
    format: str = argument(
        ..., "one of the formats below (with --proof: the directory of the scene)", cli="FORMAT"
    )
    out: Path | None = argument(
        None,
        "file to write (default: the format's usual name beside EO); a new directory if the format"
        " has several files. Without --force, no table of process in another CRS or frame is"
        " replaced, nor an existing FILE that would differ",
    )
    camera: str | None = argument(
        None,
        "export only the images of this camera of a rig; its name is part of the default file name",
    )
    crs: str | None = argument(
        None,
        "projected CRS, such as EPSG:2056 or EPSG:25832+7837 (with heights), as WKT, or the path"
        " of a WKT file; or the datum of geographic coordinates, such as EPSG:6319",
        metavar="CRS",
    )
    geoid: Path | None = argument(
        None, "grid of geoid heights, for heights above sea level", metavar="GRID"
    )
    frame: Literal["tangent", "geocentric", "geographic"] | None = argument(
        None, "tangent, geocentric or geographic axes", usual="what the format takes first"
    )
    ground: float | None = argument(
        None,
        "height of the ground; heights above ground are multiplied by the map scale factor, like"
        " distances",
        metavar="M",
    )
    settings: tuple[str, ...] = argument(
        (), "an option of the format; repeat it", cli="--set", repeated=True, metavar="KEY=VALUE"
    )
    rename: tuple[str, ...] = argument(
        (),
        "new image names in this export: OLD=NEW, a CSV table of old,new, safe (only letters,"
        " digits and . _ -) or basename (without folders); the option can be repeated; a table of"
        " old and new names is written beside the export",
        repeated=True,
        metavar="RULE",
    )
    fixes: Path | None = argument(
        None,
        "antenna positions (.pos, NMEA, text), interpolated to the exposures of EO",
        metavar="FILE",
    )
    time_scale: str | None = argument(
        None, "time scale of exposures given as dates: utc, gpst, utc+02:00", metavar="SCALE"
    )
    camera_delay: float = argument(0.0, "time from the stamps of EO to mid-exposure", unit="s")
    moved_base: tuple[Triple, Triple] | None = argument(
        None,
        "base position used for EO and the correct base position, each LAT,LON,H; all positions"
        " are shifted by the difference",
        kind="moved",
        metavar="OLD NEW",
    )
    base_sigma: Triple = argument(
        (0.0, 0.0, 0.0),
        "standard deviations (north, east, down) of the correct base position, an error common to"
        " all images",
        unit="m",
        low=0.0,
        high=100.0,
        needs=("moved_base",),
        metavar="M M M",
    )
    force: bool = argument(
        False,
        "overwrite a table that process wrote in another frame, or an existing --out that differs",
    )
    proof: bool = argument(
        False,
        "write a synthetic scene in FORMAT into DIR, to try the import in the program of FORMAT",
    )


def noise_verb(arguments: argparse.Namespace, progress: Callable[[str], None]) -> "Exported":
    """Write a noise model as another estimator reads it.

    Raises
    ------
    UsageError
        For options that have no meaning with it, and values that cannot be.
    """
    from ..base.files import atomic_write
    from ..flight.exporting.export import Exported
    from ..navigation.noise_model.model import load_noise_model
    from ..noise.processes.consumers import CONSUMER_FORMS, text_for

    if any(
        x is not None for x in (arguments.crs, arguments.geoid, arguments.frame, arguments.ground)
    ):
        of_poses = "--crs, --geoid, --frame and --ground"
        raise UsageError(f"export: {of_poses} have no effect on a noise model; leave them out")
    _refuse_camera(arguments, "for noise")
    settings = _settings(arguments.settings)
    if unknown := [key for key in settings if key not in NOISE_SETTINGS]:
        raise UsageError(
            f"export: {arguments.format} takes no {unknown[0]}; it takes rate, cluster, topic"
        )
    options: dict[str, Any] = {}
    for key, name in NOISE_SETTINGS.items():
        if key in settings:
            options[name] = settings[key] if key == "topic" else _positive(key, settings[key])
    model = load_noise_model(str(arguments.eo))
    folder = arguments.eo.parent if arguments.eo.is_file() else Path()
    text = text_for(arguments.format, model, **options)

    kept = options.get("cluster_s", 10.0)
    note = (
        f"white noise and random walk have the model's Allan variance at {kept:g} s only; at other"
        " times it differs (data_specs/noise_exports.md)"
    )

    def write(out: Path) -> Exported:
        atomic_write(out, text)
        return Exported(out, "", (note,), format=arguments.format)

    return _write_export(arguments, folder / CONSUMER_FORMS[arguments.format][0], write, progress)


def _write_export(
    arguments: argparse.Namespace,
    product: Path,
    write: "Callable[[Path], Exported]",
    progress: Callable[[str], None],
) -> "Exported":
    """Write to --out, by default to `product`, unless that replaces what it must not."""
    from ..flight.exporting.replacing import refuse_replacing

    out = arguments.out or product
    if out.resolve() == arguments.eo.resolve():
        raise UsageError(
            f"export: {out} is the input orientation, which is never overwritten; give another"
            " file with --out"
        )
    progress(f"writing {out}")
    with together() as staging:
        exported = write(out)
        if not arguments.force:
            refuse_replacing(staging, out, arguments.out is not None, exported.frame)
    return exported


def _refuse_camera(arguments: argparse.Namespace, where: str) -> None:
    """Refuse to choose a camera where there is none."""
    if arguments.camera is not None:
        raise UsageError(f"export: --camera has no effect {where}; leave it out")


def _positive(key: str, text: str) -> float:
    """The number of a setting; UsageError for what is none."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < math.inf:
        raise UsageError(f"export: {key}={text}: a number greater than zero is expected")
    return value


def export_verb(arguments: argparse.Namespace, progress: Callable[[str], None]) -> "Exported":
    """Do what the parsed command line asks for."""
    from ..noise.processes.consumers import CONSUMER_FORMS

    if arguments.format in CONSUMER_FORMS:
        return noise_verb(arguments, progress)
    if arguments.eo.is_dir():
        arguments.eo = _master_of(arguments.eo)
    if arguments.eo.suffix.lower() != ".json":
        return _positions_verb(arguments, progress)
    _refuse_of_positions(arguments)
    from ..flight.exporting.export import ExportFrame, export, known_format
    from ..flight.exporting.options import typed_options

    export_format = known_format(arguments.format)
    options = typed_options(arguments.format, export_format, _settings(arguments.settings))
    target = ExportFrame(arguments.crs, arguments.geoid, arguments.frame, arguments.ground)
    from ..io.formats.orientation.eo_json import read_eo_json

    product = arguments.eo.parent / export_format.product
    if arguments.camera is not None:
        product = product.with_name(f"{product.stem}_{arguments.camera}{product.suffix}")
    eo = read_eo_json(arguments.eo)
    _warn_of_changed_inputs(arguments.eo)
    if arguments.camera is not None:
        eo = eo.of_camera(arguments.camera)
    moved = _moved_base(arguments)
    eo = eo if moved is None else moved.orientation(eo)

    def write(out: Path) -> "Exported":
        return export(eo, arguments.format, out, target, arguments.rename, **options)

    exported = _write_export(arguments, product, write, progress)
    return exported if moved is None else replace(exported, notes=(*exported.notes, moved.sentence))


def _moved_base(request: argparse.Namespace) -> Any:
    """Return the `MovedBase` that is asked for, or None."""
    if request.moved_base is None:
        return None
    from ..navigation.prepare.moved_base import MovedBase

    old, new = request.moved_base
    return MovedBase(old, new, request.base_sigma)


def _warn_of_changed_inputs(eo: Path) -> None:
    """Warn where orientations are of inputs that have changed since, as after a run that failed."""
    import warnings

    from ..batch.season.archive import changed_since
    from ..flight.exporting.replacing import DOCUMENTS

    if changed := [name for document in DOCUMENTS for name in changed_since(eo.parent / document)]:
        warnings.warn(
            f"{', '.join(changed)} changed after {eo} was computed: the export has the former"
            " orientations; process the flight again, then export",
            stacklevel=2,
        )


def _master_of(directory: Path) -> Path:
    """Return the eo.json of a directory of products, or its camera positions."""
    from ..io.formats.positions.camera_positions import PRODUCT

    for name in ("eo.json", PRODUCT):
        if (directory / name).is_file():
            return directory / name
    raise UsageError(
        f"export: {directory} holds neither eo.json nor {PRODUCT}; give the output directory of"
        " process or ppk, or the file"
    )


def _refuse_of_positions(request: argparse.Namespace) -> None:
    """Refuse options of positions without an IMU where there are orientations."""
    for name in ("images", "skip_events", "fixes", "time_scale", "camera_delay"):
        if getattr(request, name):
            option = f"--{name.replace('_', '-')}"
            raise UsageError(
                f"export: {option} is only for positions without an IMU, but {request.eo} has"
                f" orientations; leave {option} out"
            )


def _read_positions(request: argparse.Namespace) -> tuple[Any, tuple[str, ...]]:
    """Return the positions of EO itself, or between fixes, and what to know of them."""
    from ..gnss.exposures.camera_positions import exposures_between
    from ..io.exposures.naming import named_positions
    from ..io.formats.positions.camera_positions import read_camera_positions
    from ..photogrammetry.comparison.of_records import positions_of
    from ..photogrammetry.comparison.reading import read_poses, sniff_poses

    path, match = request.eo, request.records[ImageMatch]
    if request.fixes is not None:
        return exposures_between(
            path, request.fixes, match, request.time_scale, request.camera_delay
        )
    if request.time_scale is not None or request.camera_delay:
        raise UsageError(
            f"export: --time-scale and --camera-delay cannot shift the positions of {path}; give"
            " the antenna positions by --fixes, or leave these options out"
        )
    if sniff_poses(path) == "camera_positions":
        return named_positions(read_camera_positions(path), match)
    poses = read_poses(path)
    positions, notes = named_positions(positions_of(poses), match)
    return positions, (*poses.notes, *notes)


def _positions_verb(arguments: argparse.Namespace, progress: Callable[[str], None]) -> "Exported":
    """Write camera positions without an IMU in a format that takes them without angles."""
    from ..flight.exporting.export import ExportFrame
    from ..flight.exporting.positions import export_positions, position_format

    export_format = position_format(arguments.format)
    _refuse_camera(arguments, "for camera positions")
    if arguments.settings:
        raise UsageError("export: --set has no effect on camera positions; leave it out")
    target = ExportFrame(arguments.crs, arguments.geoid, arguments.frame, arguments.ground)
    with spoken_as(names_of()):
        positions, notes = _read_positions(arguments)
    if (moved := _moved_base(arguments)) is not None:
        positions, notes = moved.positions(positions), (*notes, moved.sentence)

    def write(out: Path) -> "Exported":
        return export_positions(positions, arguments.format, out, target)

    exported = _write_export(
        arguments, arguments.eo.parent / export_format.product, write, progress
    )
    return replace(exported, notes=(*exported.notes, *notes))


def _settings(texts: Sequence[str]) -> dict[str, str]:
    """Options of the format as texts."""
    settings: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise UsageError(f"export: --set {text!r} is not KEY=VALUE, such as unit=gon")
        settings[key.strip()] = value.strip()
    return settings


def proof_verb(arguments: argparse.Namespace, progress: Callable[[str], None]) -> "Exported":
    """Write the synthetic scene of `--proof`, whose positional arguments are FORMAT and DIR.

    Raises
    ------
    UsageError
        For options that have no meaning with it.
    """
    from ..flight.exporting.export import Exported, known_format
    from ..flight.proof.write import write_proof

    name, directory = str(arguments.eo), Path(arguments.format)
    known_format(name)
    _refuse_camera(arguments, "with --proof")
    if arguments.out or arguments.settings or arguments.rename:
        raise UsageError(
            "export: --out, --set and --rename have no effect with --proof; the scene is written"
            " into DIR"
        )
    progress("writing the scene")
    files = write_proof(
        name, directory, arguments.crs, arguments.geoid, arguments.frame, arguments.ground
    )
    return Exported(files[0], "", (), tuple(files), format=name)


def _list_formats() -> str:
    """Print the formats that `export` writes, with what each is for."""
    from ..io.formats import EXPORTS

    width = max(map(len, EXPORTS))
    lines = []
    for name, form in EXPORTS.items():
        takes = f" (--set {', '.join(form.options)})" if form.options else ""
        lines.append(f"  {name:{width}}  {form.what}{takes}\n")
    from ..noise.processes.consumers import CONSUMER_FORMS

    takes = "(--set rate, cluster, topic)"
    noise = [f"  {name:{width}}  {form[1]} {takes}\n" for name, form in CONSUMER_FORMS.items()]
    return "formats:\n" + "".join(lines) + "of a noise model:\n" + "".join(noise)


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    verb = proof_verb if options.proof else export_verb
    return verb(options, progress)


VERB = Verb("export", EXAMPLE, (ExportRequest, ImageMatch), run, more_help=_list_formats)
