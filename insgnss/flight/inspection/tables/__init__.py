"""Unknown tables: which column is what, which clock, which units."""
