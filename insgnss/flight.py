"""The flight file by its short name: `from insgnss.flight import load_flight`.

What a flight file may say stands in `insgnss.config.flight_file`, its reader in
`insgnss.config.load`; the page about it is data_specs/flight_file.md.
"""

from .config.camera_options import CameraInput
from .config.filter_options import FilterOptions, InitialAttitude
from .config.flight_file import Flight, Output, TangentPlane
from .config.gnss_options import GnssInput
from .config.imu_options import ImuInput
from .config.load import load_flight
from .config.ppk_options import RawGnss

__all__ = [
    "CameraInput",
    "FilterOptions",
    "Flight",
    "GnssInput",
    "ImuInput",
    "InitialAttitude",
    "Output",
    "RawGnss",
    "TangentPlane",
    "load_flight",
]
