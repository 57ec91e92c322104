"""Names that columns go by in the headers of text tables: one table for readers and `inspect`.

A row holds a canonical name and its names in headers, blanks between them, the best first: where a
header has several of them, `inspect` takes the first. A name behind a ~ is taken by `inspect`
alone, which reports it: it may mean something else, such as a height above the sea. Readers take
the others; a header with two of them is refused.
"""

from functools import cache
from itertools import product

from ...records.from_tables import IMAGE_HEADERS

Names = dict[str, str]


def spell_names(heads: str, tails: str) -> str:
    """Return all names of a head, a glue and a tail, blanks between them."""
    parts = product(heads.split(), ("_", ""), tails.split())
    return " ".join(f"{head}{glue}{tail}" for head, glue, tail in parts)


def sigma_names(axes: str) -> str:
    """Return names of a standard deviation along an axis of these names."""
    return spell_names("sd std sigma rms acc stdev", axes)


def deviations(axes: str) -> str:
    """Return what else `inspect` takes for a standard deviation along an axis of these names."""
    return " ".join(
        f"~{axis}_standard_deviation ~{axis}_accuracy ~{axis}_stdev ~pos_{axis}_stdev"
        for axis in axes.split()
    )


@cache
def taken_by_readers(names: str) -> tuple[str, ...]:
    """Return the names of a row that readers take."""
    return tuple(name for name in names.split() if not name.startswith("~"))


@cache
def taken_by_inspect(names: str) -> tuple[str, ...]:
    """Return all names of a row without underscores, the best first."""
    return tuple(dict.fromkeys(name.strip("~").replace("_", "") for name in names.split()))


