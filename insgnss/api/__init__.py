"""What `import insgnss` offers: the functions behind its public names, each a thin layer.

It imports every wing; `insgnss/__init__.py` and `cli` import it. A function here checks
what a caller of Python may pass, calls the room that does the work, and returns its result; it
computes nothing.

The way of the data: `insgnss/__init__.py` has the names and loads a module of this wing when a name
is first used. `verbs.py`, `products.py`, `calibration.py` and `targets.py` go from files to files
by the rooms that the command line uses too; `estimation.py` goes from arrays to records without any
file; `readers.py` brings products back into records.

Where to look
    `process`, `adjust_block`, `inspect`, `tune`, `calibrate_imu`, `simulate`: `verbs.py`
    `export`, `compare`, `figures`, `ppk`, `relative_control`: `products.py`
    `calibrate_tripod`, `calibrate_similarity`, `calibrate_materialise`, `calibrate_mounting`:
        `calibration.py`
    `predict_targets`, `measure_targets`: `targets.py`
    `estimate` (samples, fixes and events as arrays): `estimation.py`
    `read_eo`, `read_trajectory`: `readers.py` (recorded files: `insgnss/io/formats/__init__.py`)
    the demonstration, a simulated flight against its truth: `demo.py`
    a new public name: `_ROOMS` and the imports of `insgnss/__init__.py`, `docs/reference/api.md`
"""
