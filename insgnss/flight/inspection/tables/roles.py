"""Which column of an unknown table is what: by its name where it has one, else by what its values
do.

A name decides where there is one that is known (`names`). Values decide only for `insgnss inspect`,
which reports what it found and why; the readers never guess. By values

    a clock      increases from row to row in nearly equal steps
    a GPS week   is a whole number of 500 to 4000, the same in all rows or one more after a while
    a triad      is three neighbouring columns; that of the accelerometer holds gravity, so its mean
                 is large against its scatter, the gyro's is small: the ratio |mean| / scatter tells
                 the two apart at rest and in flight

Positions without names are found in `places`, the codes of a quality in `quality`.
"""

from dataclasses import replace

import numpy as np

from ....io.formats.gnss.cartesian import GEOCENTRIC
from ....io.formats.gnss.fixes import MOST_QUALITY
from ....io.formats.gnss.rounding import floor_of_zeros, is_held
from ....records import Array
from .clocks import clocks, clocks_by_values, week_column, weeks
from .metres import as_geodetic, in_metres
from .names import ACCEL, GYRO, Roles, UnknownTable, squash_name
from .places import TENTH_MICRODEGREES, angle_unit, gnss_by_values
from .quality import codes_of, quality_by_values

PLURAL_OF_SENSOR = {"gyro": "gyros", "accel": "accelerometers"}
VELOCITY_SIGMAS = {"sd_vn", "sd_ve", "sd_vd"}
GEOCENTRIC_SIGMAS = {"sd_x", "sd_y", "sd_z"}
SIGMA_ROLES = {"sd_n", "sd_e", "sd_u", "sd_ne", "var_n", "var_e", "var_u"} | GEOCENTRIC_SIGMAS
OF_METRES = {*GEOCENTRIC, "north", "east", "down", "up", *GEOCENTRIC_SIGMAS}
OF_QUALITY = {"q", "quality"}  # names that mean RTKLIB's codes where nothing tells them
# least share of fixes with standard deviations: fewer are no kind of fixes (chosen)
STATED_SHARE = 0.1
# of a triad's mean to its scatter: gravity keeps an accelerometer's above it
MEAN_OVER_SCATTER = 0.8
RATIO_OF_SENSORS = 4.0  # times that the ratio of the accelerometer exceeds that of the gyro
# least correlation by which rates turn a vector; unrelated ones stay below 0.2
TURNING_CORRELATION = 0.3
TURN_PIECES = (20000, 5000, 1250, 300)  # means that a recording is cut into, to find the best one
# its size in usual units, and how near a median must be
GRAVITY_IN_UNITS, NEAR_GRAVITY = (9.8, 1.0, 1000.0), 0.15


def imu_roles(grid: UnknownTable) -> Roles | None:
    """Find gyro and accelerometer of a table; None where it has none."""
    named_columns = grid.triad("gyro") | grid.triad("accel")
    if len(named_columns) == 6:
        ticks, how = clocks(grid, 0.5), Roles.how
        if not ticks:
            ticks, how = (
                clocks_by_values(grid, 0.5, set(named_columns.values())),
                f"{Roles.how}, the clock by its values",
            )
        return Roles(named_columns, ticks, week_column(grid), how=how if ticks else Roles.how)
    if any(name is not None for name in grid.names):
        return None
    ticks = clocks(grid, 0.5)
    pair = _two_triads(grid.values, {*ticks, *weeks(grid)})
    if pair is None:
        return None
    gyro, accel = pair
    columns = {
        c: first + k for first, triad in ((gyro, GYRO), (accel, ACCEL)) for k, c in enumerate(triad)
    }
    return Roles(
        columns,
        ticks,
        week_column(grid),
        how="recognised by their values: one triad of columns has gravity, the other not",
    )


def has_gravity(grid: UnknownTable, roles: Roles) -> bool:
    """Tell whether the force of samples has the size of gravity in a usual unit."""
    return _of_gravity(grid.values[:, [roles.columns[c] for c in ACCEL]])


