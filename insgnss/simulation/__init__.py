"""Exact motion and exact sensors.

Flights in the shape of the open data set, with the truth beside every observation.

`motion` is exact, `path` and `layout` plan, `flights` flies, `ground` drives and walks, `emulate`
follows a trajectory that was flown, `sensors` and `receiver` observe, `raw_gnss` measures to a
`constellation` what `rinex_files` write, `image_block` measures in images (`simulate_block`),
`faults` spoil the recording, `scenario` keeps a whole flight in memory (`simulate_flight`,
`observe`) and `dataset` writes it as files (`write_dataset`, `write_simulated`).
"""
