"""Files of one flight in several formats, made from a simulated truth."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from insgnss.io.formats.bundle.metashape import write_metashape
from insgnss.io.formats.gnss.gnss_text import write_gnss_text
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.orientation.eo_local_plane import write_eo_local_plane
from insgnss.io.formats.trajectory.sbet import write_sbet, write_smrmsg
from insgnss.io.formats.trajectory.trajectory_csv import write_trajectory_csv
from insgnss.navigation.orient.frame import in_frame
from insgnss.records import ExteriorOrientation, Trajectory
from insgnss.simulation.scenario import ImuOptions, simulate_flight

SIGMA = np.array([0.01, 0.01, 0.02, 5e-4, 5e-4, 2e-3])


@dataclass(frozen=True)
class Written:
    """Directory of the files, and what they were made from."""

    root: Path
    eo: ExteriorOrientation
    trajectory: Trajectory
    camera_lever_b: np.ndarray
    antenna_lever_b: np.ndarray

    def __getitem__(self, name: str) -> Path:
        return self.root / name


def write_files(root: Path) -> Written:
    """Simulate a flight and write its truth in the formats that can be compared."""
    sim = simulate_flight(
        "ign8", 2.0, seed=3, imu=ImuOptions(rate_hz=20.0), start_in_air=True, line_length_m=250.0
    )
    n, m = len(sim.truth.eo.images), sim.truth.trajectory.time.size
    eo = replace(sim.truth.eo, cov=np.broadcast_to(np.diag(SIGMA**2), (n, 6, 6)))
    state = np.diag(np.array([0.01] * 3 + [0.01] * 3 + [5e-4, 5e-4, 2e-3]) ** 2)
    path = replace(sim.truth.trajectory, cov=np.broadcast_to(state, (m, 9, 9)))
    framed = in_frame(eo, "tangent plane")
    write_eo_json(eo, root / "eo.json")
    write_eo_local_plane(framed, root / "EO_local-plane.txt")
    write_metashape(in_frame(eo, "geographic"), root / "metashape.csv")
    write_trajectory_csv(path, root / "trajectory.csv")
    write_sbet(path, root / "trajectory.sbet")
    write_smrmsg(path, root / "trajectory.smrmsg")
    write_gnss_text(sim.gnss, root / "antenna.txt")
    write_rtklib_pos(sim.gnss, root / "antenna.pos")
    return Written(root, eo, path, sim.rig.camera_lever_b, sim.rig.antenna_lever_b)
