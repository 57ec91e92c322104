"""Many flights: a season, its archive, and what an installation can do."""
