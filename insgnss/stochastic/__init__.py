"""IMU noise as sums of named processes: their file, their exact discretisation; `moments` and
`estimation` of them from records.
"""
