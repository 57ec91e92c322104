r"""What may lie between attitudes.

Each candidate is taken off b, and judged by the angle that remains to a.

    axes of the camera or body    C_b Q^T,       Q one of the 23 rotations by right angles     (A.1)
    axes of the frame             Q^T C_b        likewise; both, where both differ         (A.2)
    inverse                       C_fE^T X R^T X, R = C_fE C_b X: the file's matrix transposed, of
                                  camera axes X right, down, view or right, up, back          (A.3)
    angles                        C_b of its angles in another order, with other signs, another unit
                                  or of another set (A.4)
    constant turn                 about up, in the frame's axes or in those of the camera      (A.5)

Constant turns have parameters and stand back where one without explains as much; one of them may
come after one without, such as grid north after a quarter turn.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...geodesy.conventions import BODY_SETS, CAMERA_SETS, angles, turned_by
from ...geodesy.explain import Candidate
from ...geodesy.rotation import (
    CV_RUB,
    NED_ENU,
    nearest_rotation,
    right_angle_rotations,
    rotation_from_vector,
    vector_from_rotation,
)
from ...records import Array
from .hypotheses import recognise_difference, taken_off
from .matching import Matched
from .poses import Poses
from .position import BODY_AXES, CAMERA_DIRECTIONS
from .result import Mismatch

Change = Callable[[Array], Array]

LEAST_RAD = float(np.radians(0.003))  # rms below which nobody asks why
SMALL_RAD = float(np.radians(10.0))  # a greater constant turn is none of a bore-sight or of a grid
UNTURNED = np.eye(3)  # the rotation that leaves axes as they are
ENU_NAMES = ("east", "north", "up")
TURNED_AXES = {
    "camera": ("right", "down", "its viewing direction"),
    "body": ("forward", "right", "down (yaw)"),
}


def attitude(matched: Matched) -> tuple[Mismatch, Matched] | None:
    """What explains the differences in attitude, and the match with it taken off b."""
    if matched.a.C_Ex is None or matched.b.C_Ex is None:
        return None
    return recognise_difference("attitude", matched, turn_between, _candidates, LEAST_RAD)


def turn_between(a: Poses, b: Poses) -> Array:
    """(n, 3) rad: psi of b against a, C_b = exp([psi x]) C_a, in the axes east, north, up."""
    assert a.C_Ex is not None
    assert b.C_Ex is not None
    return vector_from_rotation(b.C_Ex @ np.swapaxes(a.C_Ex, 1, 2))


def _candidates(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    yield from _axes(b)
    yield from _angles(b)
    yield from _constant(a, b)


def _rotation_taken_off(left_factor: Array, right_factor: Array) -> Callable[[Poses, Poses], Poses]:
    """What takes off turns of the frame and of its own axes; the file's angles go with them."""

    def turned(_: Poses, b: Poses) -> Poses:
        assert b.C_Ex is not None
        return replace(b, C_Ex=left_factor @ b.C_Ex @ right_factor, angles=None)

    return turned


def _axes(b: Poses) -> Iterator[Candidate[Matched]]:
    """(A.1) to (A.3)."""
    for Q in right_angle_rotations()[1:]:
        yield taken_off(*_of_own_axes(Q, b.x), _rotation_taken_off(UNTURNED, Q.T))
        yield taken_off(*_of_the_frame(Q), _rotation_taken_off(Q.T, UNTURNED))
    text = (
        "b is of north-east-down and forward-right-down where a is of east-north-up and"
        " right-forward-up"
    )
    yield taken_off("frame and body axes", text, _rotation_taken_off(NED_ENU, NED_ENU))
    yield taken_off(
        "inverse", f"b has the inverse rotation, frame to {b.x}", _transposition_taken_off(UNTURNED)
    )
    if b.x == "camera":
        text = "b has the transposed matrix, frame to camera with axes right, up, back"
        yield taken_off("inverse", text, _transposition_taken_off(CV_RUB))


def _transposition_taken_off(X: Array) -> Callable[[Poses, Poses], Poses]:
    """Return what takes off the transposition of a file's matrix R = C_fE C_b X (A.3)."""

    def transposed(_: Poses, b: Poses) -> Poses:
        assert b.C_Ex is not None
        C_fE = np.eye(3) if b.C_fE is None else b.C_fE
        R = C_fE @ b.C_Ex @ X
        C = np.swapaxes(C_fE, -1, -2) @ np.swapaxes(R, 1, 2) @ X
        return replace(b, C_Ex=C, angles=None)

    return transposed


