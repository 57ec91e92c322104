"""The kinds of [[measurement]] that are shipped: a model each, and their table `KINDS`.

heading         of the body, as two antennas on one receiver or a gyrocompass give it
attitude        roll, pitch and heading of an adjustment or a star tracker
body_velocity   in body axes: an odometer (forward alone), a Doppler log, an optical flow sensor
baseline        from one antenna on the body to another, north, east and down: a moving base
magnetometer    magnetic field in body axes, which gives heading without motion
airspeed        through the air along the body's forward axis, as a pitot tube has it
position        of a prism on the body, east, north and up from a total station

The field at a place is that of a dipole along the Earth's axis, of which strength and dip are
states since the true field differs from it, and the declination that is stated. With C the attitude
and the sensor's soft iron M (scale, cross axes and rotation against the body) and hard iron h

    z = (I + M) C_bn B(strength, dip, declination) + h
"""

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.units import DEG
from ...geodesy.axes import parse_axes
from ...geodesy.rotation import rotation_from_vector, rpy_from_rotation
from ...io.formats.detect import head_of, is_nmea
from ...io.formats.gnss.nmea import read_headings
from ...io.formats.gnss.oem_headings import is_oem_log, read_oem_headings
from ...io.formats.gnss.pos_header import POSITION_COLUMNS, ROOTS
from ...io.formats.gnss.rtklib_pos import is_rtklib_pos, read_pos_rows
from ...io.formats.gnss.septentrio import ANGLE_COLUMNS, is_sbf_text, read_sbf_attitudes
from ...io.formats.names import TIME, sigma_names, spell_names
from ...io.formats.text.order import Picked, note, refuse_rows
from ...records import Array
from ...records.measurements import N_ERRORS, Motion, OwnState
from ...records.qualities import Quality
from ...records.states import AXES
from .kinds import EXACT_SCALE, LogRows, Modelled, SensorKind, table_of, turned_angles
from .options import MeasurementInput

WIND_SIGMA = 10.0  # m/s, north and east: a mapping drone does not take off in more
# m/s/sqrt(s): gusts and the change with height and place make 1.5 m/s within a minute
WIND_WALK = 0.2
EQUATOR_UT = 29.8  # of the dipole, on the equator (IGRF 2020)
# of the true field against the dipole's: of the world's land a third differs by more than 10 deg
# and 15 %, South America and southern Africa by up to 40 deg and 40 %
DIP_SIGMA, STRENGTH_SIGMA = 15.0 * DEG, 0.2
LOCAL_NAMES = {"e": "east easting", "n": "north northing", "u": "up height"}
MAGNETOMETER_STEMS = "mag m b magnetic magnetic_field magnetometer field"


