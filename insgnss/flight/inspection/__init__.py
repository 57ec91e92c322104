"""`insgnss inspect` on anything: find the files, recognise what they hold, draft the flight file.

Public: `run.inspect_files`, and `described.inspect_flight` for what a flight file describes.
"""
