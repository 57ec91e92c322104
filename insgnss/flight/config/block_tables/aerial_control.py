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
        "file of aerial control: eo.json of a processed flight, or image positions without an IMU "
        "(.MRK, camera_positions.csv, _events.pos of RTKLIB, references of Metashape or Pix4D, a "
        "table); default: no aerial control",
    )
    crs: str | None = option(
        None,
        "CRS of the positions if their file does not state it, such as EPSG:2056+5728",
        cli="--positions-crs",
    )
    geoid: Path | None = option(
        None, "grid of geoid heights of these positions", usual="heights as `crs` has them"
    )
    initial: Path | None = option(
        None,
        "file of poses whose attitudes are the initial values of the adjustment, in any format of "
        "`insgnss compare`",
        usual="the poses of the image observations",
        cli="--initial",
    )
    sigma_m: Triple | None = sigmas(
        "standard deviations of positions, east, north, up, which replace those of the file",
        usual="those of the file",
        cli="--position-sigma",
    )
    lever_arm_m: Triple | None = option(
        None,
        "lever arm from the projection centre to the point of the positions (the antenna of a "
        ".pos), in camera axes x right, y down, z viewing direction",
        unit="m",
        usual="for positions without attitudes an estimated arm, 0 within 0.15 m; 0 0 0: the file "
        "has projection centres",
        cli="--lever-arm",
    )
    covariance: Literal["auto", "strip", "chain", "image"] = option(
        "auto",
        'covariances that weigh the poses: "strip": of whole flight lines (eo_covariance.npz '
        'beside the file); "chain": of neighbouring images, which understates errors common to a '
        'line; "image": of each image alone; "auto": the first that exists',
    )
    control: ControlKind = option(
        "Ap/Aa",
        "observed position (p) and attitude (a) of the poses, absolute (A) or relative to the "
        "neighbour in the flight line (R); relative attitudes need no bore-sight, relative "
        "positions no datum of the fixes",
        cli="--control",
    )
    lines: tuple[str, ...] = option(
        (),
        "flight lines with another kind of control: one image of the line and the kind, such as "
        '"IMG_0010 Rp/Ra"',
    )
    relative_weights: Literal["smoothed", "independent", "gyro"] = option(
        "smoothed",
        'covariance of relative control: "smoothed": from all poses of the line; "independent": '
        'each pair from two independent images (paper 003, equation 5); "gyro": positions as '
        '"independent", attitudes from noise and drift of the gyroscopes (equation 6)',
        cli="--relative-weights",
    )
    gap_s: float = option(
        10.0,
        "longest time between two images that are observed relative to each other",
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
        "ratio of the gyroscopes' drift about the vertical to that of other axes, k of paper 003",
        low=0.01,
        high=100.0,
    )
    datum_sigma_m: float = option(
        5.0,
        "standard deviation of the absolute position of one image, with relative positions",
        unit="m",
        low=1e-3,
        high=1e6,
    )
    datum_sigma_deg: float = option(
        2.0,
        "standard deviation of the absolute attitude of one image, with relative attitudes",
        unit="deg",
        low=1e-3,
        high=180.0,
    )
    boresight_sigma_deg: float = option(
        1.0,
        "a-priori standard deviation of the estimated bore-sight correction about each axis; 0: "
        "the bore-sight of the flight file is exact",
        unit="deg",
        low=0.0,
        high=180.0,
        cli="--boresight-sigma",
    )
    lever_arm_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of the estimated lever-arm correction, camera x, y, z",
        usual="it is as the flight file has it",
    )
    time_offset_sigma_s: float = option(
        0.0,
        "a-priori standard deviation of the estimated delay of the exposures after their time "
        "stamps; 0: no delay",
        unit="s",
        low=0.0,
        high=10.0,
        cli="--delay-sigma",
    )
    shift_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of the estimated shift of each flight line, east, north, up",
        usual="none",
        cli="--shift-sigma",
    )
    shift_correlation_s: float = option(
        0.0,
        "correlation time of the shifts of flight lines, because slow errors of the fixes shift "
        "neighbouring lines alike (RTK: 300); 0: independent shifts",
        unit="s",
        low=0.0,
        high=1e5,
        cli="--shift-correlation",
    )
    drift_sigma_mps: Triple | None = sigmas(
        "a-priori standard deviations of the estimated drift of each flight line",
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
                    f"{text!r}: the name of an image and one of {' '.join(CONTROLS)} are "
                    'expected, such as "IMG_0010 Rp/Ra"',
                )

        if self.shift_correlation_s and self.shift_sigma_m is None:
            raise OptionError(
                "aerial_control.shift_correlation_s",
                "has no meaning without the standard deviations of the shifts; give "
                "aerial_control.shift_sigma_m (--shift-sigma)",
            )
        relative = {"Ap/Ra", "Rp/Ra", "Rp"} & {self.control, *self.of_lines.values()}
        if self.relative_weights != "smoothed" and not relative:
            raise OptionError(
                "aerial_control.relative_weights",
                "has no meaning without relative control; set aerial_control.control, such as "
                '"Ap/Ra"',
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