def triads_named(grid: UnknownTable) -> list[str]:
    """Return which of gyros and accelerometers the names of the columns show."""
    return [name for key, name in PLURAL_OF_SENSOR.items() if grid.triad(key)]


def _two_triads(values: Array, used_columns: set[int]) -> tuple[int, int] | None:
    """Return the first columns of gyro and accelerometer among those that change."""
    rows = values[:: max(1, len(values) // 20000)]
    changes = [
        column not in used_columns and float(np.ptp(rows[:, column])) > 0.0
        for column in range(values.shape[1])
    ]
    if (pair := _triads_between_constants(rows, changes)) is not None:
        return pair
    best_pair: tuple[float, int, int] | None = None
    for first_column in range(values.shape[1] - 5):
        if not all(changes[first_column : first_column + 6]):
            continue
        ratio = [
            _mean_over_scatter(rows[:, column : column + 3])
            for column in (first_column, first_column + 3)
        ]
        gap = max(ratio) / max(min(ratio), 1e-12)
        if (
            gap > RATIO_OF_SENSORS
            and max(ratio) > MEAN_OVER_SCATTER
            and (best_pair is None or first_column == 0 or not changes[first_column - 1])
        ):
            order = (
                (first_column + 3, first_column)
                if ratio[0] > ratio[1]
                else (first_column, first_column + 3)
            )
            best_pair = best_pair or (gap, *order)
    return None if best_pair is None else best_pair[1:]


def _triads_between_constants(rows: Array, alive: list[bool]) -> tuple[int, int] | None:
    """First column of gyro and accelerometer where there are three triads or more, in any order.

    The accelerometer has the size of gravity and is the steadiest of those that have it. The gyro
    is the triad that turns the others best: of a vector v that stands still outside, such as the
    magnetic field, the derivative is v x rate. None where there are fewer, or no gravity.
    """
    triads, first = list[int](), 0
    while first + 3 <= len(alive):
        all_change = all(alive[first : first + 3])
        triads += [first] * all_change
        first += 3 if all_change else 1
    data = {k: rows[:, k : k + 3] for k in triads}
    heavy = [
        k
        for k in triads
        if _of_gravity(data[k]) and _mean_over_scatter(data[k]) > MEAN_OVER_SCATTER
    ]
    if len(triads) < 3 or not heavy:
        return None
    accel = max(heavy, key=lambda k: _mean_over_scatter(data[k]))
    turned = {
        gyro: max(_rotation_correlation(data[k], data[gyro]) for k in triads if k != gyro)
        for gyro in triads
        if gyro != accel
    }
    gyro = max(turned, key=lambda k: turned[k])
    if turned[gyro] < TURNING_CORRELATION:
        gyro = min(turned, key=lambda k: _mean_over_scatter(data[k]))
    return gyro, accel


def _rotation_correlation(vector: Array, rates: Array) -> float:
    """Return the correlation of a vector's increments with those that rates give it.

    Both are (n, 3). It is the largest of several lengths of means: short ones hold vibration, long
    ones whole turns.
    """
    largest = 0.0
    for pieces in TURN_PIECES:
        edges = np.arange(0, len(vector), max(1, len(vector) // pieces))
        lengths = np.diff(edges, append=len(vector))[:, None]
        mean_vector, mean_rate = (
            np.add.reduceat(values, edges) / lengths for values in (vector, rates)
        )
        increments, expected = (
            np.diff(mean_vector, axis=0).ravel(),
            np.cross(mean_vector, mean_rate),
        )
        expected = (expected[1:] + expected[:-1]).ravel()
        norms = float(np.linalg.norm(increments) * np.linalg.norm(expected))
        largest = max(largest, float(increments @ expected) / norms if norms else 0.0)
    return largest


def _of_gravity(force: Array) -> bool:
    """Tell whether a force (n, 3) has the size of gravity in a usual unit."""
    size = float(np.median(np.linalg.norm(force, axis=1)))
    return any(abs(np.log(max(size, 1e-12) / g)) < NEAR_GRAVITY for g in GRAVITY_IN_UNITS)


def _mean_over_scatter(triad: Array) -> float:
    """|mean| / scatter."""
    return float(
        np.linalg.norm(np.mean(triad, axis=0)) / max(np.sqrt(np.sum(np.var(triad, axis=0))), 1e-30)
    )


def gnss_roles(grid: UnknownTable) -> Roles | None:
    """Find positions and what else a receiver gives; None where the table has no positions."""
    if (twin := as_geodetic(grid)) is not None:
        roles = gnss_roles(twin[0])
        return None if roles is None else in_metres(roles, twin[1])
    columns = {name: k for name, k in grid.of_fixes().items() if name not in OF_METRES}
    if {"lat", "lon", "h"} <= columns.keys():
        return _roles_with_units(grid, columns)
    return None if any(name is not None for name in grid.names) else fixes_by_values(grid)


def _roles_with_units(grid: UnknownTable, columns: dict[str, int]) -> Roles:
    """Named columns with their units, and what marks a new fix where the last one is held."""
    named, unread = columns, dict[str, str]()

    def without(reasons: dict[str, str]) -> dict[str, int]:
        unread.update(reasons)
        return {role: column for role, column in columns.items() if role not in reasons}

    columns = without(_not_finite(grid, columns))
    columns = without(_unused_velocity(columns))
    columns = without(_unusable_sigmas(grid, columns))
    units = {"angle": angle_unit(grid, columns["lat"], columns["lon"])}
    columns = without(_quality(grid, columns, units))
    height = grid.values[:, columns["h"]]
    if (
        units["angle"] == TENTH_MICRODEGREES
        and grid.unit_of(columns["h"], "length") is None
        and (height == np.round(height)).all()
    ):
        units["length"] = "mm"  # receivers that count so write whole millimetres
        sigmas = grid.values[:, [column for name, column in columns.items() if name in SIGMA_ROLES]]
        if not (sigmas == np.round(sigmas)).all():
            units["sigma"] = "m"
        speeds = [
            column for name, column in columns.items() if name in ("vn", "ve", "vd", "vu", "speed")
        ]
        if speeds and (grid.values[:, speeds] == np.round(grid.values[:, speeds])).all():
            units["velocity"] = "mm/s"
    if "course" in columns:
        # loggers name it wrongly
        largest = np.abs(grid.values[:, columns["course"]]).max()
        units["course"] = "rad" if 0.0 < largest <= 6.3 else "deg"
    ticks = clocks(grid, 30.0) or clocks_by_values(grid, 30.0, set(columns.values()))
    repeat_column = _repeat_column(grid, columns, ticks)
    ticks = {column: unit for column, unit in ticks.items() if column != repeat_column}
    reasons = {named[role]: f"{role}: {why}" for role, why in unread.items() if role in named}
    return Roles(columns, ticks, week_column(grid), units, repeat_column, unread=reasons)


def _repeat_column(
    grid: UnknownTable, columns: dict[str, int], ticks: dict[int, str]
) -> int | None:
    """Column that changes with each new fix, where rows hold the last one; else None.

    It is a clock that stands still with the position where there is one, else the latitude.
    """
    fix = {role: grid.values[:, k] for role, k in columns.items()}
    repeated = (np.diff(fix["lat"]) == 0.0) & (np.diff(fix["lon"]) == 0.0)
    if not repeated.size or not repeated.mean() > 0.5:
        return None
    marks = [k for k in ticks if np.mean((np.diff(grid.values[:, k]) != 0.0) == ~repeated) > 0.95]
    if marks and len(ticks) > 1:
        return marks[0]
    further = [column for role, column in fix.items() if role not in ("lat", "lon")]
    return columns["lat"] if is_held((fix["lat"], fix["lon"]), further) else None


def _unused_velocity(columns: dict[str, int]) -> dict[str, str]:
    """Columns of a velocity that are of no use beside the others, with the reason."""
    up = {"vd", "vu"} & columns.keys()
    triad, polar, sigmas = {"vn", "ve"}, {"speed", "course"}, VELOCITY_SIGMAS
    if triad <= columns.keys() and up:
        unused = dict.fromkeys(polar, "vn ve and the vertical are taken")
    elif polar <= columns.keys():
        unused = dict.fromkeys(triad | sigmas, "speed and course are taken")
    else:
        unused = dict.fromkeys(
            triad | polar | sigmas | {"vd", "vu", "sd_v"},
            "velocity incomplete: vn, ve and vd or vu are needed, or speed and course",
        )
    return {role: why for role, why in unused.items() if role in columns}


def _not_finite(grid: UnknownTable, columns: dict[str, int]) -> dict[str, str]:
    """Columns that a fix can do without and that are no number in some rows, with the reason."""
    return {
        role: f"no number in {count} of {len(grid.values)} rows"
        for role, k in columns.items()
        if role not in ("lat", "lon", "h")
        and (count := int((~np.isfinite(grid.values[:, k])).sum()))
        and not (role in SIGMA_ROLES and count < (1.0 - STATED_SHARE) * len(grid.values))
    }


def _unusable_sigmas(grid: UnknownTable, columns: dict[str, int]) -> dict[str, str]:
    """Standard deviations that are of no use, with the reason.

    They are not positive, or double where those of north, east and up exist. Zeros that are rounded
    numbers are of use, and zeros, or what is no number, of some of the fixes, as of one kind of
    several.
    """
    reasons = {}
    for role, k in columns.items():
        column = np.nan_to_num(grid.values[:, k])
        if not role.startswith(("sd_", "var_")) or column.min() > 0.0:
            continue
        if role in SIGMA_ROLES and column.min() == 0.0 and (column > 0.0).mean() > STATED_SHARE:
            continue  # of some kinds of fixes: `sigma_m` serves the rest
        if role.startswith("var_") or floor_of_zeros(column) is None:
            reasons[role] = f"not above 0 in {int((column <= 0.0).sum())} of {column.size} rows"
    velocities = {role for role in columns if role in VELOCITY_SIGMAS}
    if not columns.keys() - reasons.keys() >= VELOCITY_SIGMAS:
        reasons = dict.fromkeys(velocities, "not all three are of use") | reasons
    elif "sd_v" in columns:
        reasons["sd_v"] = "others are taken"
    of_place = {role for role in columns if role in SIGMA_ROLES}
    for complete in ({"sd_n", "sd_e", "sd_u"}, {"sd_ne", "sd_u"}, {"var_n", "var_e", "var_u"}):
        if complete <= columns.keys() - reasons.keys():
            return dict.fromkeys(of_place - complete, "others are taken") | reasons
    return dict.fromkeys(of_place, "not all three are of use") | reasons


def _quality(grid: UnknownTable, columns: dict[str, int], units: dict[str, str]) -> dict[str, str]:
    """Set the unit of the quality where its codes are not RTKLIB's; or why it is left out."""
    if "q" not in columns:
        return {}
    column, name = grid.values[:, columns["q"]], grid.names[columns["q"]] or ""
    if not np.isin(column, range(MOST_QUALITY + 1)).all():
        return {"q": f"no codes of a quality, up to {column.max():g}"}
    sigma = next(
        (grid.values[:, columns[r]] for r in ("sd_n", "sd_ne", "var_n") if r in columns), None
    )
    codes = None if sigma is None else codes_of(column, sigma)
    if codes == "nmea":
        units["quality"] = codes
    elif codes is None and squash_name(name) not in OF_QUALITY:
        return {"q": "a quality whose codes may be RTKLIB's or NMEA's, which contradict each other"}
    return {}


def fixes_by_values(grid: UnknownTable) -> Roles | None:
    """Find positions by the values, and a quality by the standard deviations beside them."""
    roles = gnss_by_values(grid)
    if roles is None or "sd_n" not in roles.columns:
        return roles
    used_columns = {*roles.columns.values(), *roles.clocks, *weeks(grid)}
    match = quality_by_values(grid, used_columns, grid.values[:, roles.columns["sd_n"]])
    if match is None:
        return roles
    k, codes = match
    units = roles.units | ({"quality": codes} if codes == "nmea" else {})
    return replace(roles, columns=roles.columns | {"q": k}, units=units)
