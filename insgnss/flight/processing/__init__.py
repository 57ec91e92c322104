"""From a flight file to its products: the steps of a run, in the order of `pipeline`.

pipeline            the one place that knows the order: `process`
input_files         the files of a flight as records
recording           the observations on one clock, checked
checks              the checks of a run, and what stops it
segment             a segment between gaps: prepare -> align -> filter -> smooth
estimation_problem  the problem that a segment poses: increments, measurements, states
orientation/        the trajectory and the orientation of the images
diagnostics         what the report shows
history             what was done, in sentences
result              the record of a run
products            the files of a run
progress            the name and the time of each step
"""
