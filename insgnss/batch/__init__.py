"""Many flights, their archive, and what an installation can do.

It imports `base`, `geodesy`, `records`, `io`, `navigation`, `report`, `gnss` and `flight`; `api`
and `cli` import it.

The way of the data, room by room: `season/` gathers flights (`gathering.py`), foresees their memory
(`run.py`), processes them side by side (`pool.py` on this machine, `scheduler.py` by Dask),
keeps a row of each report (`row.py`), looks for trends of an equipment and writes one table and one
page; `run.py` has the order. `installation/` is `insgnss doctor`: `examination.py` has the
findings in their order.

Where to look
    whether a flight need not be processed again: `report_in_force` in `season/work.py`, from
        report.json alone
    whether an equipment drifts: (T.1), (T.2) and limits in `season/trends.py`; what a flight alone
        says of its constants: `estimates` in `insgnss/navigation/diagnosis/constants.py`, in
        report.json `constants`
    what can be made again from its inputs (`insgnss archive`): `season/archive.py`
    the table and the page of a season: `season/tables.py`, `page.py` there
    packages by their metadata: `installation/packages.py`
    machine, kernels on disk, grids, the PPK engine: `installation/examination.py`
    kernels compiled ahead (`doctor --compile`): `installation/compiling.py`
    the compiled core against a closed form: `installation/self_test.py`
    every numeric constant with its reason (`doctor --limits`): `installation/limits.py`
    a new finding of `doctor`: a function that returns a `Finding` (`insgnss/base/findings/`),
        listed in `installation/examination.py`
"""