_PREFIXES = "~imu ~gyro ~sensor ~sample ~gps ~gnss ~l ~unix ~utc ~system ~sys"
TIME: Names = {
    "tow": "tow gpstow gps_tow time gpstime gps_time gpst sow gps_sow seconds time_of_week t"
    " ~times ~timestamp ~timestamps ~secs ~sec ~itow ~epoch ~sec_of_week ~seconds_of_week"
    " ~gps_seconds ~gps_sec ~stamp ~header_stamp ~elapsed ~seconds_elapsed ~zeit ~uhrzeit ~clock"
    " ~rosbag_timestamp ~header_time ~sampletimefine ~utc ~time_utc ~gps ~ts ~ms ~us ~millis"
    " ~micros ~timestamp_since1970 ~timestamp_sincereboot ~year ~utc_year "
    f"{spell_names(_PREFIXES, 'time times timestamp timestamps stamp clock tow time_of_week t')}",
    "week": "week gpsweek gps_week wn wnc ~gwk ~wk",
}
# parts of a second beside the seconds of `tow`, where a clock stands in two columns, and what one
# of them is (s); only `columns` can name them
FRACTIONS_S = {"nsec": 1e-9, "usec": 1e-6}
FINE: Names = dict.fromkeys(FRACTIONS_S, "")
GYRO_STEMS = "g gyro gyr gyroscope w omega rate angular_rate angular_velocity dtheta"
ACCEL_STEMS = "a acc accel accelerometer f acceleration linear_acceleration dv dvel"
IMU: Names = {
    **TIME,
    **{f"g{axis}": spell_names(GYRO_STEMS, axis) for axis in "xyz"},
    **{f"a{axis}": spell_names(ACCEL_STEMS, axis) for axis in "xyz"},
    **FINE,
    "counter": "packetcounter packet_counter packet_count",
    "temperature": "temperature temp",
}
GNSS: Names = {
    **TIME,
    "lat": "lat latitude lat_deg phi_deg b ~latitude_d ~latitude_deg ~lat_rad ~gps_lat ~pos_lat"
    " ~breite ~breitengrad",
    "lon": "lon lng long longitude lon_deg lambda l ~pos_lon ~lng_deg ~longitude_deg ~lon_rad"
    " ~gps_lon ~gps_lng ~laenge ~lnge ~laengengrad ~lngengrad",
    "h": "h_ell ellheight ell_height ~alt_ellipsoid ellipsoid_height ellipsoidal_height"
    " ~height_ellipsoid up_ell alt altitude ~alt_m ~altitude_m ~gps_alt ~pos_alt hgt"
    " height ~height_m h_m ~alt_msl ~height_msl ~elevation ~ele ~hoehe ~hhe h",
    # geocentric, and local about a reference point (`gnss.cartesian`)
    **{axis: f"{axis}_ecef ecef_{axis} ecef{axis} {axis}ecef ~{axis}" for axis in "xyz"},
    **{f"sd_{axis}": sigma_names(axis) for axis in "xyz"},
    **{axis: f"{axis} {axis}_m pos_{axis} position_{axis}" for axis in ("north", "east", "up")},
    "down": "down down_m pos_down position_down",
    "sd_n": f"{sigma_names('n north lat latitude n_m')} {deviations('lat latitude north')}",
    "sd_e": f"{sigma_names('e east lon longitude e_m')} {deviations('lon longitude east')}",
    "sd_u": f"{sigma_names('u up d down h height alt u_m')} ~vacc ~vaccm ~epv ~epvm"
    f" ~vertical_accuracy ~vaccuracy ~accuracy_vertical {deviations('height alt altitude down')}",
    "sd_ne": "~hacc ~hacch ~haccm ~eph ~ephm ~horizontal_accuracy ~haccuracy ~accuracy_horizontal",
    # of ROS, along east, north and up
    "var_n": "~position_covariance4",
    "var_e": "~position_covariance0",
    "var_u": "~position_covariance8",
    **FINE,
    "q": "q quality fix_quality ~gps_quality ~quality_indicator ~fix ~fix_status ~fix_type ~gps_fix"
    " ~fix_mode ~solution ~solution_status ~rtk_status ~pos_mode ~gps_status ~status",
    "vn": "vn v_n vel_n v_north ~vel_north north_velocity velocity_north vnorth ~vn_ms ~vel_n_ms",
    "ve": "ve v_e vel_e v_east ~vel_east east_velocity velocity_east veast ~ve_ms ~vel_e_ms",
    "vd": "vd v_d vel_d v_down ~vel_down down_velocity velocity_down vdown ~vd_ms ~vz ~vel_d_ms",
    "vu": "vu v_u vel_u v_up ~vel_up up_velocity velocity_up vup",
    "sd_vn": sigma_names("vn v_n vel_n"),
    "sd_ve": sigma_names("ve v_e vel_e"),
    "sd_vd": sigma_names("vd v_d vel_d vu v_u vel_u"),
    "sd_v": "~s_variance_m_s ~sacc ~saccm ~speed_accuracy ~velocity_accuracy",  # of each axis
    "speed": "spd speed gndspd gnd_speed ground_speed ~gspd hspeed sog ~velocity",
    "course": "gcrs course ~course_deg cog ground_course ~gcourse track course_over_ground"
    " ~bearing ~direction",
}
# what describes the solution of a fix and weighs nothing (`records.observations.OF_THE_SOLUTION`)
OF_A_SOLUTION: Names = {
    "satellites": "ns nsat nsats n_sat num_sat num_sats nsv numsv num_sv satellites sats"
    " n_satellites",
    "ratio": "ratio ar_ratio",
    "age_s": "age age_s diff_age",
    "pdop": "pdop",
    "hdop": "hdop",
}
IMAGES = " ".join(IMAGE_HEADERS)
IMAGE_ENDINGS = (
    ".jpg .jpeg .tif .tiff .png .dng .raw .iiq .arw .cr2 .cr3 .nef .nrw .raf .rw2 .orf .3fr .fff"
    " .pef .srw .x3f .webp .jp2 .heic"
)
EVENTS: Names = {
    **TIME,
    "image": f"{IMAGES} event event_id id",
    "sigma_s": "sigma_s time_sigma_s sigma_time_s",
}
DATED: Names = {
    "image": f"{IMAGES} file_name image_name imagename photo_name sourcefile picture camera",
    "date": "date day gps_date gpsdate date_utc utc_date gpst_date",
    "time": "datetime date_time timestamp time utc gpst gps_time gpstime gps_datetime gpsdatetime"
    " utc_time time_utc timestamp_utc datetime_utc utc_datetime datetimeoriginal"
    " subsecdatetimeoriginal date_taken createdate gpst_time time_gpst datetime_gpst"
    " timestamp_gpst",
}
BAROMETER: Names = {
    **TIME,
    "h": "h height hgt alt altitude baro baro_alt baro_height",
    "pressure": "p press pressure baro_pressure static_pressure",
}
# points and poses by name, in the axes of a block or of a CRS
PLACES: Names = {
    "x": "x e east easting x_longitude x_easting easting_m",
    "y": "y n north northing y_latitude y_northing northing_m",
    "z": "z u up h height elevation z_altitude height_m",
    "sigma_x": f"{sigma_names('x e east easting east_m')} x_acc",
    "sigma_y": f"{sigma_names('y n north northing north_m')} y_acc",
    "sigma_z": f"{sigma_names('z u up h height elevation up_m')} z_acc",
}
# what Metashape's tables of references have besides; degrees or metres, as their CRS counts
_REFERENCE = "enabled error yaw pitch roll omega phi kappa " + spell_names(
    "x y z yaw pitch roll omega phi kappa", "error est"
)
OF_A_REFERENCE = {"x_longitude": _REFERENCE, "x_easting": _REFERENCE}
ROLE: Names = {"role": "role use type kind"}
IN_IMAGE: Names = {
    "image": "image img photo image_name image_id filename",
    "point": "point point_id point_name id pt label marker",
}


def _triads(stems: str) -> tuple[tuple[str, ...], ...]:
    """Names of the x, y and z component of a triad with these stems, as `inspect` takes them."""
    plain = stems.split()
    behind = [tuple(f"{stem}{k}" for k in axes) for stem in plain for axes in ("xyz", "123", "012")]
    before = [tuple(f"{axis}{stem}" for axis in "xyz") for stem in plain if len(stem) > 2]
    return (*behind, *before)


TRIADS = {
    "gyro": (
        ("p", "q", "r"),
        ("rollrate", "pitchrate", "yawrate"),
        *_triads(
            "g gyr gyro gyroscope w wb wrss omega rate angrate angularrate angularvelocity gyrorad"
            " rotationrate gyrorotation dtheta dang deltaangle delang imugyro imug"
        ),
    ),
    "accel": _triads(
        "a arss acc accel accelerometer acceleration linearacceleration linacc accelerometerms2"
        " totalacceleration accelerometeracceleration f fb specificforce dv dvel deltavelocity"
        " delvel imuaccel imuacc imua"
    ),
}
"""Triads by sensor as `inspect` takes them, without underscores, the best first."""
