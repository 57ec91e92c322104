"""Sensors of a flight file beside IMU, fixes, camera and barometer: tables [[measurement]].

`options.py` has the keys of the table; `kinds.py` the kinds, a shipped one of which is a module of
its own, and the reading of a file into a `records.measurements.Measurement`.
"""
