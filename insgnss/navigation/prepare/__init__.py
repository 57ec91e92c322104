"""From what was read to what is estimated from: one clock, one axis convention, every gap named.

`clock`, `calibration`, `stuck_channels`, `fix_covariance` and `several_imus` bring the samples and
fixes into shape; `stationarity` detects the stationary periods; `gaps` and `increments`
make what the filter integrates.

Samples come in by one door: `imu.prepared` takes all these steps and returns a `PreparedImu`.
"""
