"""Exact motion and exact sensors: flights in the shape of the open data set, with the truth beside every observation.

`motion` is exact, `path` and `layout` plan, `flights` flies, `sensors` observe, `scenario` keeps a whole flight in memory
(`simulate_flight`) and `dataset` writes it as files (`write_dataset`).
"""