def _heading(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return heading of the body plus the constant angle by which the sensor is turned."""

    def predict(motion: Motion, states: Array) -> Array:
        return motion.roll_pitch_heading[:, 2] + states.sum(axis=1)

    def derivative(motion: Motion, states: Array) -> Array:
        forward, (to_north, to_east) = motion.C_lb[:, :, 0], motion.C_nl[:, :2].swapaxes(0, 1)
        north, east = (np.sum(forward * axis, axis=1)[:, None] for axis in (to_north, to_east))
        H = np.zeros((len(forward), 1, N_ERRORS + states.shape[1]))
        across = (north * to_east - east * to_north) / (north**2 + east**2)
        H[:, 0, 6:9], H[:, 0, N_ERRORS:] = np.cross(forward, across), 1.0
        return H

    return predict, turned_angles(options, ""), derivative


def _headings_of_receiver(path: Path) -> LogRows | None:
    """Return the headings of a receiver's log, None where the file is a table."""
    beginning = head_of(path)
    if is_oem_log(beginning):
        return read_oem_headings(path)
    if is_sbf_text(beginning):
        return read_sbf_attitudes(path, "heading")
    return (*read_headings(path), None, ()) if is_nmea(beginning) else None


def _attitudes_of_receiver(path: Path) -> LogRows | None:
    """Return the attitudes of a receiver's log, None where the file is a table."""
    return read_sbf_attitudes(path, *ANGLE_COLUMNS[::-1]) if is_sbf_text(head_of(path)) else None


def _attitude(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return the angles of a sensor that is turned against the body by a constant rotation."""

    def predict(motion: Motion, states: Array) -> Array:
        return rpy_from_rotation(motion.C_nb @ rotation_from_vector(states))

    return predict, turned_angles(options, *AXES)


def _body_velocity(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return (1 + s) R' (v + omega x l) with scale factor s and rotation R of the sensor."""
    rows = [AXES.index(name) for name in columns]
    lever = np.array(options.lever_m)
    # an angle about the axis of the one component that is measured does nothing
    angles = [axis for axis in AXES if columns != (axis,)]
    about = [AXES.index(axis) for axis in angles]

    def predict(motion: Motion, states: Array) -> Array:
        offsets = np.zeros((motion.time.size, 3))
        offsets[:, about] = states[:, 1:]
        velocity = motion.velocity_body + np.cross(motion.rate, lever)
        velocity = np.einsum("kji,kj->ki", rotation_from_vector(offsets), velocity)
        return (1.0 + states[:, :1]) * velocity[:, rows]

    return predict, (_scale(options), *turned_angles(options, *angles))


def _scale(options: MeasurementInput) -> OwnState:
    """Return the scale factor of a speed."""
    return OwnState("scale factor", max(options.scale_sigma, EXACT_SCALE))


def _baseline(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return the vector between the antennas, turned by angles that are states."""
    lever = np.array(options.lever_m)

    def predict(motion: Motion, states: Array) -> Array:
        return np.einsum("kij,kj->ki", motion.C_nb, rotation_from_vector(states) @ lever)

    return predict, turned_angles(options, *AXES)


def _baselines_of_moving_base(path: Path) -> LogRows | None:
    """Return the fixed baselines of a `.pos`, None where the file is none."""
    if not is_rtklib_pos(head_of(path)):
        return None
    pos = read_pos_rows(path)
    if pos.header.kind != "e-baseline":
        problem = "the file has positions, not vectors between antennas; run RTKLIB with"
        advice = "pos1-posmode = movingbase and out-solformat = enu"
        raise InputError.at_line(str(path), None, f"{problem} {advice}")
    fixed = np.asarray(pos.columns["Q"] == Quality.FIXED)  # float ones are off by decimetres
    lines = Picked(pos.table, np.flatnonzero(fixed))
    if not fixed.any():
        problem = f"none of {fixed.size} baselines has fixed ambiguities (Q = {Quality.FIXED:d})"
        raise InputError.at_line(str(path), None, f"{problem}; see the settings of the run")
    e, n, u, sigma_e, sigma_n, sigma_u = (
        pos.columns[name][fixed]
        for name in (*POSITION_COLUMNS[pos.header.kind], *ROOTS["e-baseline"][:3])
    )
    sigma = np.column_stack([sigma_n, sigma_e, sigma_u])
    without_sigma = sigma.min(axis=1) <= 0.0
    refuse_rows(lines, without_sigma, "a standard deviation must be greater than zero")
    notes = pos.notes
    if not fixed.all():
        floats = (
            f"left out {np.count_nonzero(~fixed)} of {fixed.size} baselines with float ambiguities"
        )
        notes = (*notes, note("measurement rows", floats, "fixed ambiguities"))
    return pos.gps_week, pos.time[fixed], np.column_stack([n, e, -u]), lines, sigma, notes


def _magnetometer(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return the field in the axes of the sensor, and its states; iron of no sigma is none."""
    hard = 3 if options.hard_iron_sigma else 0
    soft = 9 if options.soft_iron_sigma else 0
    to_body = parse_axes(options.axes)
    declination = (options.declination_deg or 0.0) * DEG

    def predict(motion: Motion, states: Array) -> Array:
        latitude = motion.geodetic[0]
        strength, dip, turn = states[:, hard + soft :].T
        total = EQUATOR_UT * (1.0 + strength) * np.sqrt(1.0 + 3.0 * np.sin(latitude) ** 2)
        dip = dip + np.arctan2(2.0 * np.sin(latitude), np.cos(latitude))
        level, azimuth = total * np.cos(dip), declination + turn
        field = np.column_stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), total * np.sin(dip)]
        )
        values = np.einsum("kji,kj->ki", motion.C_nb, field)
        if soft:
            iron = states[:, hard : hard + soft].reshape(-1, 3, 3)
            values = values + np.einsum("kij,kj->ki", iron, values)
        return (values + states[:, :hard] if hard else values) @ to_body

    irons = [OwnState(f"hard iron {axis}", options.hard_iron_sigma, "uT") for axis in AXES[:hard]]
    if soft:
        sigma = options.soft_iron_sigma
        irons += [OwnState(f"soft iron {a} of {b}", sigma) for a in AXES for b in AXES]
    field = (
        OwnState("strength of the field", STRENGTH_SIGMA),
        OwnState("dip of the field", DIP_SIGMA, "rad"),
        OwnState("declination", options.declination_sigma_deg * DEG, "rad"),
    )
    return predict, (*irons, *field)


