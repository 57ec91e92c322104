"""Vectors from one antenna on the body to another, north, east and down: a moving-base solution."""

from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...geodesy.rotation import rotation_from_vector
from ...io.formats.detect import head_of
from ...io.formats.gnss.pos_header import POSITION, ROOTS
from ...io.formats.gnss.rtklib_pos import is_rtklib_pos, read_pos_rows
from ...io.formats.names import TIME, Names, sigma_names
from ...io.formats.text.columns import TableSpec
from ...io.formats.text.order import Picked, note, refuse_rows
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import Kind, LogRows, turned_angles
from .options import MeasurementInput

FIXED = 1  # RTKLIB's quality Q of fixed ambiguities: float baselines are off by decimetres

NAMES: Names = {
    **TIME,
    "tow": TIME["tow"].replace("~itow", "itow"),  # of RELPOSNED, whose other names are here too
    "n": "n north relposn rel_n rel_pos_n baseline_n dn",
    "e": "e east relpose rel_e rel_pos_e baseline_e de",
    "d": "d down relposd rel_d rel_pos_d baseline_d dd",
    "sigma_n": f"{sigma_names('n north')} accn",
    "sigma_e": f"{sigma_names('e east')} acce",
    "sigma_d": f"{sigma_names('d down')} accd",
}


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return the vector between the antennas, turned by angles that are states."""
    lever = np.array(options.lever_m)

    def predict(motion: Motion, states: Array) -> Array:
        return np.einsum("kij,kj->ki", motion.C_nb, rotation_from_vector(states) @ lever)

    return predict, turned_angles(options, "forward", "right", "down")


def _of_moving_base(path: Path) -> LogRows | None:
    """Return the fixed baselines of a `.pos`, None where the file is none."""
    if not is_rtklib_pos(head_of(path)):
        return None
    pos = read_pos_rows(path)
    if pos.header.kind != "e-baseline":
        problem = "has positions, not vectors between the antennas; run RTKLIB with"
        advice = "pos1-posmode = movingbase and out-solformat = enu"
        raise InputError.at_line(str(path), None, f"{problem} {advice}")
    fixed = np.asarray(pos.columns["Q"] == FIXED)
    lines = Picked(pos.table, np.flatnonzero(fixed))
    if not fixed.any():
        problem = f"none of {fixed.size} baselines has fixed ambiguities (Q = {FIXED})"
        raise InputError.at_line(str(path), None, f"{problem}; see the settings of the run")
    e, n, u, sigma_e, sigma_n, sigma_u = (
        pos.columns[name][fixed] for name in (*POSITION[pos.header.kind], *ROOTS["e-baseline"][:3])
    )
    sigma = np.column_stack([sigma_n, sigma_e, sigma_u])
    bad = sigma.min(axis=1) <= 0.0
    refuse_rows(lines, bad, "a standard deviation must be greater than zero")
    notes = pos.notes
    if not fixed.all():
        floats = f"left out {np.count_nonzero(~fixed)} of {fixed.size} baselines that are not fixed"
        notes = (*notes, note("measurement rows", floats, "fixed ambiguities"))
    return pos.gps_week, pos.time[fixed], np.column_stack([n, e, -u]), lines, sigma, notes


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow n e d",
        layouts=("tow n e d", "tow n e d sigma_n sigma_e sigma_d"),
        units={"length": "n e d sigma_n sigma_e sigma_d", "time": "tow"},
        record="measurement",
    ),
    "n e d",
    "length",
    _model,
    reads=("offset_sigma_deg", "lever_m"),
    needs=("lever_m",),
    other_format=_of_moving_base,
)
