"""The comparison itself.

It reads, matches, takes the differences, takes off what is recognised, and reports what remains.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, UsageError
from ...geodesy.conventions import METRES_OF
from ...geodesy.crs import crs_of, is_projected
from ...geodesy.datums import between_datums, fitting_crs
from ...io.options.comparison_options import ComparisonOptions
from ...records import Array, ExteriorOrientation, Trajectory
from .attitude import attitude, turn_between
from .clock import by_motion, by_names
from .hints import Hints
from .matching import Matched, match
from .names import by_order
from .poses import PLANE_M, FarError, NoOriginError, Poses
from .position import SHIFT_M, difference, heights_first, horizontal, vertical
from .reading import read_poses
from .result import UNTRANSFORMED, Comparison, ComponentDifferences, Mismatch
from .returned import adjustment_in, differences_of_adjustments, orientation_in
from .shifts import KILOMETRE, scatter, shift_from_positions

MOST_FINDINGS = 2  # findings that may be taken off one part, one after the other


def compare_files(
    a: str | Path | ExteriorOrientation | Trajectory,
    b: str | Path | ExteriorOrientation | Trajectory,
    **options: Any,
) -> Comparison:
    """Compare two exterior orientations or trajectories; b minus a.

    Parameters
    ----------
    a, b : files of any format of `reading.FORMS`, adjust.json or directories of `insgnss adjust`,
        of two of which points and cameras are compared as well, or records.
    options : fields of `ComparisonOptions`.

    Raises
    ------
    InputError
        With file and line.
    UsageError
        For an unknown format.
    DataError
        Where nothing tells which poses belong together.
    """
    stated = ComparisonOptions(**options)
    hints = Hints(
        stated.origin, stated.crs, stated.gps_week, stated.geoid, shift=stated.coordinate_shift
    )
    undulations = (stated.undulation_a_m, stated.undulation_b_m)
    adjusted = [adjustment_in(file) for file in (a, b)]
    a, b = (x if d is None else orientation_in(d) for x, d in zip((a, b), adjusted, strict=True))
    read, notes = _read_both(
        ((a, stated.form_a), (b, stated.form_b)),
        tuple(replace(hints, undulation_m=height) for height in undulations),
    )
    result = compare_poses(*read, time_shift_s=stated.time_shift_s, notes=notes)
    first, second = adjusted
    if first is None or second is None:
        return result
    one_frame = read[0].plane == read[1].plane
    return replace(result, adjusted=differences_of_adjustments(first, second, one_frame))


def _read_both(
    inputs: Sequence[tuple[str | Path | ExteriorOrientation | Trajectory, str | None]],
    hints: Sequence[Hints],
) -> tuple[tuple[Poses, Poses], tuple[str, ...]]:
    """Both files, of path, format and hints.

    A tangent plane without origin gets that of the other one, and a projected CRS is reached from
    the datum of a master beside it, which is read first.
    """
    read: list[Poses | None] = [None, None]
    without_origin: list[tuple[int, NoOriginError]] = []
    notes: list[str] = []
    hints = list(hints)
    for k in sorted(range(2), key=lambda k: not _may_be_master(inputs[k][0])):
        path, form = inputs[k]
        if (partner := read[1 - k]) is not None:
            hints[k] = replace(hints[k], datum=partner.datum, epoch=partner.epoch)
        try:
            read[k] = read_poses(path, form, hints[k])
        except NoOriginError as refusal:
            without_origin.append((k, refusal))
        except FarError as refusal:
            if partner is None:
                raise
            shifted = shift_from_positions(Path(str(path)), form, hints[k], partner)
            whole = shifted is None or float(np.abs(refusal.x[:, :2]).max()) > PLANE_M
            if whole and (crs := _fitting(refusal.x, partner, hints[k])):
                raise FarError(f"{refusal}; the numbers fit {crs}", refusal.x) from None
            if shifted is None:
                raise
            read[k] = read_poses(path, form, shifted)
            notes.append(_of_shift(path, inputs[1 - k][0], shifted))
    for k, error in without_origin:
        (path, form), reference, partner = inputs[k], inputs[1 - k][0], read[1 - k]
        if partner is None or partner.plane is None:
            raise error
        if hint := shift_from_positions(Path(str(path)), form, hints[k], partner):
            notes.append(_of_shift(path, reference, hint))
        else:
            plane = partner.plane
            origin = float(np.degrees(plane.lat)), float(np.degrees(plane.lon)), plane.height
            hint = replace(hints[k], origin=origin)
            notes.append(
                f"{path} does not give the origin of its tangent plane; that of {reference} was"
                " taken"
            )
        read[k] = read_poses(path, form, hint)
    first, second = read
    assert first is not None
    assert second is not None
    second, of_datum = _in_datum_of(first, second)
    return (first, second), (*notes, *of_datum)


def _fitting(numbers: Array, reference: Poses, hints: Hints | None = None) -> str:
    """Return the CRSs, or the unit of that of the hints, in which numbers fit the other file."""
    lat, lon = float(np.median(reference.lat)), float(np.median(reference.lon))
    extent = scatter(reference.ecef)
    fits = fitting_crs(numbers, lat, lon, extent, reference.datum, reference.epoch)
    if fits or hints is None or hints.crs is None or not is_projected(crs_of(hints.crs)):
        return fits
    projection = hints.projected(hints.crs)
    try:
        x = projection.forward_horizontal(reference.lat, reference.lon, reference.height)
    except InputError:  # the CRS does not reach the positions
        return ""
    for unit, metres in (METRES_OF | {"kilometres": KILOMETRE}).items():
        separation = np.median(metres * numbers[:, :2], axis=0) - np.median(x[:, :2], axis=0)
        if np.abs(separation).max() < extent + KILOMETRE:
            return f"{hints.crs} in {unit}"
    return ""


def _of_shift(file: object, reference: object, hints: Hints) -> str:
    e, n, h = hints.shift or (0.0, 0.0, 0.0)
    return (
        f"{file}: {e:.0f} {n:.0f} {h:.0f} were subtracted from its coordinates ({hints.crs}): whole"
        f" kilometres, found from the positions of {reference}"
    )


def _in_datum_of(a: Poses, b: Poses) -> tuple[Poses, tuple[str, ...]]:
    """b in the datum of a, and what was done."""
    datums = (a.datum, a.epoch), (b.datum, b.epoch)
    if datums[0] == datums[1]:
        return b, ()
    names = [
        "no named datum" if name is None else name if epoch is None else f"{name} at {epoch:g}"
        for name, epoch in datums
    ]
    statement = f"positions of a are of {names[0]}, those of b of {names[1]}"
    if None in (a.datum, b.datum):
        return b, (f"{statement}: {UNTRANSFORMED}; datums differ by up to 2 m",)
    try:
        moved = b.moved(*between_datums(b.lat, b.lon, b.height, *datums[::-1]))
    except (InputError, UsageError) as refusal:
        return b, (f"{statement}: {UNTRANSFORMED}, since {refusal}",)
    by = " by the motion of its plate" if None not in (a.epoch, b.epoch) else ""
    by *= a.epoch != b.epoch
    return replace(moved, datum=a.datum, epoch=a.epoch), (f"{statement}: b is transformed{by}",)


def _may_be_master(source: str | Path | ExteriorOrientation | Trajectory) -> bool:
    """Tell whether what is given may name the datum of its positions."""
    if isinstance(source, str | Path):
        return Path(source).suffix.lower() == ".json"
    return isinstance(source, ExteriorOrientation)


def compare_poses(
    a: Poses, b: Poses, *, time_shift_s: float = 0.0, notes: tuple[str, ...] = ()
) -> Comparison:
    """Compare what was read; b minus a.

    Raises
    ------
    DataError
        Where nothing tells which poses belong together.
    """
    b, more = _of_one_body(a, b)
    findings: list[Mismatch] = []
    try:
        first = matched = match(a, b, time_shift_s)
    except DataError:
        recognised = by_motion(a, b)
        if recognised is None:
            raise
        findings, first, matched = [recognised[0]], recognised[1], recognised[1]
    else:
        matched, findings = _clock(a, b, first, time_shift_s)
    settled, taken = _explained(matched)
    findings += taken
    return Comparison(
        a.source,
        b.source,
        a.form,
        b.form,
        a.point,
        b.point,
        first.how,
        first.a.images,
        first.of_time,
        first.left_a,
        first.left_b,
        components(first.a, first.b),
        tuple(findings),
        components(settled.a, settled.b) if findings else (),
        matched.of_time,
        (*notes, *more, *_notes(a, b, first), *_frame_note(settled)),
    )


def largest_difference(a: Poses, b: Poses) -> str:
    """Return what explains most of the differences in position; empty where nothing does.

    Parameters
    ----------
    a, b : of the same images.

    Returns
    -------
    str
        With the files that are a and b: coordinates of the second are read otherwise.
    """
    a, b = (replace(poses, C_Ex=None) for poses in (a, b))
    compared = compare_poses(a, b), compare_poses(b, a)
    ranked = [
        (finding.before - finding.after, of, finding.statement)
        for of in compared
        for finding in of.findings
    ] or [(0.0, of, of.notes[-1]) for of in compared if of.notes]
    if not ranked:
        return ""
    _, of, statement = max(ranked, key=lambda row: row[0])
    return f"{of.a} (a), {of.b} (b): {statement}"


def _of_one_body(a: Poses, b: Poses) -> tuple[Poses, tuple[str, ...]]:
    """b with its attitude of what a's is of, camera or body, where the mounting is known."""
    if a.C_Ex is None or b.C_Ex is None or a.x == b.x:
        return b, ()
    C_cb = a.camera_from_body if a.camera_from_body is not None else b.camera_from_body
    if C_cb is None:
        note = (
            f"attitudes are of the {a.x} in a and of the {b.x} in b, and neither file gives the"
            " mounting: they are not compared"
        )
        return replace(b, C_Ex=None), (note,)
    turned_b = b.C_Ex @ C_cb.T if b.x == "body" else b.C_Ex @ C_cb
    return (
        replace(b, C_Ex=turned_b, x=a.x, angles=None, angle_set=""),
        (f"attitudes of b turned to the {a.x} by the mounting that a file gives",),
    )