def _of_own_axes(Q: Array, x: str) -> tuple[str, str]:
    """Name and statement of (A.1)."""
    if x == "camera" and np.array_equal(Q, CV_RUB):
        text = "are right, up, back where those of a are right, down, viewing direction"
        return "camera axes", f"camera axes of b {text}"
    text = f"{x} of b turned by {turned_by(Q, TURNED_AXES[x])}"
    if Q[2, 2] < 1.0:
        return f"axes of the {x}", text
    return "yaw turned", text + (" (yaw; top of the image for the nose?)" if x == "camera" else "")


def _of_the_frame(Q: Array) -> tuple[str, str]:
    """Name and statement of (A.2)."""
    if Q[2, 2] == 1.0:
        yaw = round(-float(np.degrees(vector_from_rotation(Q)[2])))
        return "yaw turned", f"yaw of b, clockwise from north, is {yaw:+d} deg off that of a"
    note = " (north, east, down for east, north, up)" if np.array_equal(Q, NED_ENU) else ""
    return (
        "axes of the frame",
        f"attitude of b in a frame turned by {turned_by(Q, ENU_NAMES)}{note}",
    )


def _angles(b: Poses) -> Iterator[Candidate[Matched]]:
    """(A.4)."""
    sets = CAMERA_SETS if b.x == "camera" else BODY_SETS
    for read_as in [sets[b.angle_set]] if b.angle_set in sets else sets.values():
        for one in angles(read_as, sets):
            yield taken_off(one.name, f"b has {one.words}", _on_angles(read_as.take, one.change))


def _on_angles(take: Change, rotation: Change) -> Callable[[Poses, Poses], Poses]:
    """Make the rotations anew of the angles (n, 3), rad, of the file, else of the rotations."""

    def turned(_: Poses, b: Poses) -> Poses:
        x = b.angles if b.angles is not None else take(_of_the_angles(b))
        return replace(b, C_Ex=_from_the_angles(b, rotation(x)), angles=None)

    return turned


def _of_the_angles(b: Poses) -> Array:
    """The rotation of which the angles of the file are.

    It is camera right-up-back into the frame's axes, or body into NED.
    """
    assert b.C_Ex is not None
    if b.x == "body":
        return NED_ENU @ b.C_Ex
    C = b.C_Ex @ CV_RUB
    return C if b.C_fE is None else b.C_fE @ C


def _from_the_angles(b: Poses, R: Array) -> Array:
    """C_Ex of the rotation of a file's angles."""
    if b.x == "body":
        return np.asarray(NED_ENU @ R)
    C = R @ CV_RUB
    return np.asarray(C if b.C_fE is None else np.swapaxes(b.C_fE, 1, 2) @ C)


def _constant(a: Poses, b: Poses) -> Iterator[Candidate[Matched]]:
    """(A.5)."""
    assert a.C_Ex is not None
    assert b.C_Ex is not None
    psi = turn_between(a, b)
    up = float(np.arctan2(np.sin(psi[:, 2]).mean(), np.cos(psi[:, 2]).mean()))
    quarters = round(up / (0.5 * np.pi))
    turn_deg = float(np.degrees(up)) - 90.0 * quarters
    turn = f"{90 * quarters:+d} deg and {turn_deg:+.4f} deg" if quarters else f"{turn_deg:+.4f} deg"
    text = (
        f"attitude of b turned by {turn} about up (grid, true or magnetic north; meridian"
        " convergence)"
    )
    yield taken_off(
        "north",
        text,
        _rotation_taken_off(rotation_from_vector(np.array([0.0, 0.0, -up])), UNTURNED),
        1,
        {"up_rad": up},
    )
    Q = nearest_rotation((np.swapaxes(a.C_Ex, 1, 2) @ b.C_Ex).mean(axis=0))
    text, values = _turn_words(
        Q,
        CAMERA_DIRECTIONS if b.x == "camera" else BODY_AXES,
        f"bore-sight or mounting of the {b.x}",
    )
    yield taken_off("boresight", text, _rotation_taken_off(UNTURNED, Q.T), 3, values)
    Q = nearest_rotation((b.C_Ex @ np.swapaxes(a.C_Ex, 1, 2)).mean(axis=0))
    text, values = _turn_words(
        Q, ENU_NAMES, "other axes of the frame, another origin of a tangent plane"
    )
    yield taken_off("turn of the frame", text, _rotation_taken_off(Q.T, UNTURNED), 3, values)


def _turn_words(
    Q: Array, names: tuple[str, str, str], meaning: str
) -> tuple[str, dict[str, float]]:
    """Statement and values of a constant turn."""
    v = vector_from_rotation(Q)
    turns = " ".join(
        f"{name} {np.degrees(value):+.4f}" for name, value in zip(names, v, strict=True)
    )
    why = meaning if np.linalg.norm(v) < SMALL_RAD else "another mounting or frame"
    return f"attitude of b turned about {turns} deg ({why})", {
        f"{name}_rad": float(value) for name, value in zip(names, v, strict=True)
    }
