"""Verbs of pages that insgnss wrote: `figures` and `report`."""
