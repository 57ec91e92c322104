"""What `import insgnss` offers: the functions behind its public names, each a thin layer over the
rooms.

`verbs` are those of the command line, `estimation` runs on arrays without any file, `readers` bring
products back. The names themselves stand in `insgnss/__init__.py`, which loads them when they are
used.
"""
