"""Exact motion and exact sensors: flights with the truth beside every observation.

It imports `base`, `geodesy`, `records`, `io`, `navigation`, `gnss` and `noise`; `photogrammetry`
(the dry run of a block), `api` and `cli` import it. Nothing of it is a filter: what it observes
comes from closed forms, so that the core can be tested against it.

The way of the data: a plan (`layout.py`, `path.py`) becomes an exact motion (`motion.py`), flown by
`flights.py` or `ground.py` (circles, multirotors: `scripts/air_motions.py`; a recorded trajectory:
`scripts/emulate.py`).
`sensors.py` observes it, `faults.py` spoils the recording. `scenario.py` keeps a whole flight in
memory (`simulate_flight`, `observe`); `dataset.py` writes it as files (`write_dataset`,
`write_simulated`), with `description.py` beside them.

Where to look
    the inertial signals of a motion: `motion.py`, compiled in `_kernels.py`
    samples, exposures and the antenna's place: `sensors.py`; fixes: `raw_gnss/receiver.py`
    codes and phases as RINEX: `raw_gnss/scenario.py` with `constellation.py`, `rinex_files.py`
        there
    images and their observations: `image_block.py` (`simulate_block`)
    gaps, stuck channels, clocks, signs, vibration, rows in disorder: `faults.py`
    image blocks of the literature, with poses whose errors are drawn: they stand outside the
        package in `benchmarks/published_blocks/`, reached by `plug.py`
"""