def _clock(a: Poses, b: Poses, matched: Matched, shift_s: float) -> tuple[Matched, list[Mismatch]]:
    """What names and clocks explain, and the match with it taken off.

    Of files matched by name the clocks stay.
    """
    if matched.how == "image":
        reordered = by_order(matched)
        findings = [] if reordered is None else [reordered[0]]
        matched = matched if reordered is None else reordered[1]
        offset = by_names(matched)
        return matched, [*findings, offset] if offset is not None else findings
    shifted = b if shift_s == 0.0 or b.time is None else replace(b, time=b.time + shift_s)
    recognised = by_motion(a, shifted)
    return (matched, []) if recognised is None else (recognised[1], [recognised[0]])


def _explained(matched: Matched) -> tuple[Matched, list[Mismatch]]:
    """The match with everything taken off b that is recognised, and what that was."""
    findings: list[Mismatch] = []
    aspects = [horizontal, vertical, attitude]
    if heights_first(matched.a, matched.b):
        aspects[:2] = aspects[1::-1]
    for aspect in aspects:
        if aspect is not horizontal and _far(matched, axes=2):
            continue  # heights and axes of another place say nothing
        for _ in range(MOST_FINDINGS):
            explained = aspect(matched)
            if explained is None:
                break
            findings.append(explained[0])
            matched = explained[1]
    return matched, findings


