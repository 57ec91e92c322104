"""Judge a run from its records.

`summary.run_summary` makes report.json, `page.write_report` a page with the pictures of `figures`.

Nothing here computes navigation; it counts, compares with what the filter promised, and says in
words what limits the flight.
"""
