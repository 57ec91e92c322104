r"""What may lie between positions.

There are candidates for the horizontal and for the height, each taken off b.

With d = b - a (n, 3), east, north, up at a's points:

    shift         mean of d, in these axes or in ECEF         datum, base station, height system
    lever arm     C_Ex l, l by least squares of all three     antenna, IMU, camera for each other
    time          v dt, dt by least squares along the way     trigger delay (matched by name)
    turn, scale   about the block's centre, least squares     grid for true north, grid scale
    exchange      b made anew of other coordinates            axes, signs, lat for lon, units

A lever arm stands alone where a shift h of the heights beside it leaves hardly less: of two
explanations the one. Else both are estimated, d = C_Ex l + (0, 0, h), where the attitude varies
enough to tell them apart: with c the vertical in the axes of the camera or body, what they leave is
small over sqrt(1 - |mean c|^2). Where it does not, or the heights err in another way, l is that of
the horizontal differences, and is taken off them alone.

A shift of the heights is stated with that of the horizontal, unless it is as large as a geoid's. A
turn or scale is stated only if it moves the block by what anyone asks about, and by more than a
constant shift varies over the axes of its points.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.units import FOOT_M, METRE, US_FOOT_M
from ...geodesy.conventions import METRES_OF, exchanged_orders, lengths, reversed_signs
from ...geodesy.explain import EXPLAINS, LEAST_MISFIT_RATIO, Candidate
from ...geodesy.frames import ecef_to_geodetic
from ...records import Array
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from .hypotheses import WRITTEN_DIGITS, recognise_difference, rms, taken_off
from .matching import Matched
from .poses import CoordinateFrame, Poses
from .result import Mismatch

Change = Callable[[Array], Array]

LEAST_RMS_M = 0.005  # rms below which nobody asks why
GEOID_M = (5.0, 110.0)  # geoid heights that are stated as such; they run from -107 to +86 m
GEOID_SPREAD = 0.02  # of them, by which they may vary over a flight
LEVER_M = 10.0  # no vehicle is longer
# findings on heights of another unit or sign
HEIGHTS_OTHERWISE = (*METRES_OF, "metres for feet", "height reversed")
SHIFT_M = 2e4  # longest shift: datums lie within 1 km, base stations of drones within this
HEIGHT_M = 5e3  # longest shift of heights: those above the place of take-off lack its height
LARGEST_SCALE = (
    0.01  # largest scale of a grid: the widest zones and the highest plateaus have 0.2 %
)
WAY_S = 30.0  # longest time along the way, over which no velocity is constant
# what a lever arm's vertical part may be uncertain by, where it is separated from a height shift
SEPARATE_M = 0.02
SMALLEST = 1e-6  # of a turn, rad, or scale; below it there is none
# what a turn or scale must do, of the shift beside it: so much a constant vector turns over 6 km
OF_SHIFT = 1e-3
# singular values below this part of the largest: a lever arm along the vertical does not show in
# the horizontal
SMALLEST_SINGULAR = 0.2
FEET = {  # what a coordinate in one foot, read as the other, is multiplied by
    "international feet, read as US survey feet": FOOT_M / US_FOOT_M,
    "US survey feet, read as international feet": US_FOOT_M / FOOT_M,
}
ONE_PLACE_RAD = 2e-3  # of latitude and longitude, within which both files are of one place: 11 km
# name and words of a wrong geographic reading; factors of latitude and longitude
DEGREE_MISTAKES = {
    "longitude reversed": ("longitudes with the other sign (west of Greenwich)", 1.0, -1.0),
    "latitude reversed": ("latitudes with the other sign (south of the equator)", -1.0, 1.0),
    "radians": ("latitude and longitude in radians", np.degrees(1.0), np.degrees(1.0)),
    "gon": ("latitude and longitude in gon", 0.9, 0.9),
}
CAMERA_DIRECTIONS, BODY_AXES = ("right", "down", "view"), ("forward", "right", "down")


def difference(a: Poses, b: Poses) -> Array:
    """(n, 3) m, b minus a, in the axes east, north, up at a."""
    return np.einsum("nji,nj->ni", a.C_eE, b.ecef - a.ecef)


def without(a: Poses, b: Poses, by: Array) -> Poses:
    """b with (n, 3) m, in the axes east, north, up at a, taken off."""
    return b.moved(*ecef_to_geodetic(b.ecef - np.einsum("nij,nj->ni", a.C_eE, by)))


def horizontal(matched: Matched) -> tuple[Mismatch, Matched] | None:
    """What explains the horizontal differences, and the match with it taken off b."""
    candidates = horizontal_and_time if matched.how == "image" else _horizontal
    return recognise_difference(
        "horizontal", matched, lambda x, y: difference(x, y)[:, :2], candidates, LEAST_RMS_M
    )


def heights_first(a: Poses, b: Poses) -> bool:
    """Whether heights are to be explained before the horizontal.

    Heights that are off by more than any geoid move the points of a projected CRS: the normals of
    two ellipsoids differ by seconds of arc.
    """
    return b.projection is not None and float(np.abs(b.height - a.height).min()) > GEOID_M[1]


def vertical(matched: Matched) -> tuple[Mismatch, Matched] | None:
    """What explains the differences in height, and the match with it taken off b."""

    def up(x: Poses, y: Poses) -> Array:
        return (y.height - x.height)[:, None]

    return recognise_difference("height", matched, up, _vertical, LEAST_RMS_M)


def _horizontal(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    d = difference(a, b)
    yield from _exchanges(a, b)
    yield from _shift(a, b, d)
    yield from _lever_arm(a, b, d)
    yield from _of_block(a, d[:, :2])


def horizontal_and_time(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    """Candidates for the horizontal of images that were matched by name."""
    yield from _horizontal(a, b)
    yield from _along_the_way(a, b, difference(a, b)[:, :2])


def _shift(a: Poses, b: Poses, d: Array) -> Iterator[Candidate[Matched]]:
    """The same in the axes of each point, and the same in ECEF.

    With the heights where those are shifted too.
    """
    mean, up = d.mean(axis=0), d[:, 2]
    also_up = abs(mean[2]) < GEOID_M[0] and float(up.std()) <= max(
        LEAST_RMS_M, EXPLAINS * rms(up[:, None])
    )
    kept = 0.0 if also_up else float(mean[2])
    by, vector = mean - [0.0, 0.0, kept], (b.ecef - a.ecef).mean(axis=0)
    named = list(
        zip("ENU" if also_up else "EN", ("east", "north", "up"), by.tolist(), strict=False)
    )
    shifts = " ".join(f"{axis} {value:+.3f}" for axis, _, value in named)
    text = f"a constant shift of {shifts} m (another datum, realisation or base station)"
    values = {f"{name}_m": value for _, name, value in named}

    def off_ecef(_: Poses, q: Poses) -> Poses:
        lat, lon, height = ecef_to_geodetic(q.ecef - vector)
        return q.moved(lat, lon, height + kept)

    size = float(np.linalg.norm(by)) / SHIFT_M
    for shifted in (lambda x, y: without(x, y, np.tile(by, (x.n, 1))), off_ecef):
        yield taken_off("shift", text, shifted, 2, values, size)


def _lever_arm(a: Poses, b: Poses, d: Array) -> Iterator[Candidate[Matched]]:
    """In the axes of a's camera or body, or of b's where a has no attitude."""
    if (axes := _axes_of(a, b)) is None:
        return
    lever, whole, doubtful = _lever(axes, d)
    x = a.x if a.C_Ex is not None else b.x
    names = CAMERA_DIRECTIONS if x == "camera" else BODY_AXES
    components = " ".join(f"{name} {value:+.3f}" for name, value in zip(names, lever, strict=True))
    text = (
        f"a lever arm of {components} m in the axes of the {x} (b is of another point than a:"
        " antenna, IMU or camera"
    )
    text += "; its vertical part cannot be separated from a height shift)" if doubtful else ")"

    def change(p: Poses, q: Poses) -> Poses:
        turned = _axes_of(p, q)
        assert turned is not None
        return without(p, q, (turned @ lever) * [1.0, 1.0, 1.0 if whole else 0.0])

    values = {f"{name}_m": float(value) for name, value in zip(names, lever, strict=True)}
    yield taken_off("lever arm", text, change, 3, values, float(np.linalg.norm(lever)) / LEVER_M)


def _lever(axes: Array, d: Array) -> tuple[Array, bool, bool]:
    """Lever arm (3,) m of axes (n, 3, 3).

    Whether it is of all three components; whether its vertical part might be a height shift.
    """

    def left(lever: Array, rows: slice = slice(3), up: float = 0.0) -> float:
        return rms((d - axes @ lever - [0.0, 0.0, up])[:, rows]) + WRITTEN_DIGITS["m"]

    tall, plan = axes.reshape(-1, 3), slice(2)
    beside = np.column_stack([tall, np.tile([0.0, 0.0, 1.0], len(d))])
    alone, joint = (_least_squares(A, d.ravel()) for A in (tall, beside))
    across, regularised = (
        _least_squares(axes[:, :2].reshape(-1, 3), d[:, :2].ravel(), rcond)
        for rcond in (None, SMALLEST_SINGULAR)
    )
    reach = SEPARATE_M * np.sqrt(max(0.0, 1.0 - float(np.sum(axes[:, 2].mean(axis=0) ** 2))))
    least = LEAST_MISFIT_RATIO * left(across, plan)
    separable = left(joint[:3], up=joint[3]) <= reach
    if (
        np.linalg.norm(alone) <= LEVER_M
        and left(alone) <= LEAST_MISFIT_RATIO * left(joint[:3], up=joint[3])
        and left(alone, plan) <= least
    ):
        return alone, True, not separable
    if separable and left(joint[:3], plan) <= least:
        return joint[:3], True, False
    return (across, False, False) if left(across, plan) <= reach else (regularised, False, True)


def _least_squares(A: Array, y: Array, rcond: float | None = None) -> Array:
    return np.asarray(np.linalg.lstsq(A, y, rcond=rcond)[0])


def _axes_of(a: Poses, b: Poses) -> Array | None:
    return a.C_Ex if a.C_Ex is not None else b.C_Ex


def _of_block(a: Poses, d: Array) -> Iterator[Candidate[Matched]]:
    """Turn and scale about the block's centre, beside its shift."""
    centre, C_Ee = a.ecef.mean(axis=0), a.C_eE.mean(axis=0).T
    mean = d.mean(axis=0)

    def from_centre(p: Poses) -> Array:
        return np.asarray(((p.ecef - centre) @ C_Ee.T)[:, :2])

    def across(p: Poses) -> Array:
        return from_centre(p)[:, ::-1] * [-1.0, 1.0]

    size = float(np.sum(from_centre(a) ** 2))
    if size < 1.0:
        return
    angle, scale = (float(np.sum(x * (d - mean)) / size) for x in (across(a), from_centre(a)))

    def by(field: Callable[[Poses], Array], value: float) -> Callable[[Poses, Poses], Poses]:
        return lambda p, q: without(p, q, np.column_stack([mean + value * field(p), np.zeros(p.n)]))

    shift = float(np.linalg.norm(mean))
    least, beside = max(LEAST_RMS_M, OF_SHIFT * shift) / np.sqrt(size / a.n), shift / SHIFT_M
    if abs(angle) >= max(SMALLEST, least):
        text = f"a turn of the block by {np.degrees(angle):+.4f} deg about up (grid for true north)"
        values = {"up_rad": angle}
        yield taken_off("turn of the block", text, by(across, angle), 3, values, beside)
    if abs(scale) >= max(SMALLEST, least):
        text = (
            f"a scale of {1e6 * scale:+.1f} ppm (distances in a grid for distances on the ground)"
        )
        values, beyond = {"scale": scale}, max(beside, abs(scale) / LARGEST_SCALE)
        yield taken_off("scale", text, by(from_centre, scale), 3, values, beyond)


