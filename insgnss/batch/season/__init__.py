"""Many flights: `insgnss batch` processes a season, `insgnss archive` checks its products.

`gathering`  which flights: directories, patterns, flight files, a table of flights
`work`       one flight in a worker: skipped where its products are those of its inputs
`pool`       flights side by side on this machine, memory, deaths of workers
`scheduler`  the same on the workers of a Dask scheduler that is there
`row`        what of a flight's report stands in the table of the season
`trends`     constants of an equipment over the season: drift, scatter, or nothing to tell
`earlier`    what differs in a flight from the earlier ones, for its page
`page`       index.html; `tables` season.csv and season.parquet
`run`        all of it in its order, and the memory that a flight will need
`archive`    what can be made again from its inputs, and what not
"""
