"""From what was read to what is estimated from: one clock, one axis convention, every gap named.

`clock`, `axes`, `calibration`, `hanging`, `quality` and `combine` bring the samples and fixes into
shape; `still` finds the rests; `gaps` and `increments` make what the filter integrates.
"""
