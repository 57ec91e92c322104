"""One module a file format, in and out, and which camera event is which image.

It imports `base`, `geodesy` and `records`. All wings above import it but `navigation`, `report` and
`batch`: the core knows no file.

The way of the data, room by room: `options/` declares what a reader can be told (type, unit, range,
default, meaning). `formats/` finds the format by ending and first bytes and makes a record, or
refuses with file and line; reading and writing stand side by side, in folders by what a file holds:
    `formats/imu/`, `formats/gnss/`, `formats/events/`, `formats/logs/`, `formats/arrays/` recorded
    `formats/trajectory/`, `formats/orientation/`, `formats/positions/`, `formats/bundle/`,
        `formats/gis/` estimated; `formats/returned/` given back by bundle adjustments
    `formats/blocks/`, `formats/markers/`, `formats/vehicle/`, `formats/images/` of image blocks
    `formats/text/` what all of them parse with
`exposures/` gives the events the names of their images and brings them to the recording's clock.

Where to look
    a new IMU format: `formats/imu/` (of an autopilot `formats/logs/`), readers in
        `formats/__init__.py`, its first bytes in `formats/detect.py`, one page in `data_specs/`
    a new export: `formats/bundle/`, `formats/gis/` or (poses, tables, graphs)
        `formats/orientation/`, one entry in `formats/exports.py`, one page in `data_specs/`; to be
        read by `compare`: `insgnss/photogrammetry/comparison/tables.py`, `reading.py` there; what
        an adjustment gives back: `formats/returned/reading.py`
    options of the camera: `options/camera_options.py`, of a comparison: `comparison_options.py`;
    of readers `formats/read_options.py`
    what is a number, and what is refused in its place: `float_of` in `formats/text/layout.py`; in
        XML, attributes, JSON `formats/text/numbers.py`
    columns of a large IMU table in two threads: `formats/text/direct.py`; what it refuses is read
        again by `parse` of `formats/text/text.py`, which says what and where
    a table of text: `TableSpec` and `TableOut` in `formats/text/columns.py`, stamps in `clock.py`
        there; which names a column may have, for readers and `inspect`: `formats/names.py`
    units of a header: `formats/text/headers.py`, factors in `units.py` there
    zeros of standard deviations: `formats/gnss/rounding.py`; clocks that were set, counters that
        begin anew: `formats/text/clock.py`, stamps spread evenly: `stamps.py`, dates:
        `dates.py` there
    gyros and accelerometers of two files: `formats/imu/apart.py`, found by
        `insgnss/flight/inspection/tables/halves.py`; two axes exchanged in both triads:
        `formats/imu/exchanged_columns.py`
    satellites, ratio, age and PDOP of ready fixes: `formats/gnss/`
    numbers of an eo.json of many images: `FROM_IMAGES` in `formats/orientation/eo_packed.py`
    covariance of all images of a flight line as a file: `formats/orientation/eo_covariance.py`
    `mounting.toml`: `formats/orientation/mounting_file.py`
    image blocks of photogrammetry programs: `read_measured_block` in `formats/blocks/reading.py`
        (its list `FORMATS`), the record `measured_block.py`, cameras for them `camera_files.py`
        there; names and pixels that do not belong together: `joined.py` there
    ground points in the axes of a block: `in_plane` of `formats/blocks/ground_points.py`
    Metashape, Pix4D, OpenDroneMap: `formats/markers/metashape_markers.py`, `pix4d_marks.py`
        there, `formats/blocks/gcp_list.py`; targets on a vehicle: `formats/vehicle/`
    which event is which image: `exposures/match.py`, `clocks.py`, `naming.py` there; names and
        stamps that do not go together `exposures/numbering.py`; offset, week, span and digits of
        the stamps `exposures/instants.py`
    whose clock stamps the exposures (`camera.clock`): `event_clock` in `exposures/rig.py`
"""