def _predict_airspeed(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return (1 + s) of the forward component of velocity less level wind, which is a state."""

    def predict(motion: Motion, states: Array) -> Array:
        wind = np.pad(states[:, 1:], ((0, 0), (0, 1)))
        forward = motion.C_nb[:, :, 0]
        through_air = np.einsum("ki,ki->k", forward, motion.velocity_ned - wind)
        return (1.0 + states[:, 0]) * through_air

    winds = (OwnState(f"wind {axis}", WIND_SIGMA, "m/s", WIND_WALK) for axis in ("north", "east"))
    return predict, (_scale(options), *winds)


def _position(options: MeasurementInput, columns: tuple[str, ...]) -> Modelled:
    """Return the place of the prism from the station, whose circle, place and clock may be off."""
    lever, places = np.array(options.lever_m), 3 if options.station_sigma_m else 0
    lat, lon, height = options.station or (0.0, 0.0, 0.0)
    with_clock = options.clock_sigma_s > 0.0

    def predict(motion: Motion, states: Array) -> Array:
        origin = motion.frame.position_from_geodetic(lat * DEG, lon * DEG, height)
        prism = motion.position + motion.C_lb @ lever - origin
        if with_clock:
            velocity = np.einsum("kij,kj->ki", motion.C_lb, np.cross(motion.rate, lever))
            prism = prism + states[:, -1:] * (motion.velocity + velocity)
        north_east_down = prism @ motion.frame.C_ln(lat * DEG, lon * DEG)
        if places:
            north_east_down = north_east_down - states[:, 1:4]
        turn = states[:, :1] * np.array([0.0, 0.0, -1.0])
        read = np.einsum("kij,kj->ki", rotation_from_vector(turn), north_east_down)
        return read[:, [1, 0, 2]] * [1.0, 1.0, -1.0]

    shifts = [
        OwnState(f"station {axis}", options.station_sigma_m, "m")
        for axis in ("north", "east", "down")[:places]
    ]
    clock = [OwnState("clock", options.clock_sigma_s, "s")] if with_clock else []
    return predict, (*turned_angles(options, "of the circle"), *shifts, *clock)


KINDS: dict[str, SensorKind] = {
    "heading": SensorKind(
        *table_of(
            {
                "heading": "heading hdg yaw azimuth true_heading hdt",
                "sigma_heading": "sigma_heading sd_heading heading_sd heading_std heading_stddev"
                " sigma sd std",
            },
            "angle",
        ),
        _heading,
        other_format=_headings_of_receiver,
    ),
    "attitude": SensorKind(
        *table_of(
            {
                "roll": "roll",
                "pitch": "pitch",
                "heading": "heading yaw hdg",
                "sigma_roll": sigma_names("roll"),
                "sigma_pitch": sigma_names("pitch"),
                "sigma_heading": sigma_names("heading yaw hdg"),
            },
            "angle",
        ),
        _attitude,
        other_format=_attitudes_of_receiver,
    ),
    "body_velocity": SensorKind(
        *table_of(
            {
                "forward": "forward v_forward forward_speed speed vx v_x odometer wheel_speed",
                "right": "right v_right vy v_y",
                "down": "down v_down vz v_z",
                "sigma_forward": sigma_names("forward v_forward speed vx v_x"),
                "sigma_right": sigma_names("right v_right vy v_y"),
                "sigma_down": sigma_names("down v_down vz v_z"),
            },
            "velocity",
            alone="forward",
        ),
        _body_velocity,
        reads=("offset_sigma_deg", "scale_sigma", "lever_m"),
    ),
    "baseline": SensorKind(
        *table_of(
            {
                "n": "n north relposn rel_n rel_pos_n baseline_n dn",
                "e": "e east relpose rel_e rel_pos_e baseline_e de",
                "d": "d down relposd rel_d rel_pos_d baseline_d dd",
                "sigma_n": f"{sigma_names('n north')} accn",
                "sigma_e": f"{sigma_names('e east')} acce",
                "sigma_d": f"{sigma_names('d down')} accd",
                # time of RELPOSNED, whose other names are here too
                "tow": TIME["tow"].replace("~itow", "itow"),
            },
            "length",
        ),
        _baseline,
        reads=("offset_sigma_deg", "lever_m"),
        needs=("lever_m",),
        other_format=_baselines_of_moving_base,
    ),
    "magnetometer": SensorKind(
        *table_of(
            {
                **{axis: f"{axis} {spell_names(MAGNETOMETER_STEMS, axis)}" for axis in "xyz"},
                **{f"sigma_{axis}": sigma_names(f"{axis} mag_{axis} m_{axis}") for axis in "xyz"},
            },
            "field",
        ),
        _magnetometer,
        reads=(
            *("axes", "declination_deg", "declination_sigma_deg"),
            *("hard_iron_sigma", "soft_iron_sigma"),
        ),
        needs=("declination_deg",),
    ),
    "airspeed": SensorKind(
        *table_of(
            {
                "airspeed": "airspeed air_speed tas true_airspeed true_airspeed_m_s airspeed_true",
                "sigma_airspeed": sigma_names("airspeed air_speed tas true_airspeed"),
            },
            "velocity",
        ),
        _predict_airspeed,
        reads=("scale_sigma",),
    ),
    "position": SensorKind(
        *table_of(
            {
                **{axis: f"{axis} {more}" for axis, more in LOCAL_NAMES.items()},
                **{
                    f"sigma_{axis}": sigma_names(f"{axis} {more}")
                    for axis, more in LOCAL_NAMES.items()
                },
            },
            "length",
        ),
        _position,
        reads=("offset_sigma_deg", "lever_m", "station", "station_sigma_m", "clock_sigma_s"),
        needs=("station", "lever_m"),
    ),
}
"""By the name that `kind` has in the flight file, of `options.SHIPPED`."""