def _along_the_way(a: Poses, b: Poses, d: Array) -> Iterator[Candidate[Matched]]:
    """An offset of time between images that were matched by name."""
    v = velocity_of(a, b)
    if v is None or not (speed := float(np.sum(v[:, :2] ** 2))) > 0.0:
        return
    dt = float(np.sum(v[:, :2] * d) / speed)
    text = (
        f"positions of b taken {1e3 * abs(dt):.1f} ms {'later' if dt > 0 else 'earlier'} along the"
        " way (trigger delay, clock)"
    )

    def change(p: Poses, q: Poses) -> Poses:
        way = velocity_of(p, q)
        assert way is not None
        return without(p, q, dt * way)

    yield taken_off("time along the way", text, change, 1, {"seconds": dt}, dt / WAY_S)


def velocity_of(a: Poses, b: Poses) -> Array | None:
    """(n, 3) m/s, east, north, up: a's own, else b's, else from a's positions over time.

    None without time.
    """
    for poses in (a, b):
        if poses.velocity is not None:
            return poses.velocity
    if a.time is None or a.n < 3:
        return None
    return np.asarray(np.einsum("nji,nj->ni", a.C_eE, np.gradient(a.ecef, a.time, axis=0)))


def _exchanges(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    """Coordinates of b in another order, with other signs, in another unit."""
    if np.abs(b.lon).max() <= 0.5 * np.pi:
        text = "b has latitude and longitude exchanged"
        yield taken_off(
            "latitude for longitude", text, lambda _, q: q.moved(q.lon, q.lat, q.height)
        )
    for name, (statement, lat, lon) in DEGREE_MISTAKES.items():
        angle = np.abs([a.lat - lat * b.lat, a.lon - lon * b.lon]).max()
        if b.projection is None and angle < ONE_PLACE_RAD:
            yield taken_off(name, f"b has {statement}", _times(lat, lon))
    if b.local is None or (b.plane is None and b.projection is None):
        return
    if b.projection is not None and b.projection.units[0] != METRE:
        for feet, factor in FEET.items():
            change = _factors(factor)
            if _nearer(a, b, change(b.local)):
                yield taken_off("foot for foot", f"b has {feet}", _read_anew(change))
    for one in (
        *exchanged_orders(("east", "north")),
        *reversed_signs(("east", "north", "")),
        *lengths("coordinates", ("feet",)),
    ):
        if b.projection is None or _nearer(a, b, one.change(b.local)):
            yield taken_off(one.name, f"b has {one.words}", _read_anew(one.change))
    for text, order in (("longitude and latitude", [0, 1]), ("latitude and longitude", [1, 0])):
        degrees = b.local[:, order]
        if b.projection is None and (np.abs(degrees).max(axis=0) <= [180.0, 90.0]).all():
            text = f"b has {text} in degrees that were read as metres; name their CRS (--crs)"
            yield taken_off("degrees for metres", text, _read_anew(_radians(order), GEOGRAPHIC))


def _times(lat: float, lon: float) -> Callable[[Poses, Poses], Poses]:
    """Latitude and longitude times factors."""
    return lambda _, poses: poses.moved(lat * poses.lat, lon * poses.lon, poses.height)


def _factors(factor: float) -> Change:
    """Plan coordinates times a factor."""
    return lambda x: x * [factor, factor, 1.0]


def _radians(order: list[int]) -> Change:
    """Longitude, latitude, height of columns in degrees, in this order."""
    return lambda x: np.column_stack([np.radians(x[:, order]), x[:, 2]])


def _nearer(a: Poses, b: Poses, local: Array) -> bool:
    """Whether other coordinates of a projected CRS lie nearer to those of a than b's do.

    Asked before they are taken to the globe, where each place looks for its own grids.
    """
    assert b.projection is not None
    assert b.local is not None
    try:
        x = b.projection.forward_horizontal(a.lat, a.lon, a.height)
    except InputError:  # the CRS does not reach a; then any order may
        return True
    distance, turned = (float(np.median(np.abs(y[:, :2] - x))) for y in (b.local, local))
    return turned < distance


def _read_anew(change: Change, kind: str | None = None) -> Callable[[Poses, Poses], Poses]:
    """Other coordinates of the frame, or of one of another kind.

    Attitudes stay what they were in the frame's axes.
    """

    def read(_: Poses, q: Poses) -> Poses:
        assert q.local is not None
        local = change(q.local)
        own_frame = PROJECTED if q.projection is not None else TANGENT
        frame = CoordinateFrame(kind or own_frame, q.plane, q.projection)
        lat, lon, h, C_fE = frame.resolved(local, q.source)
        moved = replace(q.moved(lat, lon, h), local=local)
        if q.C_fE is None:  # attitudes of true north
            return moved
        C_Ex = None if q.C_Ex is None else np.swapaxes(C_fE, 1, 2) @ q.C_fE @ q.C_Ex
        return replace(moved, C_Ex=C_Ex, C_fE=C_fE)

    return read


def _vertical(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    d = b.height - a.height
    mean = float(d.mean())
    name, text = _in_words(mean, d)
    values, size = {"up_m": mean}, mean / HEIGHT_M
    yield taken_off(
        name, text, lambda _, q: q.moved(q.lat, q.lon, q.height - mean), 1, values, size
    )
    metres = "heights of a are in feet where b has metres"
    if b.projection is not None and b.projection.units[1] != METRE:
        metres = "heights of b are in metres, not in the feet of its CRS"
    for name, text, factor in (
        *((u, f"heights of b are in {u} where a has metres", f) for u, f in METRES_OF.items()),
        ("metres for feet", metres, 1.0 / FOOT_M),
        ("height reversed", "b counts heights downwards", -1.0),
    ):
        if float(np.median(np.abs(factor * b.height - a.height))) < GEOID_M[1]:
            yield taken_off(name, text, _scaled(factor))


def _scaled(factor: float) -> Callable[[Poses, Poses], Poses]:
    """Other heights; of a projected CRS they also decide where the datum's shift puts a point."""

    def read(p: Poses, q: Poses) -> Poses:
        if q.projection is None or q.local is None:
            return q.moved(q.lat, q.lon, factor * q.height)
        return _read_anew(lambda x: x * [1.0, 1.0, factor])(p, q)

    return read


def _in_words(mean: float, d: Array) -> tuple[str, str]:
    """Name and statement of a constant difference in height."""
    text = (
        f"heights of b lie {abs(mean):.3f} m {'above' if mean > 0 else 'below'} those of a,"
        " everywhere alike"
    )
    if not (GEOID_M[0] <= abs(mean) <= GEOID_M[1] and float(d.std()) < GEOID_SPREAD * abs(mean)):
        return "height shift", text
    sea, ellipsoidal = ("a", "b") if mean > 0 else ("b", "a")
    return (
        "geoid-sized height",
        (
            f"{text}: the size of a geoid height ({sea} above sea level, {ellipsoidal} above the"
            " ellipsoid?)"
        ),
    )