def components(a: Poses, b: Poses) -> tuple[ComponentDifferences, ...]:
    """Return the differences b minus a, component by component.

    They are east, north, up; turns about east, north, up; velocities, where both files have them.
    """
    sigma = _sigma(a.cov_position, b.cov_position)
    kinds: list[tuple[str, str, Array, Array | None]] = [("", "m", difference(a, b), sigma)]
    if a.C_Ex is not None and b.C_Ex is not None:
        sigma = _sigma(a.cov_attitude, b.cov_attitude)
        kinds.append(("about ", "rad", turn_between(a, b), sigma))
    if a.velocity is not None and b.velocity is not None:
        kinds.append(("v ", "m/s", b.velocity - a.velocity, None))
    return tuple(
        ComponentDifferences(f"{kind}{axis}", unit, d[:, k], None if s is None else s[:, k])
        for kind, unit, d, s in kinds
        for k, axis in enumerate(("east", "north", "up"))
    )


def _sigma(P_a: Array | None, P_b: Array | None) -> Array | None:
    """Standard deviations (n, 3) of the difference of independent errors.

    Of the one file's where the other gives none.
    """
    stated = [P for P in (P_a, P_b) if P is not None]
    if not stated:
        return None
    return np.sqrt(sum(np.diagonal(P, axis1=1, axis2=2) for P in stated))


def _far(matched: Matched, axes: int = 3) -> float:
    """Return how far positions lie from each other, m; 0 where a datum or base explains it.

    Heights in centimetres are far with three axes, and of the same place with two.
    """
    d = difference(matched.a, matched.b)[:, :axes]
    distance = float(np.median(np.linalg.norm(d, axis=1)))
    return distance if distance > SHIFT_M else 0.0


def _frame_note(matched: Matched) -> tuple[str, ...]:
    """What no convention explains: positions of another frame than they were read in."""
    if not (distance := _far(matched)):
        return ()
    fits = ""
    for name, file, reference in (("b", matched.b, matched.a), ("a", matched.a, matched.b)):
        if not fits and file.projection is not None and file.local is not None:
            crs = _fitting(file.local / file.projection.unit_m, reference)
            fits = f"; the numbers of {name} fit {crs}, if the other file is right" if crs else ""
    return (
        f"positions lie {1e-3 * distance:.0f} km apart, which no datum or base station explains: a"
        " file was read in another frame than its own; give its CRS (--crs) or its format"
        f" (--format-a, --format-b){fits}",
    )


def _notes(a: Poses, b: Poses, matched: Matched) -> tuple[str, ...]:
    notes = [*a.notes, *b.notes]
    if a.cov_position is not None and b.cov_position is not None:
        notes.append(
            "rms/sigma takes the errors of both files as independent; results of the same"
            " observations are not, and come out below 1"
        )
    if matched.how == "time" and (a.gps_week is None) != (b.gps_week is None):
        notes.append("only one file gives the GPS week; the other is taken to be of the same")
    if matched.a.n < 5:
        notes.append(f"{matched.a.n} poses are too few to recognise a mismatch")
    return tuple(notes)
