"""The flight file, the main job, first contact with unknown files, exports, and the textbook twin.

It imports `base`, `geodesy`, `records`, `io`, `navigation`, `report` and `gnss`; `noise`,
`photogrammetry`, `batch`, `api` and `cli` import it.

The way of the data: `inspection/` recognises files and drafts the flight file. `config/` reads it;
every option is stated once (type, unit, range, default, meaning). `sensors/` has the kinds of
[[measurement]]. `processing/pipeline.py` is the
one place that knows the order of the main job, read -> prepare -> align -> filter -> smooth ->
orient -> export; the steps themselves stand in `navigation`. `exporting/` and `proof/` are what
`export` and `export --proof` run. `reference/` is the core once more, on numpy and filterpy, to be
read, and `insgnss verify`.

Where to look
    a new option: one field in `config/` (`gnss_options.py`, `imu_options.py`, `filter_options.py`,
        `flight_file.py` there), of the camera `insgnss/io/options/camera_options.py`, of PPK
        `insgnss/gnss/ppk_options.py`; parser, messages and `data_specs/flight_file.md` follow
    a further sensor: a kind in `sensors/shipped.py`, and its row of data_specs/measurement.md
    keys shared by flight files: `config/include.py`
    the 5-sigma gate: option `gnss.gate_sigma` in `config/gnss_options.py`
    `mounting.toml` in a flight: `with_mounting_file` in `config/load.py`; camera, lens and date
        against the flight: `check_mounting_files` in `processing/checks.py`
    how observations come in: `processing/input_files.py`, to one clock in `recording.py` there
        (also errors of dead bands and of positions with too few digits)
    what stops a run: `processing/checks.py` (clocks, constants, datum); checks of a recording:
        `recording_checks.py` there, of a solved segment: `segment_checks.py`
    a segment the filter does not follow: `processing/solve_segments.py` walks `REMEDIES` of
        `insgnss/navigation/diagnosis/remedies.py`, and moves stamps by the time offset
    memory that does not suffice (`refuse_beyond_memory`) and rows of the output grid
        (`output_grid`): `processing/estimation_problem.py`
    the covariance of all images of a flight line joined, and the lever arm's share of errors:
        `processing/orientation/`
    in a table without names, which column is which: `inspection/tables/places.py`; gyros and
        accelerometers of two files: `halves.py` there; two axes exchanged: a draft's
        `inspection/exchanged_axes.py`; whose clock stamps exposures: `inspection/event_clock.py`
"""
