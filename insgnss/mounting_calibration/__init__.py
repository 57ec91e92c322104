"""What stands behind `insgnss calibrate tripod | similarity | materialise`: files in, a verdict on
each component of the mounting, `mounting.toml` and a page out.

The formulas stand in `insgnss.calibrate`; here files are read and joined by names (`poses`), what
does not belong together is named (`readings`), and results become products (`products`).
"""
