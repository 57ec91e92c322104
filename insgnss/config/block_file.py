"""The block file (block.toml): what `insgnss adjust` reads, estimates and writes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..base.errors import InputError, OptionError, near
from .flight_file import resolved
from .schema import Triple, check, option, options_of

if TYPE_CHECKING:
    from ..base.tables import Columns

PARAMETERS = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2")
"""Those of `records.block.INTERIOR`, which asks for numpy."""
CAMERA_FORMATS = ("toml", "metashape", "colmap", "opencv")
DIRECTORY = "adjusted"
CONTROLS = ("Ap/Aa", "Ap/Ra", "Rp/Ra", "Ap", "Rp")
"""A absolute, R relative, p position, a attitude."""


@dataclass(frozen=True)
class ImagesInput:
    """Table [images]: what was measured in the images, and the images as their program has them."""

    file: Path | None = option(
        None,
        "image observations: a table (image_points.md), or a project of a photogrammetry program",
        kind="existing",
        form="file or directory",
        cli="--images",
        metavar="FILE",
        cli_meaning="image observations: a table, or a project of a photogrammetry program",
    )
    format: str = option(
        "auto",
        "format of the file, such as metashape, colmap, opensfm, bingo; auto: as its name and first"
        " bytes say",
        cli="--images-format",
        metavar="NAME",
    )
    sigma_px: float | None = option(
        None,
        "standard deviation of image coordinates that have none of their own",
        unit="px",
        low=1e-6,
        high=1000.0,
        usual="that of the file, or 1",
        cli="--sigma-px",
        metavar="PX",
    )
    columns: "Columns" = option(
        None,
        'of a table: list of names, or table { canonical = "name in the file" }',
        kind="columns",
        usual="by header or order",
    )
    skip: tuple[str, ...] = option(
        (), "names of images that are left out", cli="--skip-images", metavar="NAME"
    )

    def __post_init__(self) -> None:
        check(self, "images")


@dataclass(frozen=True)
class CameraTable:
    """Table [camera]: the camera of all images, where the project has none or a worse one."""

    file: Path | None = option(
        None,
        "camera (camera_toml.md) of all images",
        usual="those of the project",
        cli="--camera",
        metavar="FILE",
    )
    free: tuple[str, ...] | None = option(
        None,
        f"parameters of interior orientation that are estimated, of {' '.join(PARAMETERS)}",
        kind="texts",
        usual="those of the camera's file; of a project f, cx, cy and what is not zero",
        cli="--free",
        metavar="NAME",
    )
    weighed: bool = option(
        False,
        "the standard deviations of the camera's file are observations of what is estimated of it;"
        " not those of an adjustment of the same images",
    )

    def __post_init__(self) -> None:
        check(self, "camera")
        if self.weighed and self.file is None:
            raise OptionError("camera.weighed", "has no meaning without camera.file; give both")
        for name in self.free or ():
            if name not in PARAMETERS:
                raise OptionError("camera.free", f"{name!r} is unknown; {near(name, PARAMETERS)}")


@dataclass(frozen=True)
class AerialControlTable:
    """Table [aerial_control]: poses of the images by GNSS and IMU, and what stands between."""

    file: Path | None = option(
        None, "eo.json of a processed flight; without it the block has no aerial control"
    )
    covariance: Literal["auto", "strip", "chain", "image"] = option(
        "auto",
        'which covariances weigh the poses: "strip": of whole flight lines, eo_covariance.npz '
        'beside the file; "chain": of neighbours, which makes what is common to a line too small; '
        '"image": of each image alone; "auto": the first of these that is there',
    )
    control: Literal["Ap/Aa", "Ap/Ra", "Rp/Ra", "Ap", "Rp"] = option(
        "Ap/Aa",
        "what is observed of the poses, absolute (A) or relative to the neighbour in the flight "
        "line (R): position (p) and attitude (a). Relative attitudes ask for no bore-sight, "
        "relative positions for no datum of the fixes",
        cli="--control",
    )
    lines: tuple[str, ...] = option(
        (),
        "flight lines with another control: name of one of its images and the control, such as "
        '"IMG_0010 Rp/Ra"',
    )
    relative_weights: Literal["smoothed", "independent", "gyro"] = option(
        "smoothed",
        'what weighs relative control: "smoothed": the covariance of all poses of the line; '
        '"independent": each pair as of independent images (paper 003, equation 5); "gyro": the '
        "same for positions, and for attitudes noise and drift of the gyroscopes (equation 6)",
        cli="--relative-weights",
    )
    gap_s: float = option(
        10.0,
        "longest time between two images of which one is observed relative to the other",
        unit="s",
        low=0.01,
        high=3600.0,
    )
    gyro_noise_deg_rts: float = option(
        0.005,
        "white noise of the gyroscopes, omega_RW of equation 6 of paper 003",
        unit="deg/sqrt(s)",
        low=1e-9,
        high=10.0,
    )
    gyro_drift_degps: float = option(
        0.003,
        "drift that is left of the gyroscopes, omega_b of equation 6",
        unit="deg/s",
        low=0.0,
        high=10.0,
    )
    gyro_vertical: float = option(
        1.5, "by which the drift about the vertical is larger, k of paper 003", low=0.01, high=100.0
    )
    datum_sigma_m: float = option(
        5.0,
        "standard deviation of the position of one image of each line of relative positions",
        unit="m",
        low=1e-3,
        high=1e6,
    )
    datum_sigma_deg: float = option(
        2.0,
        "the same of the attitude of one image of each line of relative attitudes",
        unit="deg",
        low=1e-3,
        high=180.0,
    )
    boresight_sigma_deg: float = option(
        1.0,
        "standard deviation of what is left of the bore-sight about each axis, which is estimated; "
        "0: it is as the flight file has it",
        unit="deg",
        low=0.0,
        high=180.0,
        cli="--boresight-sigma",
        metavar="DEG",
    )
    lever_arm_sigma_m: Triple | None = option(
        None,
        "standard deviations of what is left of the lever arm, camera x, y, z, which is estimated",
        unit="m",
        kind="sigmas",
        usual="it is as the flight file has it",
    )
    time_offset_sigma_s: float = option(
        0.0,
        "standard deviation of the delay of the exposures behind their stamps, which is estimated; "
        "0: there is none",
        unit="s",
        low=0.0,
        high=10.0,
        cli="--delay-sigma",
        metavar="S",
    )
    shift_sigma_m: Triple | None = option(
        None,
        "standard deviations of a shift of each flight line, east, north, up, which is estimated",
        unit="m",
        kind="sigmas",
        usual="none",
    )
    drift_sigma_mps: Triple | None = option(
        None,
        "standard deviations of a drift of each flight line, which is estimated",
        unit="m/s",
        kind="sigmas",
        usual="none",
    )

    def __post_init__(self) -> None:
        check(self, "aerial_control")
        for text in self.lines:
            name, _, control = text.rpartition(" ")
            if not name.strip() or control not in CONTROLS:
                raise OptionError(
                    "aerial_control.lines",
                    f"{text!r}: name of an image and one of {' '.join(CONTROLS)}, such as"
                    ' "IMG_0010 Rp/Ra"',
                )

        relative = {"Ap/Ra", "Rp/Ra", "Rp"} & {self.control, *self.of_lines.values()}
        if self.relative_weights != "smoothed" and not relative:
            raise OptionError(
                "aerial_control.relative_weights",
                "has no meaning without relative control; ask for it by aerial_control.control,"
                ' such as "Ap/Ra"',
            )

    @property
    def of_lines(self) -> dict[str, str]:
        """Control of the flight lines that have another one, by the name of an image."""
        pairs = (text.rpartition(" ") for text in self.lines)
        return {name.strip(): control for name, _, control in pairs}

    @property
    def absolute_attitudes(self) -> bool:
        """Whether any line observes attitudes that the bore-sight turns."""
        return "Ap/Aa" in (self.control, *self.of_lines.values())


@dataclass(frozen=True)
class GroundTableInput:
    """Table [ground]: points with known coordinates."""

    file: Path | None = option(
        None,
        "ground control and check points: a table (ground_points.md), or a file of a program",
        usual="those of the project",
        cli="--ground",
        metavar="FILE",
    )
    crs: str | None = option(
        None,
        "their projected CRS, such as EPSG:2056+5728 (with heights); without it they stand in the "
        "tangent plane of aerial_control.file",
        usual="that of the file, or the tangent plane",
        cli="--crs",
        metavar="CRS",
    )
    geoid: Path | None = option(
        None, "grid of geoid heights, for heights above sea level", cli="--geoid", metavar="GRID"
    )
    columns: "Columns" = option(
        None, "of a table, as images.columns", kind="columns", usual="by header or order"
    )
    check: tuple[str, ...] = option(
        (),
        "names of points that are check points, whatever the file says",
        cli="--check",
        metavar="NAME",
    )
    skip: tuple[str, ...] = option((), "names of points that are left out")

    def __post_init__(self) -> None:
        check(self, "ground")
        if self.geoid is not None and self.crs is None:
            raise OptionError("ground.geoid", "has no meaning without ground.crs; give both")


@dataclass(frozen=True)
class VehicleTable:
    """Table [vehicle]: a vehicle on the ground whose target the images see: kinematic control."""

    file: Path | None = option(
        None,
        "where the vehicle was: `eo.json` of a run of `process` with the exposures of the images "
        "as its events (its camera is the target), `trajectory.csv` of one, or a table of "
        "positions of the target (target_positions.md)",
        cli="--vehicle",
        metavar="FILE",
        cli_meaning="trajectory.csv, eo.json or table of target positions of a vehicle",
    )
    target: str = option(
        "K_",
        "how the image observations call the target: a prefix before the name of the image "
        "(K_IMG_0010), or one name in all images, which are told apart then",
    )
    target_m: Triple | None = option(
        None,
        "the target from the point of the trajectory (of eo.json: from its camera), forward, "
        "right, down in the axes of the vehicle",
        unit="m",
        kind="lever",
        usual="zero of eo.json and of a table",
    )
    target_sigma_m: Triple | None = option(
        None,
        "standard deviations of what is left of target_m, which is estimated",
        unit="m",
        kind="sigmas",
        usual="it is as stated",
    )
    time_offset_s: float = option(
        0.0, "seconds that are added to the stamps of the vehicle", unit="s", low=-1e6, high=1e6
    )
    time_offset_sigma_s: float = option(
        0.0,
        "standard deviation of the delay of the vehicle's clock, which is estimated; 0: it is as "
        "stated",
        unit="s",
        low=0.0,
        high=10.0,
    )
    shift_sigma_m: Triple | None = option(
        None,
        "standard deviations of a shift of all positions of the vehicle, east, north, up, which is "
        "estimated",
        unit="m",
        kind="sigmas",
        usual="none",
    )
    correlated_share: float = option(
        0.75,
        "of trajectory.csv and a table: share of the variances that lasts, with correlation_time_s"
        "; the rest is white. eo.json has its own covariance",
        low=0.0,
        high=1.0,
    )
    correlation_time_s: float = option(
        300.0, "correlation time of the share that lasts", unit="s", low=0.01, high=1e6
    )
    longest_gap_s: float = option(
        1.0,
        "longest time between two rows of the file within which it is interpolated; exposures in a "
        "longer one have no target",
        unit="s",
        low=0.001,
        high=100.0,
    )
    sizes: Path | None = option(
        None, "apparent sizes of the target (target_sizes.md), with size_m", kind="existing"
    )
    size_m: float | None = option(
        None, "diameter of the target", unit="m", positive=True, usual="not known"
    )
    size_sigma_m: float = option(
        0.0,
        "standard deviation of size_m, whose rest is estimated then; 0: it is as stated",
        unit="m",
        low=0.0,
        high=10.0,
    )
    skip: tuple[str, ...] = option((), "names of images whose target is left out")
    crs: str | None = option(
        None, "of a table: its CRS, as ground.crs", usual="the tangent plane of the images"
    )
    geoid: Path | None = option(None, "of a table: as ground.geoid")
    columns: "Columns" = option(
        None, "of a table, as images.columns", kind="columns", usual="by header or order"
    )

    def __post_init__(self) -> None:
        check(self, "vehicle")
        if (self.sizes is None) != (self.size_m is None):
            missing, other = ("size_m", "sizes") if self.size_m is None else ("sizes", "size_m")
            raise OptionError(f"vehicle.{other}", f"has no meaning without vehicle.{missing}")
        if self.geoid is not None and self.crs is None:
            raise OptionError("vehicle.geoid", "has no meaning without vehicle.crs; give both")
        if not self.target.strip():
            raise OptionError("vehicle.target", "is empty; give a prefix, such as K_, or a name")
        if self.file is None:
            for name in ("target_m", "target_sigma_m", "shift_sigma_m", "sizes"):
                if getattr(self, name) is not None:
                    raise OptionError(f"vehicle.{name}", "has no meaning without vehicle.file")


@dataclass(frozen=True)
class AdjustmentTable:
    """Table [adjustment]: what takes part, how observations are weighed and judged."""

    mode: Literal["iso", "indirect", "fast_at", "direct"] = option(
        "iso",
        '"iso": integrated sensor orientation, all observations; "indirect": without aerial '
        'control; "fast_at": image observations of ground points alone, with aerial control and a '
        'camera that is held; "direct": poses and camera are held, points are intersected, and '
        "ground control is compared as check points are",
        cli="--mode",
    )
    reweight: tuple[str, ...] = option(
        ("image observations",),
        "groups of observations whose variances are multiplied by their components: image "
        "observations (not in mode fast_at, which has few), ground control, aerial control, "
        "kinematic ground control, target sizes; of the others a component that contradicts them "
        "is reported",
    )
    limit_w: float = option(
        4.0, "largest standardised residual of an image observation", low=2.0, high=100.0
    )
    keep_all: bool = option(False, "no observation is rejected, whatever its residual")
    accept: tuple[str, ...] = option(
        (),
        "observations whose contradiction is accepted, of image observations, ground control, "
        "aerial control, kinematic ground control, target sizes, check points: of residuals beyond "
        "five times what their standard deviations allow no orientation is written otherwise",
    )

    def __post_init__(self) -> None:
        check(self, "adjustment")
        groups = (
            *("image observations", "ground control", "aerial control"),
            *("kinematic ground control", "target sizes"),
        )
        for name in self.reweight:
            if name not in groups:
                raise OptionError("adjustment.reweight", f"{name!r}: {near(name, groups)}")
        for name in self.accept:
            if name not in (*groups, "check points"):
                problem = f"{name!r}: {near(name, (*groups, 'check points'))}"
                raise OptionError("adjustment.accept", problem)


@dataclass(frozen=True)
class PlanTable:
    """Table [plan]: what `insgnss adjust --plan` supposes of a block that is not measured yet."""

    tie_points: float = option(52.0, "tie points for each image", low=1.0, high=1e5)
    matched: float = option(
        0.6, "share of the images that see a tie point in which it is measured", low=0.05, high=1.0
    )
    ground_m: float | None = option(
        None,
        "height of the ground in the tangent plane",
        unit="m",
        usual="that of the ground points",
        cli="--ground-height",
        metavar="M",
    )

    def __post_init__(self) -> None:
        check(self, "plan")


@dataclass(frozen=True)
class BlockOutput:
    """Table [output]: where the products go, and what else is written."""

    directory: Path = option(
        Path(DIRECTORY),
        "directory of the products, made where it is missing",
        kind="directory",
        form="directory",
        usual=f'"{DIRECTORY}"',
    )
    formats: tuple[str, ...] = option(
        ("eo_local_plane",),
        "exports of the adjusted orientation, as output.formats of a flight",
        kind="formats",
        form="list of texts",
    )
    cameras: tuple[str, ...] = option(
        CAMERA_FORMATS[:2], f"formats of the adjusted cameras, of {' '.join(CAMERA_FORMATS)}"
    )
    pose_covariance: bool = option(
        False,
        "write the covariance of all poses together, poses_covariance.npz (288 bytes by the square "
        "of the number of images), which `insgnss calibrate mounting` takes beside poses.csv",
        cli="--pose-covariance",
    )

    def __post_init__(self) -> None:
        check(self, "output")
        for name in self.cameras:
            if name not in CAMERA_FORMATS:
                raise OptionError("output.cameras", f"{name!r}: {near(name, CAMERA_FORMATS)}")


@dataclass(frozen=True)
class BlockFile:
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
        check(self, "")
        self._check_mode()

    def _check_mode(self) -> None:
        """Refuse options that the mode has no use for."""
        mode, control = self.adjustment.mode, self.aerial_control
        if mode in ("fast_at", "direct"):
            if control.file is None:
                raise OptionError(
                    "adjustment.mode", f'"{mode}" needs aerial control; give its eo.json'
                )
            if self.camera.free:
                raise OptionError(
                    "camera.free", f'the camera is held in mode "{mode}"; leave it out'
                )
            lines = {control.control, *control.of_lines.values()}
            usable = ("Ap/Aa", "Ap/Ra", "Rp/Ra") if mode == "fast_at" else ("Ap/Aa",)
            if odd := lines.difference(usable):
                raise OptionError(
                    "aerial_control.control",
                    f'"{min(odd)}" does not orient images in mode "{mode}"; it takes'
                    f" {', '.join(usable)}",
                )

    def resolved(self) -> dict[str, Any]:
        """Every value with its default filled in, as plain JSON types."""
        return resolved(self)


BLOCK_TABLES: Mapping[str, tuple[type, ...]] = {
    "": (BlockFile,),
    "images": (ImagesInput,),
    "camera": (CameraTable,),
    "aerial_control": (AerialControlTable,),
    "ground": (GroundTableInput,),
    "vehicle": (VehicleTable,),
    "adjustment": (AdjustmentTable,),
    "plan": (PlanTable,),
    "output": (BlockOutput,),
}
"""The dataclasses whose options are the keys of each table."""


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
    from ..base.tables import read_toml
    from .load import made
    from .values import take

    path = Path(path)
    if path.is_dir():
        path = path / "block.toml"
    if not path.is_file():
        raise InputError.at_line(
            path, None, "does not exist; give a block file, or eo.json with --images and --ground"
        )
    keys = {
        name: tuple(item.name for item in options_of(name, classes))
        for name, classes in BLOCK_TABLES.items()
    }
    keys[""] += tuple(name for name in BLOCK_TABLES if name)
    root = read_toml(path, keys)
    root.check_keys()
    control = root.table("aerial_control")
    if not control.resolve(str(control.text("file", "."))).exists():
        problem = f"{control.text('file')} does not exist; run insgnss process on the flight first"
        raise control.error("file", problem)
    tables: dict[str, Any] = {}
    for name, (kind,) in ((n, classes) for n, classes in BLOCK_TABLES.items() if n):
        table = root.table(name)
        tables[name] = made(table, kind, take(table, [kind]))
    output = tables["output"]
    directory = root.resolve(str(output.directory))
    if directory.exists() and not directory.is_dir():
        raise root.table("output").error("directory", f"{directory} is a file")
    tables["output"] = replace(output, directory=directory)
    own = take(root, [BlockFile])
    own["name"] = own["name"] or path.absolute().parent.name
    return BlockFile(path=path, **own, **tables)
