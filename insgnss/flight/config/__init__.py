"""What a user can ask for: the options of a flight, each stated once, and the file that gives them.

`io.options.schema` says what an option declares, `io.options.kinds` what its values may be.
`flight_file`, `imu_options`, `gnss_options`, `filter_options`, `camera_options` of io.options,
`ppk_options` and `covariance_model` of gnss declare all of them, as the dataclasses that the wings
work with. `load` reads a flight file into
them, by `values`, which adds file and line to a refusal; `keys` takes shared files and changes, and
`Flight.resolved` writes everything out again. `scripts/render_options.py` renders the page
data_specs/flight_file.md, `command_line` the arguments of a verb, from the same declarations.
Importing the declarations loads the standard library only.
"""
