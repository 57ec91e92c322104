"""Options of the engine, as the option file that RTKLIB's postpos() and rnx2rtkp both read.

Values of choices are written as numbers, because their words differ between versions (l1+2, l1+l2).
The defaults were found on real and simulated sets with RTKLIB EX 2.5.0, moving receivers of 0.1 to
1 s:

    armode=continuous             `instantaneous` hardly ever fixes
    gloarmode=fix-and-hold        2.5.0 ignores `off`; without a hold this one leaves the
                                  ambiguities of GLONASS float
    timeinterp=off                where the base has epochs every 5 s or faster. Between two of them
                                  RTKLIB interpolates the satellites that both have; one that the
                                  base has just found again enters with the base's clock of another
                                  instant. With a clock that drifts by 3e-8 that cost up to 10 % of
                                  the fixed epochs of simulated 45-minute flights with a base of 1
                                  Hz, and one was fixed 0.24 m off; without, all eight flights are
                                  fixed throughout
    prnaccelh=3, prnaccelv=1      m/s^2, what a drone does; with RTKLIB's own 0.1 and 0.01 the
                                  forward and backward solutions of a turning drone stay centimetres
                                  apart, and the combined one calls 22 % of a simulated flight
                                  float, not 0 %

Dynamics. With them the rover's position at an epoch is predicted from the one before, T earlier;
white noise of `prnaccelh` a, m/s^2 per root second, in the acceleration makes the standard
deviation of that prediction

    sigma = a T^(5/2) / sqrt(20)                                                               (O.1)

Beyond the 30 m at which RTKLIB gives a prediction up and starts again from codes, they help
nothing, and its covariances of the restarts are impossible ones (71 of 120 epochs of a recording
every 30 s): dynamics are off from a T of 4.6 s on, unless `rtklib_options` sets pos1-dynamics.

The antenna of the base. RTKLIB relates phases to the position it is given, plus a vector from there
to the antenna reference point (ARP), plus the offset of the phase centre (APC) where it knows the
antenna:

    r_apc = r_given + delta + offset                                                           (B.1)

`apc`: delta = offset = 0. `arp`: delta = 0, the offset from an ANTEX file. `marker`: delta of the
header (ANTENNA: DELTA H/E/N), too. The rover has neither delta nor offset: positions are of its
phase centre.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ..base.errors import InputError, OptionError
from ..base.inputs import read_text
from ..base.wording import setting, spell
from ..geodesy.frames import geodetic_to_ecef
from ..io.options.kinds import accept_value
from ..io.options.schema import declared_options
from ..records import Finding, Question
from .ppk_options import EngineSettings, Point, RawGnss
from .rinex.header import RinexHeader

Direction = Literal["combined", "forward", "backward"]

PASSES_OF_ENGINE: tuple[Direction, ...] = ("forward", "backward")  # what is run; `engine.combined`
SOLUTION_TYPE = {"forward": 0, "backward": 1, "combined": 2}
SYSTEM_BITS = {"G": 1, "R": 4, "E": 8, "J": 16, "C": 32}
KINEMATIC_MODE = 2  # of RTKLIB's PMODE: a moving rover relative to a base
DYNAMICS_KEY = "pos1-dynamics"
EARTH_RADII_M = (6.3e6, 6.4e6)  # m, within which every place on the Earth is: 6357 to 6378 km
RESTART_M = 30.0  # VAR_POS of RTKLIB's rtkpos.c
# between epochs of the base, beyond which the clocks of satellites wander by millimetres meanwhile
INTERPOLATED_S = 5.0
ANTENNAS = "antennas.atx"
OUTPUT = {
    "out-solformat": 0,
    "out-outhead": 1,
    "out-outopt": 1,
    "out-outvel": 0,
    "out-timesys": 0,
    "out-timeform": 0,
    "out-timendec": 9,
    "out-degform": 0,
    "out-height": 0,
    "out-outstat": 0,
}


@dataclass(frozen=True)
class EngineOptions(EngineSettings):
    """Options of the engine that solves antenna positions.

    Parameters
    ----------
    base_point : "apc", "arp" or "marker", optional
        What stands at the base position: the antenna's phase centre, its reference point or the
        marker below; needed with a position.
    antex : path, optional
        File of phase centres, for "arp" and "marker".
    systems : str
        Letters of GPS G, GLONASS R, Galileo E, QZSS J, BeiDou C.
    frequencies : int
        1 (L1), 2 (with L2, Galileo E5b) or 3 (with L5).
    elevation_mask_deg : float
        Lowest elevation, 0 to 60 deg.
    ratio : float
        Of the ambiguity test, 1 to 100.
    engine : str
        "auto" (pyrtklib5, else rnx2rtkp on PATH), "pyrtklib5", or the path of an rnx2rtkp.
    max_age_s : float
        Longest time to the base's epoch, s.
    timeout_s : float
        Longest time of one of the engine's two runs, s.
    acceleration_mps2 : tuple of float
        Process noise of the rover's acceleration, horizontal and vertical, m/s^2.
    rtklib_options : Mapping
        Further options of RTKLIB by name, such as {"pos2-arminfix": "10"}.
    base_position_m : tuple of float, optional
        ECEF, m; None for the header's APPROX POSITION XYZ.

    Raises
    ------
    OptionError
        For a value that cannot be.
    """

    base_position_m: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.base_position_m is None:
            return
        if self.base_point is None:
            message = (
                f"needs {spell('gnss.base_point')}: say whether the position is that of the"
                " antenna's phase centre (apc), its reference point (arp) or the marker"
            )
            raise OptionError("gnss.base_position", message)
        radius = sum(x * x for x in self.base_position_m) ** 0.5
        if not EARTH_RADII_M[0] < radius < EARTH_RADII_M[1]:
            message = f"is {radius:.0f} m from the Earth's centre, not 6.3e6 to 6.4e6 m"
            raise OptionError("gnss.base_position", f"{message}; ECEF coordinates in m are needed")


def options_at(base_position: tuple[float, ...] | None, **settings: Any) -> EngineOptions:
    """Return options with a base at a latitude, longitude (deg) and ellipsoidal height (m).

    Parameters
    ----------
    base_position : tuple of float or None
        None: the header's.
    **settings : Any
        Fields of `EngineSettings`; what stands at a position is the antenna's phase centre where
        nobody says it.
    """
    if base_position is None:
        return EngineOptions(**settings)
    option = declared_options(RawGnss)["base_position"]
    lat, lon, height = accept_value(option, base_position, "gnss.base_position")
    ecef = geodetic_to_ecef(math.radians(lat), math.radians(lon), height).tolist()
    settings["base_point"] = settings.get("base_point") or "apc"
    return EngineOptions(base_position_m=tuple(ecef), **settings)


def base_position(
    options: EngineOptions, base: RinexHeader
) -> tuple[tuple[float, float, float], Point]:
    """Return the coordinates (ECEF, m) of the base and the point that they are of.

    Raises
    ------
    InputError
        Where neither options nor header give any.
    """
    if options.base_position_m is not None and options.base_point is not None:
        return options.base_position_m, options.base_point
    approx = base.approx_position_m
    if approx is None:
        message = (
            f"no APPROX POSITION XYZ in the header and no {spell('gnss.base_position')}; give the"
            " base's coordinates"
        )
        raise InputError.in_file(base.path, message)
    return (float(approx[0]), float(approx[1]), float(approx[2])), options.base_point or "marker"


def base_antenna(options: EngineOptions, base: RinexHeader) -> dict[str, str]:
    """Return the options of the base's antenna after (B.1).

    Raises
    ------
    InputError
        Where the ANTEX file cannot be read or does not know the antenna.
    """

    _, point = base_position(options, base)
    up, east, north = map(float, base.antenna_delta_m) if point == "marker" else (0.0, 0.0, 0.0)
    lines = {
        "ant2-anttype": "",
        "ant2-antdele": f"{east:.4f}",
        "ant2-antdeln": f"{north:.4f}",
        "ant2-antdelu": f"{up:.4f}",
    }
    if options.antex is None or point == "apc":
        return lines
    try:
        antennas = "\n" + read_text(options.antex, errors="replace")
    except OSError as error:
        raise InputError.unread(options.antex, error, f"check {spell('gnss.antex')}") from None
    kind = base.antenna.split()[0] if base.antenna.split() else ""
    if not kind or f"\n{kind}" not in antennas:
        message = (
            f"does not know the base's antenna {base.antenna!r} of {base.path}; give another, or"
            f" {setting('gnss.base_point', 'apc')}"
        )
        raise InputError.in_file(options.antex, message)
    return lines | {"ant2-anttype": base.antenna, "file-rcvantfile": ANTENNAS}


def prediction_sd(options: EngineOptions, interval_s: float) -> float:
    """Return the standard deviation (O.1), m, of a horizontal position predicted over a time."""
    return float(options.acceleration_mps2[0] * interval_s**2.5 / 20.0**0.5)


def check_dynamics(options: EngineOptions, interval_s: float) -> tuple[Finding, ...]:
    """Return a note where the rover's epochs, every interval_s, are too rare for dynamics.

    There is none where the user's options say whether to have them.
    """
    sd = prediction_sd(options, interval_s)
    if DYNAMICS_KEY in options.rtklib_options or sd <= RESTART_M:
        return ()
    longest = (RESTART_M * 20.0**0.5 / options.acceleration_mps2[0]) ** 0.4
    finding = (
        f"off: epochs every {interval_s:g} s, over which {options.acceleration_mps2[0]:g} m/s^2"
        f" predict a position to {sd:.0f} m"
    )
    advice = (
        "every epoch is solved without the help of its neighbours; log faster in flight, or set"
        f" {DYNAMICS_KEY} in {spell('gnss.rtklib_options')}"
    )
    expected = f"on, with epochs every {longest:.1f} s at most"
    return (Question("engine dynamics", expected).note(finding, advice),)


def option_file(
    options: EngineOptions,
    base: RinexHeader,
    direction: Direction,
    interval_s: float,
    base_interval_s: float,
) -> str:
    """Return the text of the option file of one run.

    Parameters
    ----------
    options : EngineOptions
        Options of the user.
    base : RinexHeader
        Header of the base's file.
    direction : str
        Which run; "combined" is RTKLIB's own combination, which is not needed.
    interval_s, base_interval_s : float
        Between epochs of rover and base, s.
    """
    horizontal, vertical = options.acceleration_mps2
    lines: dict[str, object] = {
        "pos1-posmode": KINEMATIC_MODE,
        "pos1-frequency": options.frequencies,
        "pos1-soltype": SOLUTION_TYPE[direction],
        "pos1-elmask": options.elevation_mask_deg,
        DYNAMICS_KEY: int(prediction_sd(options, interval_s) <= RESTART_M),
        "pos1-ionoopt": 1,
        "pos1-tropopt": 1,
        "pos1-sateph": 0,
        "pos1-navsys": _systems(options),
        "pos2-armode": 1,
        "pos2-gloarmode": 3,
        "pos2-bdsarmode": 1,
        "pos2-arthres": options.ratio,
        "pos2-arthresmin": options.ratio,
        "pos2-arthresmax": options.ratio,
        "pos2-maxage": options.max_age_s,
        "stats-prnaccelh": horizontal,
        "stats-prnaccelv": vertical,
        "misc-timeinterp": int(base_interval_s > INTERPOLATED_S),
        "ant2-postype": 1,
    }
    position, _ = base_position(options, base)
    coordinates = {f"ant2-pos{k}": f"{x:.5f}" for k, x in enumerate(position, start=1)}
    return _text(
        lines | coordinates | base_antenna(options, base) | dict(options.rtklib_options) | OUTPUT
    )


def single_point_file(options: EngineOptions) -> str:
    """Return the text of the option file of a run that positions a receiver by codes alone."""
    models: dict[str, object] = {
        "pos1-elmask": 10,
        "pos1-ionoopt": 1,
        "pos1-tropopt": 1,
        "pos1-navsys": _systems(options),
    }
    return _text({"pos1-posmode": 0, "pos1-frequency": 1, "pos1-soltype": 0} | models | OUTPUT)


def _systems(options: EngineOptions) -> int:
    return sum(SYSTEM_BITS[letter] for letter in set(options.systems))


def _text(lines: Mapping[str, object]) -> str:
    return "".join(f"{name}={value}\n" for name, value in lines.items())
