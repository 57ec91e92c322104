"""The flight file by its short name: `from insgnss.flight import load_flight`.

What a flight file may say stands in `insgnss.config.flight_file`, its reader in
`insgnss.config.load`; the page about it is data_specs/flight_file.md.
"""

from .config.camera_options import CameraInput
from .config.flight_file import (
    FilterOptions,
    Flight,
    ImuInput,
    InitialAttitude,
    Output,
    TangentPlane,
)
from .config.gnss_options import GnssInput
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
