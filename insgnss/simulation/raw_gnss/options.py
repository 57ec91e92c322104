"""Options of simulated raw GNSS data: how rover and base measure and err."""

from dataclasses import dataclass, field

from ...base.errors import UsageError
from ...io.options.kinds import check
from ...io.options.schema import option
from .atmosphere import Weather
from .errors import Tracking

SHELL_REACH_M = 1.5e6  # from the site to where rays of 6 deg pierce the ionosphere


@dataclass(frozen=True)
class RawGnssOptions:
    """How rover and base measure and err.

    rate_hz, base_rate_hz.

    Parameters
    ----------
    systems : of G and R.
    base_offset_m : north, east, up of the base from the site's origin, up along the ellipsoidal
        normal.   elevation_mask_deg; antenna_mask_deg : against the plane of the antenna, which
        banks.
    code_sigma_m, phase_sigma_m : white; code_multipath_m, phase_multipath_m : Gauss-Markov of
        multipath_s; all at zenith, and over the sine of the elevation.
    doppler_sigma_ms : white. iono_vertical_m, iono_rate_ms, iono_gradient (m/m, of random
        direction), iono_wave_m : of the delay on L1 (`raw_air`). The first alone shortens a
        baseline, as the engine finds it from L1 and L2, by 0.6 mm/km for each metre; it must
        outweigh the gradient over the 1500 km to where the lowest rays pierce the shell.
    weather : at the base.
    clock_offset_s, clock_drift : of either receiver, the first drawn evenly up to this, the second
        a standard deviation.
    clock_jump_s : 0.001 for millisecond jumps, 0 for none.
    hardware_bias_m : sd of B.
    glonass_code_bias_m : sd for each frequency number.
    glonass_phase_bias_m : of the rover against the base, times the number.
    broadcast_error_m : sd of each axis of an orbit and of its clock.
    tracking : of the rover; base_share of its rates for the base.
    """

    rate_hz: float = option(10.0, "epochs of the rover a second", unit="Hz", positive=True)
    base_rate_hz: float = option(1.0, "epochs of the base a second", unit="Hz", positive=True)
    systems: str = option("GR", "GPS G and GLONASS R", kind="letters", choices=("G", "R"))
    base_offset_m: tuple[float, float, float] = option(
        (1200.0, -900.0, 6.0), "the base from the origin, north, east, up", unit="m"
    )
    elevation_mask_deg: float = option(7.0, "lowest elevation", unit="deg", low=3.0, high=60.0)
    antenna_mask_deg: float = option(-10.0, "lowest angle to the plane of the antenna", unit="deg")
    code_sigma_m: float = option(0.15, "white noise of codes at zenith", unit="m", low=0.0)
    phase_sigma_m: float = option(0.0015, "white noise of phases at zenith", unit="m", low=0.0)
    code_multipath_m: float = option(0.15, "multipath of codes at zenith", unit="m", low=0.0)
    phase_multipath_m: float = option(0.0012, "multipath of phases at zenith", unit="m", low=0.0)
    multipath_s: float = option(20.0, "correlation time of multipath", unit="s", positive=True)
    doppler_sigma_ms: float = option(0.02, "white noise of Doppler", unit="m/s", low=0.0)
    iono_vertical_m: float = option(2.5, "vertical ionospheric delay on L1", unit="m", low=0.0)
    iono_rate_ms: float = option(1e-4, "its rate", unit="m/s")
    iono_gradient: float = option(1.5e-6, "its gradient, m/m")
    iono_wave_m: float = option(0.01, "amplitude of a travelling wave", unit="m", low=0.0)
    weather: Weather = field(default_factory=Weather)
    clock_offset_s: float = option(1e-4, "largest offset of a receiver clock", unit="s", low=0.0)
    clock_drift: float = option(3e-8, "standard deviation of its drift", low=0.0)
    clock_jump_s: float = option(0.0, "size of its jumps, 0: none", unit="s", low=0.0)
    hardware_bias_m: float = option(3.0, "standard deviation of hardware biases", unit="m", low=0.0)
    glonass_code_bias_m: float = option(
        0.3, "standard deviation of code biases of a GLONASS frequency number", unit="m", low=0.0
    )
    glonass_phase_bias_m: float = option(
        0.001, "phase bias of rover against base, times the GLONASS frequency number", unit="m"
    )
    broadcast_error_m: float = option(
        1.0, "standard deviation of orbits and clocks, each axis", unit="m", low=0.0
    )
    tracking: Tracking = field(default_factory=Tracking)
    base_share: float = option(
        0.1, "rates of slips and losses at the base as a share of the rover's", low=0.0, high=1.0
    )

    def __post_init__(self) -> None:
        check(self, "raw_gnss")
        if abs(self.iono_gradient) * SHELL_REACH_M > self.iono_vertical_m:
            excess = (
                f"iono_gradient {self.iono_gradient:g} takes more than iono_vertical_m"
                f" {self.iono_vertical_m:g} over {SHELL_REACH_M:g} m"
            )
            raise UsageError(f"raw GNSS: {excess}; no delay can be negative")
