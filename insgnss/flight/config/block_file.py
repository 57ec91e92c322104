"""The block file (block.toml): what `insgnss adjust` reads, estimates and writes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ...base.errors import InputError, OptionError
from ...base.inputs import is_file
from ...base.received.trusted import at_home
from ...io.options.kinds import Checked
from ...io.options.schema import columns_of_file, option
from .block_tables.aerial_control import AerialControlTable
from .block_tables.vehicle import VehicleTable
from .flight_file import resolve_options

if TYPE_CHECKING:
    from ...base.tables import Columns

INTERIOR_NAMES = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2")
"""Those of `records.block.INTERIOR`, which asks for numpy."""
OBSERVATION_GROUPS = (
    *("image observations", "ground control", "aerial control"),
    *("kinematic ground control", "target sizes", "distances"),
)
"""Groups of observations of an adjustment."""
CAMERA_FORMATS = ("toml", "metashape", "colmap", "opencv")
ADJUSTED_DIRECTORY = "adjusted"
Mode = Literal["iso", "indirect", "fast_at", "direct"]
Datum = Literal["control", "minimal", "images", "points"]


@dataclass(frozen=True)
class ImagesInput(Checked, table="images"):
    """Table [images]: what was measured in the images, and the images as their program has them."""

    file: Path | None = option(
        None,
        "image observations: a table (image_points.md), or a project of a photogrammetry program",
        kind="existing",
        form="file or directory",
        cli="--images",
        cli_meaning="image observations: a table, or a project of a photogrammetry program",
    )
    format: str = option(
        "auto",
        "format of the image observations, such as metashape, colmap, opensfm, bingo; auto: "
        "recognised by name and first bytes",
        cli="--images-format",
    )
    sigma_px: float | None = option(
        None,
        "standard deviation of image coordinates for which the file states none",
        unit="px",
        low=1e-6,
        high=1000.0,
        usual="that of the file, or 1",
        cli="--sigma-px",
    )
    columns: "Columns" = columns_of_file(
        'columns of a table: list of names, or table { canonical = "name in the file" }'
    )
    skip: tuple[str, ...] = option((), "names of images that are left out", cli="--skip-images")


@dataclass(frozen=True)
class CameraTable(Checked, table="camera"):
    """Table [camera]: the camera of all images, where the project has none or a worse one."""

    file: Path | None = option(
        None, "camera (camera_toml.md) of all images", usual="those of the project", cli="--camera"
    )
    free: tuple[str, ...] | None = option(
        None,
        f"parameters of interior orientation that are estimated, out of {' '.join(INTERIOR_NAMES)}",
        kind="texts",
        choices=INTERIOR_NAMES,
        usual="those of the camera file; of a project f, cx, cy and those not zero",
        cli="--free",
    )
    weighed: bool = option(
        False,
        "use the camera file's values and standard deviations as observations of the estimated "
        "parameters; wrong if they were adjusted from the same images",
        needs=("file",),
    )
    new_from: tuple[str, ...] = option(
        (),
        "names of the images at which a new set of camera parameters begins, because the camera "
        "was knocked, refocused or exchanged; images count in the order of the aerial control, "
        "without it of the image observations",
        kind="texts",
        cli="--camera-new-from",
    )
    readout_s: float | None = option(
        None,
        "readout time of a rolling shutter, from the upper edge of an image to the lower; "
        "negative if the sensor is read upwards",
        unit="s",
        low=-1.0,
        high=1.0,
        usual="all rows are exposed at once",
        cli="--readout",
    )


@dataclass(frozen=True)
class GroundTableInput(Checked, table="ground"):
    """Table [ground]: points with known coordinates."""

    file: Path | None = option(
        None,
        "ground control and check points: a table (ground_points.md), or a program's file",
        usual="those of the project",
        cli="--ground",
    )
    crs: str | None = option(
        None,
        "CRS of the ground points, such as EPSG:2056+5728 (with heights), or the origin of a "
        'tangent plane, such as "origin 46.57 6.54 deg 0 m"; default: the tangent plane of eo.json',
        usual="CRS of the file, or the tangent plane of eo.json",
        cli="--crs",
        metavar="CRS",
    )
    geoid: Path | None = option(
        None,
        "grid of geoid heights, needed for heights above sea level",
        needs=("crs",),
        cli="--geoid",
        metavar="GRID",
    )
    columns: "Columns" = columns_of_file("of a table, as images.columns")
    check: tuple[str, ...] = option(
        (),
        "names of check points, which are not used as control even if the file says so",
        cli="--check",
    )
    skip: tuple[str, ...] = option((), "names of points that are left out")
    distances: Path | None = option(
        None,
        "table of distances between points (scale bars), m: columns from to distance sigma",
        cli="--distances",
    )


@dataclass(frozen=True)
class AdjustmentTable(Checked, table="adjustment"):
    """Table [adjustment]: what takes part, how observations are weighed and judged."""

    mode: Mode = option(
        "iso",
        '"iso": integrated sensor orientation with all observations; "indirect": without aerial '
        'control; "fast_at": with aerial control and image observations of ground points alone, '
        'camera fixed; "direct": poses and camera fixed, points intersected, ground control used '
        "as check points",
        cli="--mode",
    )
    datum: Datum = option(
        "control",
        'datum of the block: "control": aerial or ground control, or the poses fixed by a DBAT '
        'script; "minimal": the first image and one coordinate of the image farthest from it, '
        'fixed as in the project; "images", "points": free network, in which the projection '
        "centres or object points keep the mean position of their initial values",
        cli="--datum",
    )
    reweight: tuple[str, ...] = option(
        ("image observations",),
        "groups of observations whose variances are multiplied by estimated variance components: "
        "image observations (except in mode fast_at), ground control, aerial control, kinematic "
        "ground control, target sizes, distances; for other groups a contradicting component is "
        'only reported; "none": no group',
        choices=(*OBSERVATION_GROUPS, "none"),
        cli="--reweight",
    )
    limit_w: float = option(
        4.0, "largest standardised residual of an image observation", low=2.0, high=100.0
    )
    keep_all: bool = option(
        False, "no observation is rejected, whatever its residual", cli="--keep-all"
    )
    write_anyway: bool = option(
        False,
        "write the orientation into contradicted/ if the observations contradict it; exit code 4 "
        "stays",
        cli="--write-anyway",
    )
    accept: tuple[str, ...] = option(
        (),
        "groups of observations whose contradiction is accepted: image observations, ground "
        "control, aerial control, kinematic ground control, target sizes, check points; otherwise "
        "no orientation is written if residuals exceed five times what their standard deviations "
        "allow, or if their cause moves a projection centre by five of its standard deviations",
        choices=(*OBSERVATION_GROUPS, "check points"),
    )


@dataclass(frozen=True)
class PlanTable(Checked, table="plan"):
    """Table [plan]: what `insgnss adjust --plan` supposes of a block that is not measured yet."""

    tie_points: float = option(52.0, "tie points for each image", low=1.0, high=1e5)
    matched: float = option(
        0.6,
        "share of the images that see a tie point in which the point is measured",
        low=0.05,
        high=1.0,
    )
    ground_m: float | None = option(
        None,
        "height of the ground in the tangent plane",
        unit="m",
        usual="that of the ground points",
        cli="--ground-height",
    )


@dataclass(frozen=True)
class BlockOutput(Checked, table="output"):
    """Table [output]: where the products go, and what else is written."""

    directory: Path = option(
        Path(ADJUSTED_DIRECTORY),
        "directory of the products, in or below that of the block file (elsewhere: `--out`), "
        "created if missing",
        kind="directory",
        form="directory",
        usual=f'"{ADJUSTED_DIRECTORY}"',
    )
    formats: tuple[str, ...] = option(
        ("eo_local_plane",),
        "export formats of the adjusted orientation, as output.formats of a flight",
        kind="formats",
        form="list of texts",
    )
    cameras: tuple[str, ...] = option(
        CAMERA_FORMATS[:2],
        f"formats of the adjusted cameras, of {' '.join(CAMERA_FORMATS)}",
        choices=CAMERA_FORMATS,
    )
    pose_covariance: bool = option(
        False,
        "write the full covariance of all poses, poses_covariance.npz (288 bytes times the square "
        "of the number of images), for `insgnss calibrate mounting` with poses.csv",
        cli="--pose-covariance",
    )
    tables: bool = option(
        False,
        "write all object points with covariances (points.csv) and all residuals of image "
        "observations (residuals.csv)",
        cli="--tables",
    )


@dataclass(frozen=True)
class BlockFile(Checked):
    """A block file, complete: every option has a value, every file that it names is there.

    Raises
    ------
    OptionError
        For a value that cannot be.
    """

    path: Path = field(kw_only=True)
    name: str = option("", "name of the block", usual="name of the directory")
    images: ImagesInput = field(default_factory=ImagesInput)
    camera: CameraTable = field(default_factory=CameraTable)
    aerial_control: AerialControlTable = field(default_factory=AerialControlTable)
    ground: GroundTableInput = field(default_factory=GroundTableInput)
    vehicle: VehicleTable = field(default_factory=VehicleTable)
    adjustment: AdjustmentTable = field(default_factory=AdjustmentTable)
    plan: PlanTable = field(default_factory=PlanTable)
    output: BlockOutput = field(default_factory=BlockOutput)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._refuse_other_modes()

    def _refuse_other_modes(self) -> None:
        """Refuse options that the mode has no use for."""
        mode, control = self.adjustment.mode, self.aerial_control
        if self.camera.new_from and (mode in ("fast_at", "direct") or self.camera.weighed):
            setting = "camera.weighed" if self.camera.weighed else f'mode "{mode}"'
            raise OptionError(
                "camera.new_from",
                f"begins newly estimated cameras within the flight, but {setting} fixes one "
                "camera for all images; leave one of them out",
            )
        if mode == "indirect" and (control.control != "Ap/Aa" or control.lines):
            raise OptionError(
                "aerial_control.control",
                'has no meaning in mode "indirect", which uses no aerial control; leave one out',
            )
        if mode in ("fast_at", "direct"):
            if control.file is None:
                raise OptionError(
                    "adjustment.mode", f'"{mode}" needs aerial control; give its eo.json'
                )
            if self.camera.free:
                raise OptionError(
                    "camera.free", f'the camera is fixed in mode "{mode}"; leave this key out'
                )
            lines = {control.control, *control.of_lines.values()}
            usable = ("Ap/Aa", "Ap/Ra", "Rp/Ra") if mode == "fast_at" else ("Ap/Aa",)
            if unusable := lines.difference(usable):
                raise OptionError(
                    "aerial_control.control",
                    f'"{min(unusable)}" does not orient images in mode "{mode}"; use '
                    f"{', '.join(usable)}",
                )

    def resolved(self) -> dict[str, Any]:
        """Every value with its default filled in, as plain JSON types."""
        return resolve_options(self)


BLOCK_TABLES: Mapping[str, tuple[type, ...]] = {"": (BlockFile,)} | {
    table.name: (table.type,)
    for table in fields(BlockFile)
    if isinstance(table.type, type) and issubclass(table.type, Checked)
}
"""The dataclasses whose options are the keys of each table."""


@at_home
def load_block(path: str | Path) -> BlockFile:
    """Read and check a block file.

    Parameters
    ----------
    path : str or Path
        The file, or the directory that holds its `block.toml`.

    Returns
    -------
    BlockFile
        Complete: every option has a value, every file that it names is there.

    Raises
    ------
    InputError
        The file is missing or no TOML, or a key, a value or a file it names is wrong.
    """
    from ...base.tables import read_toml
    from .values import directory_of, known_keys, record_of, take

    path = Path(path)
    if path.is_dir():
        path = path / "block.toml"
    if not is_file(path):
        raise InputError.in_file(
            path, "does not exist; give a block file, or eo.json with --images and --ground"
        )
    root = read_toml(path, known_keys(BLOCK_TABLES))
    root.check_keys()
    control = root.table("aerial_control")
    if not control.resolve(str(control.text("file", "."))).exists():
        problem = f"{control.text('file')} does not exist; run insgnss process on the flight first"
        raise control.error("file", problem)
    tables: dict[str, Any] = {
        name: record_of(root.table(name), kind) for name, (kind,) in BLOCK_TABLES.items() if name
    }
    output = tables["output"]
    directory = directory_of(root.table("output"), output.directory)
    tables["output"] = replace(output, directory=directory)
    options = take(root, BlockFile)
    options["name"] = options["name"] or path.absolute().parent.name
    return BlockFile(path=path, **options, **tables)
