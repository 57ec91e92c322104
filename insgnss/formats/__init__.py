"""Files in and files out, one module per format, each the code twin of `data_specs/<format>.md`.

`read_imu`, `read_gnss` and `read_events` find the format by the file's ending and first bytes and hand over to its reader;
options that a format cannot use are refused, None is no option. `EXPORTS` lists what an exterior orientation is written to.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError
from ..records import CameraEvents, ExteriorOrientation, GnssFixes, ImuSamples

IMU_OPTIONS = {
    "matlab": ("columns", "variable", "units", "quantity", "gps_week"),
    "aimu": ("quantity", "gps_week"),
    "imu_csv": ("columns", "units", "quantity", "gps_week"),
}
GNSS_OPTIONS = {
    "matlab": ("columns", "variable", "new_when", "sigma_m", "sigma_velocity", "units", "gps_week", "undulation_m"),
    "nmea": ("sigma_m", "gps_week"),
    "rtklib_pos": ("undulation_m", "gps_week"),
    "gnss_text": ("columns", "sigma_m", "sigma_velocity", "units", "gps_week", "undulation_m"),
}


def sniff_imu(path: str | Path) -> str:
    """Name of the format of an IMU file: matlab, aimu or imu_csv."""
    if _is_matlab(path):
        return "matlab"
    return "aimu" if _head(path).lstrip().startswith((b"$AIMU", b"$APPS")) else "imu_csv"


def sniff_gnss(path: str | Path) -> str:
    """Name of the format of a GNSS file: matlab, nmea, rtklib_pos or gnss_text."""
    if _is_matlab(path):
        return "matlab"
    head = _head(path)
    if head.lstrip().startswith(b"$") or b"\n$G" in head:
        return "nmea"
    header = any(name in head for name in (b"latitude(", b"x-ecef(", b"e-baseline("))
    return "rtklib_pos" if header and head.lstrip().startswith(b"%") else "gnss_text"


def _is_matlab(path: str | Path) -> bool:
    return Path(path).suffix.lower() == ".mat"


def _head(path: str | Path) -> bytes:
    try:
        with Path(path).open("rb") as stream:
            return stream.read(1 << 14)
    except OSError as error:
        raise InputError.at(path, None, f"cannot be read: {error.strerror or error}; check the path in the flight file") from None


def _options(path: str | Path, form: str, known: tuple[str, ...], given: dict[str, Any]) -> dict[str, Any]:
    options = {key: value for key, value in given.items() if value is not None}
    extra = [key for key in options if key not in known]
    # standard deviations stand in where a file has none; a format that always has them does not need them
    for key in [key for key in extra if key in ("sigma_m", "sigma_velocity")]:
        del options[key]
        extra.remove(key)
    if extra:
        raise UsageError(f"{path}: is of the format {form}, which takes no {', '.join(extra)}; it takes {', '.join(known)}")
    return options


def read_imu(path: str | Path, **spec: Any) -> ImuSamples:
    """Read an IMU file of any format here; `spec` are the options of `IMU_OPTIONS`."""
    form = sniff_imu(path)
    options = _options(path, form, IMU_OPTIONS[form], spec)
    if form == "matlab":
        from .matlab import read_imu_mat

        return read_imu_mat(path, **_with_columns(path, options))
    if form == "aimu":
        from .aimu import read_aimu

        return read_aimu(path, **options)
    from .imu_csv import read_imu_csv

    return read_imu_csv(path, **options)


def read_gnss(path: str | Path, **spec: Any) -> GnssFixes:
    """Read a GNSS file of any format here; `spec` are the options of `GNSS_OPTIONS`."""
    form = sniff_gnss(path)
    options = _options(path, form, GNSS_OPTIONS[form], spec)
    if form == "matlab":
        from .matlab import read_gnss_mat

        return read_gnss_mat(path, **_with_columns(path, options))
    if form == "nmea":
        from .nmea import read_nmea

        return read_nmea(path, **options)
    if form == "rtklib_pos":
        from .rtklib_pos import read_rtklib_pos

        return read_rtklib_pos(path, **options)
    from .gnss_text import read_gnss_text

    return read_gnss_text(path, **options)


def _with_columns(path: str | Path, options: dict[str, Any]) -> dict[str, Any]:
    if "columns" not in options:
        raise UsageError(f"{path}: a MATLAB file needs columns = {{tow = ..., ...}}, and variable where they are fields of a struct")
    return options


def read_events(path: str | Path, **spec: Any) -> CameraEvents:
    """Read camera events; `spec`: columns, gps_week."""
    from .events import read_events as read

    return read(path, **_options(path, "events", ("columns", "gps_week"), spec))


def _eo_local_plane(eo: ExteriorOrientation, path: str | Path) -> None:
    from .eo_local_plane import write_eo_local_plane

    write_eo_local_plane(eo, path)


def _metashape(eo: ExteriorOrientation, path: str | Path) -> None:
    from .metashape import write_metashape

    write_metashape(eo, path)


def _eo_json(eo: ExteriorOrientation, path: str | Path) -> None:
    from .eo_json import write_eo_json

    write_eo_json(eo, path)


Export = tuple[Callable[[ExteriorOrientation, str | Path], None], str, str]

EXPORTS: dict[str, Export] = {
    "eo_local_plane": (_eo_local_plane, "EO_local-plane.txt", "tangent plane, omega phi kappa, standard deviations; blank separated text"),
    "metashape": (_metashape, "metashape.csv", "Metashape camera reference: longitude latitude height, yaw pitch roll, accuracies"),
    "eo_json": (_eo_json, "eo.json", "master: full covariances, cross-covariances of neighbours, ECEF and tangent plane"),
}
