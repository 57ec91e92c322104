"""Table [aerial_control] of the block file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ....base.errors import OptionError
from ....io.options.kinds import Checked
from ....io.options.schema import Triple, option, sigmas

ControlKind = Literal["Ap/Aa", "Ap/Ra", "Rp/Ra", "Ap", "Rp"]
CONTROLS = ("Ap/Aa", "Ap/Ra", "Rp/Ra", "Ap", "Rp")
"""A absolute, R relative, p position, a attitude."""


@dataclass(frozen=True)
class AerialControlTable(Checked, table="aerial_control"):
    """Table [aerial_control]: poses of the images by GNSS and IMU, and what stands between."""

    file: Path | None = option(
        None,
        "eo.json of a processed flight, or positions of the images without an IMU: .MRK,"
        " camera_positions.csv, _events.pos of RTKLIB, references of Metashape or Pix4D, a table;"
        " without it the block has no aerial control",
    )
    crs: str | None = option(
        None, "CRS of positions that do not say it, such as EPSG:2056+5728", cli="--positions-crs"
    )
    geoid: Path | None = option(
        None, "grid of geoid heights of these positions", usual="heights as `crs` has them"
    )
    initial: Path | None = option(
        None,
        "poses whose attitudes are the first values of the adjustment, in any format that"
        " `insgnss compare` reads",
        usual="the poses of the image observations",
        cli="--initial",
    )
    sigma_m: Triple | None = sigmas(
        "standard deviations of positions, east, north, up, in place of those of the file",
        usual="those of the file",
        cli="--position-sigma",
    )
    lever_arm_m: Triple | None = option(
        None,
        "from the projection centre to the point whose positions the file has (the antenna of a"
        " .pos), camera x right, y down, z viewing direction",
        unit="m",
        usual="of positions without attitudes 0 within 0.15 m, which is estimated; 0 0 0 says that"
        " the file has projection centres",
        cli="--lever-arm",
    )
    covariance: Literal["auto", "strip", "chain", "image"] = option(
        "auto",
        'which covariances weigh the poses: "strip": of whole flight lines, eo_covariance.npz'
        ' beside the file; "chain": of neighbours, which understates errors common to a whole'
        ' line; "image": of each image alone; "auto": the first of these that is there',
    )
    control: ControlKind = option(
        "Ap/Aa",
        "what is observed of the poses, absolute (A) or relative to the neighbour in the flight"
        " line (R): position (p) and attitude (a). Relative attitudes need no bore-sight,"
        " relative positions need no datum of the fixes",
        cli="--control",
    )
    lines: tuple[str, ...] = option(
        (),
        "flight lines with another kind of control: name of one image of the line and the kind,"
        ' such as "IMG_0010 Rp/Ra"',
    )
    relative_weights: Literal["smoothed", "independent", "gyro"] = option(
        "smoothed",
        'covariance of relative control: "smoothed": the covariance of all poses of the line;'
        ' "independent": that of two independent images for each pair (paper 003, equation 5);'
        ' "gyro": as "independent" for positions, from noise and drift of the gyroscopes for'
        " attitudes (equation 6)",
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
        "remaining drift of the gyroscopes, omega_b of equation 6",
        unit="deg/s",
        low=0.0,
        high=10.0,
    )
    gyro_vertical: float = option(
        1.5,
        "factor by which the drift of the gyroscopes is larger about the vertical, k of paper 003",
        low=0.01,
        high=100.0,
    )
    datum_sigma_m: float = option(
        5.0,
        "in flight lines with relative positions: standard deviation of the absolute position of"
        " one image",
        unit="m",
        low=1e-3,
        high=1e6,
    )
    datum_sigma_deg: float = option(
        2.0,
        "in flight lines with relative attitudes: standard deviation of the absolute attitude of"
        " one image",
        unit="deg",
        low=1e-3,
        high=180.0,
    )
    boresight_sigma_deg: float = option(
        1.0,
        "a-priori standard deviation, about each axis, of the remaining bore-sight error, which"
        " is estimated; 0: the bore-sight of the flight file is exact",
        unit="deg",
        low=0.0,
        high=180.0,
        cli="--boresight-sigma",
    )
    lever_arm_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of the remaining lever-arm error, camera x, y, z, which is"
        " estimated",
        usual="it is as the flight file has it",
    )
    time_offset_sigma_s: float = option(
        0.0,
        "a-priori standard deviation of the delay of the exposures behind their stamps, which is"
        " estimated; 0: no delay",
        unit="s",
        low=0.0,
        high=10.0,
        cli="--delay-sigma",
    )
    shift_sigma_m: Triple | None = sigmas(
        "standard deviations of a shift of each flight line, east, north, up, which is estimated",
        usual="none",
        cli="--shift-sigma",
    )
    shift_correlation_s: float = option(
        0.0,
        "correlation time of these shifts, which a slow error of the fixes makes alike in"
        " neighbouring lines, such as 300 of RTK; 0: each line errs by itself",
        unit="s",
        low=0.0,
        high=1e5,
        cli="--shift-correlation",
    )
    drift_sigma_mps: Triple | None = sigmas(
        "standard deviations of a drift of each flight line, which is estimated",
        unit="m/s",
        usual="none",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for text in self.lines:
            name, _, control = text.rpartition(" ")
            if not name.strip() or control not in CONTROLS:
                raise OptionError(
                    "aerial_control.lines",
                    f"{text!r}: name of an image and one of {' '.join(CONTROLS)}, such as"
                    ' "IMG_0010 Rp/Ra"',
                )

        if self.shift_correlation_s and self.shift_sigma_m is None:
            raise OptionError(
                "aerial_control.shift_correlation_s",
                "has no meaning without the standard deviations of the shifts; give"
                " aerial_control.shift_sigma_m (--shift-sigma)",
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
    def positions_alone(self) -> bool:
        """Whether the file is no eo.json, which has attitudes and covariances of flight lines."""
        return self.file is not None and self.file.suffix.lower() != ".json"

    @property
    def absolute_attitudes(self) -> bool:
        """Whether any line observes attitudes that the bore-sight turns."""
        return "Ap/Aa" in (self.control, *self.of_lines.values())
