"""Several IMUs on one rigid body: combined into one, and compared."""
