"""A simulated flight as a data set.

The published tree (Figure 9 of paper 000), `flight.toml`, and the truth beside it.

    flight.toml  README.md  FLIGHT.md  block.toml (with a block)
    01_Observations/Camera/Data/Events.txt
    01_Observations/Camera/GCPs/WGS84.txt, WGS84_tangentplane.txt
    01_Observations/GPS/Data/Rover/rov01840.18o, .18n, .18g          (with raw GNSS only)
    01_Observations/GPS/Data/Master/tr2b0703a.18o                    (with raw GNSS only)
    01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv
    02_Processed/GPS-PPK/AntennaPos_WGS84.txt, AntennaPos_Img_WGS84.txt,
        AntennaPos_Img_WGS84_tangentplane.txt
    01_Observations/Camera/Block/image_points.csv, ground_points.csv, camera.toml    (with a block)
    truth/EO_local-plane.txt, eo.npz, trajectory.npz, raw_gnss.npz, block.npz, camera.toml

With a block the ground targets of Camera/GCPs are those that its images show. There are no images,
no virtual reference station and no raw IMU files: nothing of theirs is simulated.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.advance import through, within
from ..base.errors import UsageError
from ..base.output.staging import is_vacant, together
from ..geodesy.rotation import CV_RUB, opk_from_rotation
from ..io.formats.blocks.camera_toml import write_camera_toml
from ..io.formats.blocks.ground_points import write_ground_points
from ..io.formats.blocks.image_points import write_image_points
from ..io.formats.events.events import write_events
from ..io.formats.gnss.gnss_text import ImagePositions, write_gnss_text, write_image_positions
from ..io.formats.text.text import format_rows
from ..navigation.noise_model.model import (
    NoiseModel,
    load_noise_model,
    shipped_models,
    write_noise_model,
)
from ..records import Array, ImuSamples, Quantity
from .description import (
    BLOCK_FOLDER,
    BLOCK_TOML,
    EVENTS_FILE,
    FIXES,
    IMU_DIRECTORY,
    PPK,
    RinexNames,
    Tables,
    Units,
    flight_md,
    flight_toml,
    imu_file,
    readme,
    true_tables,
)
from .faults import ImuFaults, RowFaults
from .image_block import BlockOptions, SimulatedBlock, simulate_block
from .layout import FlightPlan
from .raw_gnss.rinex_files import ObservationTable, Station, write_navigation, write_observations
from .raw_gnss.scenario import SIGNALS, RawObservations, SimulatedGnss
from .scenario import SimulatedFlight, simulate_flight
from .sensors import ImuOptions, antenna_states

TARGETS = "01_Observations/Camera/GCPs"
CHUNK_ROWS = 50_000  # rows of the IMU that are written at once
SIMULATED = 0.7  # of the time that a data set takes; the rest writes it
_TARGETS = 40  # ground points of a data set without a block (chosen)
_TARGET_SPREAD = 0.12  # of targets about the path, over the height above ground: within the images
_RELIEF_M = 2.0  # standard deviation of their heights (chosen)


@dataclass(frozen=True, eq=False)
class Dataset:
    """A written data set: its directory, its flight file, and what it was made of.

    `block` is None where there is none.
    """

    directory: Path
    flight_file: Path
    simulated: SimulatedFlight
    block: SimulatedBlock | None = None


def write_dataset(
    directory: str | os.PathLike[str],
    flight: str | FlightPlan = "ign8",
    minutes: float | None = None,
    *,
    imu_rate: float = 500.0,
    seed: int = 0,
    noise: str | NoiseModel | None = "navchip",
    imu_axes: str = "forward right down",
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    quantity: Quantity = "mean_rate",
    imu_faults: ImuFaults | None = None,
    vibration: float = 1.0,
    imu_rows: RowFaults | None = None,
    gnss_rows: RowFaults | None = None,
    flight_file: Tables | None = None,
    block: BlockOptions | None = None,
    **changes: Any,
) -> Dataset:
    """Simulate a flight and write it as a data set that `flight.toml` describes.

    Whole or not at all.

    Parameters
    ----------
    directory : is created; it may exist if it is empty.
    flight, minutes, seed, changes : as in `simulate_flight`; of raw GNSS observations the flight
        file names the RINEX of rover and master in place of the positions.
    imu_rate : Hz.
    noise, imu_faults, vibration : as in `ImuOptions`; the flight file names the noise.
    imu_axes, gyro_unit, accel_unit, quantity, imu_rows, gnss_rows, flight_file, block : as in
    `write_simulated`; SI units by default.

    Raises
    ------
    UsageError : the directory is not empty or cannot be written, the flight cannot be flown, or it
        has no exposure.
    InputError : a unit does not exist or is of another dimension.
    """
    target = _vacant_directory(directory)
    units = Units.of(quantity, gyro_unit, accel_unit)
    imu = ImuOptions(
        imu_rate, noise, imu_axes, quantity, faults=imu_faults or ImuFaults(), vibration=vibration
    )
    with within(0.0, SIMULATED):
        simulated = simulate_flight(flight, minutes, seed=seed, imu=imu, **changes)
    with within(SIMULATED, 1.0):
        return write_simulated(
            target,
            simulated,
            seed=seed,
            units=units,
            imu_rows=imu_rows,
            gnss_rows=gnss_rows,
            flight_file=flight_file,
            block=block,
        )


def write_simulated(
    directory: str | os.PathLike[str],
    simulated: SimulatedFlight,
    *,
    seed: int = 0,
    units: "Units | None" = None,
    imu_rows: RowFaults | None = None,
    gnss_rows: RowFaults | None = None,
    flight_file: Tables | None = None,
    block: BlockOptions | None = None,
) -> Dataset:
    """Write what was simulated as a data set; whole or not at all.

    Parameters
    ----------
    seed : of targets, row faults and the antenna's errors at the images.
    units : of the IMU file, SI by default.
    imu_rows, gnss_rows : disorder of the rows of the IMU and the GNSS file.
    flight_file : tables of keys that take the place of the true ones, to write a wrong flight file
        or to ask for more in it.
    block : what is measured in the images; None: nothing. It changes no file of the flight.

    Raises
    ------
    UsageError
        Where the directory is not empty or cannot be written, the flight has no exposure, or a
        block is asked of what is no survey flight.
    """
    target = _vacant_directory(directory)
    if not simulated.events.images:
        raise UsageError("no exposure in this flight; ask for more minutes, or start in the air")
    units = units or Units.of(simulated.imu_options.quantity, None, None)
    draws = np.random.default_rng([seed, 1])
    simulated_block = None if block is None else simulate_block(simulated, block, seed)
    with together() as staging:
        root = staging.tree(target)
        _write_tree(root, simulated, units, draws, flight_file or {}, simulated_block)
        for rows, file in ((imu_rows, imu_file(simulated)), (gnss_rows, FIXES)):
            if rows is not None:
                rows.disturb(root / file, draws.spawn(1)[0])
    return Dataset(target, target / "flight.toml", simulated, simulated_block)


def _vacant_directory(directory: str | os.PathLike[str]) -> Path:
    """Return the resolved path; UsageError where it exists and is not an empty directory."""
    target = Path(directory).resolve()
    if not is_vacant(target):
        raise UsageError(f"{target}: exists and is not an empty directory; give another one")
    return target


def _write_tree(
    root: Path,
    simulated: SimulatedFlight,
    units: Units,
    rng: np.random.Generator,
    flight_file: Tables,
    block: SimulatedBlock | None,
) -> None:
    """Write all files of the data set into the empty directory `root`."""
    for folder in (Path(EVENTS_FILE).parent, TARGETS, IMU_DIRECTORY, PPK, "truth"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    write_events(simulated.events, root / EVENTS_FILE)
    _write_imu(root / imu_file(simulated), simulated.imu, units)
    write_gnss_text(simulated.gnss, root / FIXES)
    _write_antenna_at_images(root / PPK, simulated, rng)
    targets = _draw_targets(simulated, rng)
    if block is not None:
        targets = list(block.ground.points), block.ground.position_m
        _write_block(root, block)
    _write_targets(root / TARGETS, simulated, *targets)
    _write_truth(root / "truth", simulated)
    if simulated.raw_gnss is not None:
        _write_raw_gnss(root, RinexNames.of(simulated), simulated.raw_gnss)
    tables = true_tables(simulated, units, _name_in_flight_file(root, simulated.imu_options.noise))
    if simulated.second_imu is not None:
        recorded, second_samples = simulated.second_imu
        _write_imu(
            root / imu_file(simulated, 2),
            recorded.samples,
            Units.of(second_samples.options.quantity, None, None),
        )
    _write_text(root / "flight.toml", flight_toml(tables, flight_file))
    _write_text(root / "README.md", readme(simulated, block is not None))
    _write_text(root / "FLIGHT.md", flight_md(simulated, block))


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _write_rows(path: Path, header: str, template: str, names: Iterable[str], table: Array) -> None:
    """Write a header, and by a `%` template a row of each name and its numbers (n, columns)."""
    rows = (template % (name, *row) for name, row in zip(names, table.tolist(), strict=True))
    _write_text(path, header + "".join(rows))


def _write_imu(path: Path, samples: ImuSamples, units: Units) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(_imu_lines(samples, units))


def _imu_lines(imu: ImuSamples, units: Units) -> Iterator[str]:
    """Yield the header and the rows of an IMU file in its units."""
    columns = [f"g{c}[{units.gyro}]" for c in "xyz"] + [f"a{c}[{units.accel}]" for c in "xyz"]
    yield ",".join(["tow[s]", *columns]) + "\n"
    row = units.row()
    table = np.column_stack([imu.time, imu.gyro / units.gyro_si, imu.accel / units.accel_si])
    for start in through(range(0, len(table), CHUNK_ROWS)):
        yield from format_rows(row, table[start : start + CHUNK_ROWS])


def _write_raw_gnss(root: Path, names: RinexNames, raw: SimulatedGnss) -> None:
    """Write RINEX of both receivers and the satellites, and true positions, clocks and slips."""
    for file in (names.rover, names.base):
        (root / file).parent.mkdir(parents=True, exist_ok=True)
    approximate = tuple(raw.rover.position[0].round().tolist())
    rover = Station("rover", approximate, interval_s=1.0 / raw.options.rate_hz)
    base = Station(
        "master", tuple(raw.base_position_m.tolist()), interval_s=1.0 / raw.options.base_rate_hz
    )
    write_observations(root / names.rover, rover, _observation_table(raw.rover, raw.events))
    write_observations(root / names.base, base, _observation_table(raw.base, np.empty(0)))
    write_navigation(root / names.gps, root / names.glonass, raw.navigation)
    moved = {"rover_position": raw.rover.position, "rover_velocity": raw.rover.velocity}
    truth: dict[str, Any] = {"base_position": raw.base_position_m, "events_by_receiver": raw.events}
    truth |= moved
    slip_fields = ("stamp", "satellite", "cycles", "reported")
    for name in ("rover", "base"):
        receiver = getattr(raw, name)
        slips = getattr(raw, f"{name}_slips")
        truth |= {f"{name}_{key}": getattr(receiver, key) for key in ("time", "stamp", "clock_s")}
        truth |= {f"{name}_slip_{key}": getattr(slips, key) for key in slip_fields}
    np.savez(root / "truth/raw_gnss.npz", allow_pickle=False, **truth)


def _observation_table(observed: RawObservations, events: Array) -> ObservationTable:
    """Return the observations as a RINEX file has them: loss of lock beside the phases."""
    lock = np.zeros(observed.values.shape, dtype=np.int8)
    lock[:, [SIGNALS.index(name) for name in ("L1", "L2")]] = observed.loss_of_lock
    rows = (observed.epoch, observed.satellite, SIGNALS, observed.values, lock)
    return ObservationTable(observed.gps_week, observed.stamp, *rows, events)


def _write_antenna_at_images(
    folder: Path, simulated: SimulatedFlight, rng: np.random.Generator
) -> None:
    """Write the antenna at the events, with the white error of the fixes, in both frames."""
    motion = simulated.flight.motion
    plane = simulated.tangent_plane
    position, _ = antenna_states(motion, simulated.rig.antenna_lever_b, simulated.events.time)
    error = rng.standard_normal(position.shape) * simulated.gnss_options.sigma_m
    lat, lon, height = motion.frame.geodetic_from_position(
        position + np.einsum("nij,nj->ni", motion.frame.C_ln_at(position), error)
    )
    images = simulated.events.images
    write_image_positions(
        ImagePositions(images, np.column_stack([lat, lon, height]), "geodetic"),
        folder / "AntennaPos_Img_WGS84.txt",
    )
    enu = ImagePositions(images, plane.position_from_geodetic(lat, lon, height), "tangent_plane")
    write_image_positions(enu, folder / "AntennaPos_Img_WGS84_tangentplane.txt")


def _draw_targets(simulated: SimulatedFlight, rng: np.random.Generator) -> tuple[list[str], Array]:
    """Return names and positions (n, 3), m ENU, of targets under the exposures, of low relief."""
    flight = simulated.flight
    position = flight.motion.position(flight.time)[
        np.linspace(0, flight.time.size - 1, _TARGETS).round().astype(int)
    ]
    position[:, :2] += _TARGET_SPREAD * -position[:, 2:] * rng.standard_normal((_TARGETS, 2))
    position[:, 2] = _RELIEF_M * rng.standard_normal(_TARGETS)
    geodetic = flight.motion.frame.geodetic_from_position(position)
    return [str(k + 1) for k in range(_TARGETS)], simulated.tangent_plane.position_from_geodetic(
        *geodetic
    )


def _write_targets(folder: Path, simulated: SimulatedFlight, names: list[str], enu: Array) -> None:
    """Write ground targets in both frames."""
    lat, lon, height = simulated.tangent_plane.geodetic_from_position(enu)
    wgs84 = np.column_stack([np.degrees(lat), np.degrees(lon), height])
    header = "# id lat[deg] lon[deg] h[m]\n"
    _write_rows(folder / "WGS84.txt", header, "%s %.10f %.10f %.4f\n", names, wgs84)
    header = "# id e[m] n[m] u[m]\n"
    _write_rows(folder / "WGS84_tangentplane.txt", header, "%s %.4f %.4f %.4f\n", names, enu)


def _write_block(root: Path, block: SimulatedBlock) -> None:
    """Write what was measured in the images, and the truth of it."""
    (root / BLOCK_FOLDER).mkdir(parents=True)
    _write_text(root / "block.toml", BLOCK_TOML)
    write_image_points(block.measured, root / BLOCK_FOLDER / "image_points.csv")
    axes = "tangent plane of flight.toml: east, north, up, m"
    write_ground_points(block.ground, root / BLOCK_FOLDER / "ground_points.csv", [axes])
    write_camera_toml(block.options.stated_camera, root / BLOCK_FOLDER / "camera.toml")
    write_camera_toml(block.options.true_camera, root / "truth/camera.toml")
    observations = block.measured.observations
    np.savez(
        root / "truth/block.npz",
        allow_pickle=False,
        points=np.array(block.measured.points),
        position_enu=block.position_m,
        image=observations.image,
        point=observations.point,
        uv=block.uv,
        gross_error=block.gross,
    )


def _write_truth(folder: Path, simulated: SimulatedFlight) -> None:
    """Write the true exterior orientation, trajectory, biases and outliers."""
    truth = simulated.truth
    eo = truth.eo
    path = truth.trajectory
    angles = np.degrees(opk_from_rotation(eo.C_mc @ CV_RUB))
    header = (
        "# truth of a simulation: projection centre in the tangent plane (east north up), origin"
        f" {np.degrees(eo.origin[0]):.10f} {np.degrees(eo.origin[1]):.10f} deg {eo.origin[2]:.4f}"
        " m; R = Rx(omega) Ry(phi) Rz(kappa)\n# image E[m] N[m] U[m] omega[deg] phi[deg]"
        " kappa[deg] sE sN sU sOmega sPhi sKappa\n"
    )
    template = "%s %.4f %.4f %.4f %.6f %.6f %.6f 0 0 0 0 0 0\n"
    table = np.hstack([eo.position_m, angles])
    _write_rows(folder / "EO_local-plane.txt", header, template, eo.images, table)
    np.savez(
        folder / "eo.npz",
        images=np.array(eo.images),
        tow=eo.time,
        position_enu=eo.position_m,
        C_mc=eo.C_mc,
        origin=eo.origin,
    )
    np.savez(
        folder / "trajectory.npz",
        tow=path.time,
        lat=path.lat,
        lon=path.lon,
        h=path.height,
        v_ned=path.velocity_ned,
        C_nb=path.C_nb,
        gyro_bias=truth.gyro_bias,
        accel_bias=truth.accel_bias,
        gnss_outlier=truth.outlier,
    )


def _name_in_flight_file(root: Path, noise: str | NoiseModel | None) -> str:
    """Return the name of the noise model in the flight file: a shipped one, or the file it writes.

    An ideal sensor is called navchip.
    """
    if noise is None:
        return "navchip"
    if isinstance(noise, str) and noise in shipped_models():
        return noise
    write_noise_model(
        load_noise_model(noise) if isinstance(noise, str) else noise, root / "noise.toml"
    )
    return "noise.toml"
