"""Does the base stand, and where its coordinates say? Asked before the engine runs.

With rover and base swapped the engine writes a file full of epochs. Swapped files show in that the
base moves, by its phases (5 mm/s of a receiver that stands, also from epochs every 30 s) or by its
codes; in that it stands elsewhere than its coordinates say, where the rover stands; or in that the
coordinates are, to a decimetre, those of the rover's header. Codes place a receiver to some metres:
of two that both stand within `MEASURED_PLACE_M` of each other neither codes nor phases show which
is which, nor whether the coordinates are metres off.

Every position has the error of the base's coordinates, and nothing else shows it. The median of the
codes at some 60 epochs, with the broadcast ionosphere, lies 0.5 to 3.7 m from the known coordinates
in seven recordings of 2005 to 2024 and a simulated one. From `MEASURED_PLACE_M` on there is a note,
and from `OTHER_PLACE_M` on, more than the ionosphere leaves in them, a refusal: so is a height
above sea level in the place of one above the ellipsoid where the two are further apart than that,
as in most of Europe (40 to 55 m).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError, InputError
from ...base.units import FOOT_M
from ...base.wording import spell
from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef
from ...records import Array, Finding, GnssFixes, Question
from ..options import EngineOptions, base_position
from ..phase.time_differences import VelocityOptions
from ..phase.velocity import time_differenced_velocity
from ..rinex.header import RinexHeader
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
from .preflight import interval

# distance of the base's codes from its coordinates (m) above which they are refused, and above
# which a note says it: codes are 0.5 to 3.7 m off, and the ionosphere adds less than 20 m
OTHER_PLACE_M, MEASURED_PLACE_M = 20.0, 5.0
# distance from the median within which 90 % of the code positions of a base lie (m): 15, because
# codes of a standing receiver scatter by some metres
MOVES_M = 15.0
# share of positions and speeds that a limit is compared with: 0.9, because some codes are outliers
MOST_POINTS = 0.9
# longest interval over which phases are differenced: s, and intervals of the observations, because
# receivers of one epoch in 30 s would have none otherwise
LEAST_GAP_S, GAP_INTERVALS = 2.0, 1.5
NEARER = 3.0  # times that the rover has to be nearer to the base's coordinates to be the base
# speed by phases (m/s) and share of time above it from which a receiver moves: a standing one has
# 5 mm/s, and cycle slips pass for speed in a few epochs
MOVES_MPS, MOVES_SHARE = 0.2, 0.05
MOVING_SIGMAS = 3.0  # standard deviations by which a speed has to exceed `MOVES_MPS`
# distances (m) up to which coordinates are those of the rover's header, and from which they are not
# those of the base's own: headers are rounded to a decimetre and lie metres apart
SAME_COORDINATES_M, OTHER_COORDINATES_M = 0.1, 1.0
ROUGHLY_M = 500.0  # of an epoch between those with a position; its phases then show 0.08 m/s


@dataclass(frozen=True, eq=False)
class Whereabouts:
    """Where a receiver is, and whether it moves.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        m ECEF, by codes alone.
    speed, sd : ndarray, shape (m,)
        m/s, by phases between epochs (TDCP), and its standard deviation; both empty where no phases
        are fit for it.
    """

    points: Array
    speed: Array
    sd: Array

    @classmethod
    def of(
        cls, fixes: GnssFixes, observations: Observations, navigation: Navigation
    ) -> "Whereabouts":
        """Build it from positions by codes at some epochs, and the phases."""
        points = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
        limits = VelocityOptions(
            longest_s=max(LEAST_GAP_S, GAP_INTERVALS * interval(observations)),
            position_sd=ROUGHLY_M,
        )
        try:
            velocity = time_differenced_velocity(observations, navigation, fixes, limits)
        except DataError:  # no phases, or of too few satellites: codes alone
            return cls(points, np.empty(0), np.empty(0))
        speed = np.linalg.norm(velocity.velocity_ned, axis=1)
        return cls(points, speed, np.sqrt(np.trace(velocity.cov_ned, axis1=1, axis2=2)))

    @property
    def middle(self) -> Array:
        """Return the median of the points (3,), m ECEF."""
        return np.asarray(np.median(self.points, axis=0))

    def motion(self) -> str:
        """Return how the receiver moves, in words; empty where it stands."""
        moving = self.speed > MOVES_MPS + MOVING_SIGMAS * self.sd
        if moving.size and moving.mean() > MOVES_SHARE:
            fast = np.quantile(self.speed[moving], MOST_POINTS)
            return (
                f"at {fast:.1f} m/s, and in {moving.mean():.0%} of its time (limit"
                f" {MOVES_SHARE:.0%}) above {MOVES_MPS:g} m/s, by phase"
            )
        spread = float(np.quantile(np.linalg.norm(self.points - self.middle, axis=1), MOST_POINTS))
        if spread <= MOVES_M:
            return ""
        return f"{spread:.0f} m about its median, by codes (limit {MOVES_M:.0f} m)"


def check_base_place(
    rover: Observations,
    base: Observations,
    options: EngineOptions,
    whereabouts: Callable[[Observations], Whereabouts],
) -> tuple[Finding, ...]:
    """Check whether the base stands, and where its coordinates say.

    Parameters
    ----------
    rover, base : Observations
        Observations of the two receivers.
    options : EngineOptions
        Hold the coordinates of the base.
    whereabouts : callable
        Finds where a receiver is; the rover's are computed only where the base looks wrong.

    Returns
    -------
    tuple of Finding
        A note where the base stands more than `MEASURED_PLACE_M` off its coordinates.

    Raises
    ------
    InputError
        Where the base moves, stands more than `OTHER_PLACE_M` off its coordinates, or the rover is
        where they say.
    """
    location = whereabouts(base)
    stated_ecef = np.array(base_position(options, base.header)[0])
    distance = float(np.linalg.norm(location.middle - stated_ecef))
    if motion := location.motion():
        raise InputError.in_file(
            base.header.path,
            f"the base moves: {motion}; {_advice_for_moving_base(rover, whereabouts)}",
        )
    if options.base_position_m is not None:
        if _is_header_of_rover(stated_ecef, base.header, rover.header):
            message = (
                f"the base coordinates are those in the header of the rover {rover.header.path},"
                " not those in the base's own; are rover and base swapped?"
            )
            raise InputError.in_file(base.header.path, message)
        if distance > MEASURED_PLACE_M and _rover_stands_at(
            stated_ecef, distance, rover, whereabouts
        ):
            message = (
                f"stands {distance:.0f} m from the base coordinates, but the rover"
                f" {rover.header.path} stands at them: rover and base are swapped; exchange the two"
                " files"
            )
            raise InputError.in_file(base.header.path, message)
    if distance > OTHER_PLACE_M:
        whose = "the base coordinates"
        if options.base_position_m is None:
            whose = "APPROX POSITION XYZ of its header"
        message = (
            f"stands {distance:.0f} m from {whose} (limit {OTHER_PLACE_M:.0f} m), by codes at"
            f" {in_degrees(location.middle)}"
        )
        raise InputError.in_file(
            base.header.path,
            f"{message}; {_advice_for_coordinates(stated_ecef, location.middle, options)}",
        )
    return _coordinate_notes(options, base.header, distance)


def in_degrees(ecef: Array) -> str:
    """Return a position (3,), m ECEF, as text for base_position, to the decimetre.

    It is latitude deg, longitude deg, ellipsoidal height m.
    """
    lat, lon, height = (float(x) for x in ecef_to_geodetic(ecef))
    return f"{np.degrees(lat):.6f},{np.degrees(lon):.6f},{height:.1f}"


def _advice_for_coordinates(
    stated_ecef: Array, code_position: Array, options: EngineOptions
) -> str:
    """Name the mistake that takes stated coordinates to the position by codes, (3,) m ECEF."""
    lat, lon, height = (float(x) for x in ecef_to_geodetic(stated_ecef))
    if options.base_position_m is None:
        return f"give {_coordinate_options()}"

    def agree(lat: float, lon: float, height: float) -> bool:
        distance = np.linalg.norm(geodetic_to_ecef(lat, lon, height) - code_position)
        return bool(abs(lat) <= np.pi / 2.0 and distance < MEASURED_PLACE_M)

    mistakes = {
        "latitude and longitude exchanged": (lon, lat, height),
        "latitude and longitude in radians": (math.degrees(lat), math.degrees(lon), height),
        "the height in feet": (lat, lon, FOOT_M * height),
    }
    for mistake, corrected in mistakes.items():
        if agree(*corrected):
            return f"with {mistake} the coordinates agree; correct them"
    height_error = float(ecef_to_geodetic(code_position)[2]) - height
    if agree(lat, lon, height + height_error):
        side = "above" if height_error > 0.0 else "below"
        return (
            f"only the height differs, the position by codes is {abs(height_error):.0f} m {side}"
            " it: give the height above the ellipsoid, not above sea level"
        )
    return "check the base coordinates, or are rover and base swapped?"


def _coordinate_options() -> str:
    return f"{spell('gnss.base_position')} and {spell('gnss.base_point')}"


def _advice_for_moving_base(
    rover: Observations, whereabouts: Callable[[Observations], Whereabouts]
) -> str:
    """Return the advice for a base that moves: whether the rover is the one that stands."""
    try:
        moves = bool(whereabouts(rover).motion())
    except DataError:
        return "are rover and base swapped?"
    if moves:
        return (
            f"so does the rover {rover.header.path}; a base must stand still: cut its file to the"
            " time in which it does"
        )
    return f"the rover {rover.header.path} stands: are rover and base swapped?"


def _rover_stands_at(
    stated_ecef: Array,
    distance: float,
    rover: Observations,
    whereabouts: Callable[[Observations], Whereabouts],
) -> bool:
    """Return whether the rover stands at the base's coordinates (3,), m, `NEARER` than the base.

    `distance` is that of the base from them, m.
    """
    try:
        location = whereabouts(rover)
    except DataError:
        return False
    rover_distance = float(np.linalg.norm(location.middle - stated_ecef))
    return not location.motion() and rover_distance < distance / NEARER


def _is_header_of_rover(stated_ecef: Array, base: RinexHeader, rover: RinexHeader) -> bool:
    """Return whether coordinates (3,), m ECEF, are of the rover's header and not of the base's."""
    if (
        rover.approx_position_m is None
        or np.linalg.norm(rover.approx_position_m - stated_ecef) > SAME_COORDINATES_M
    ):
        return False
    return base.approx_position_m is None or bool(
        np.linalg.norm(base.approx_position_m - stated_ecef) > OTHER_COORDINATES_M
    )


def check_base_point(options: EngineOptions, base: RinexHeader, chosen: bool = True) -> Finding:
    """Report the base's coordinates that are taken, and the point that they are of.

    It is a note where they are given and nobody has `chosen` what stands there.
    """
    position, point = base_position(options, base)
    name = {
        "apc": "the antenna's phase centre (apc)",
        "arp": "the antenna's reference point (arp)",
        "marker": "the marker (marker)",
    }[point]
    lat, lon, height = (float(x) for x in ecef_to_geodetic(np.array(position)))
    finding = f"{np.degrees(lat):.9f},{np.degrees(lon):.9f},{height:.4f}, taken as {name}"
    ask = Question("base point", "the point to which the coordinates refer is stated")
    if chosen or options.base_position_m is None:
        return ask.ok(finding)
    advice = (
        f"give {spell('gnss.base_point')}: published coordinates are mostly of a marker or of the"
        " antenna's reference point, which is 0.05 to 0.2 m below the phase centre"
    )
    return ask.note(f"{finding}, as nothing says", advice)


def _coordinate_notes(
    options: EngineOptions, base: RinexHeader, distance: float
) -> tuple[Finding, ...]:
    """Notes on coordinates of the header or far from the codes, and on a phase centre that is not
    applied.
    """
    checks = []
    _, point = base_position(options, base)
    if options.base_position_m is None:
        finding = (
            f"APPROX POSITION XYZ of {base.path}, {distance:.1f} m from its position by codes;"
            f" taken as {point}"
        )
        advice = f"give {_coordinate_options()}; every position has the error of these coordinates"
        ask = Question("base coordinates", "coordinates that are known")
        checks.append(ask.note(finding, advice))
    elif distance > MEASURED_PLACE_M:
        finding = f"{distance:.1f} m from the position of {base.path} by codes"
        advice = (
            "check the base coordinates, their datum and height (ellipsoidal); every position has"
            " their error"
        )
        checks.append(
            Question("base coordinates", f"within {MEASURED_PLACE_M:.0f} m").note(finding, advice)
        )
    if (
        point != "apc"
        and options.antex is None
        and base.antenna.split()[:1] not in ([], ["NONE"], ["Unknown"])
    ):
        finding = f"of the {point}, with no ANTEX file for the antenna {base.antenna}"
        advice = (
            f"give {spell('gnss.antex')}, or the coordinates of the phase centre; without them"
            " heights are wrong by the antenna's phase centre offset, 0.05 to 0.2 m"
        )
        checks.append(Question("base antenna", "the phase centre").note(finding, advice))
    return tuple(checks)
