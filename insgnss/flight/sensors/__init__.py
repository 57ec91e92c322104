"""Sensors of a flight file beside IMU, fixes, camera and barometer: tables [[measurement]].

`options.py` has the keys of the table; `kinds.py` what a kind is, and the reading of a file into a
`records.measurements.Measurement`; `shipped.py` the kinds that are shipped; `trials.py` those that
a flight with an uncertain heading is tried with.
"""
