"""From what was read to what is estimated from: one clock, one axis convention, every gap named, every claim held against the data.

`clock`, `axes`, `calibration`, `hanging`, `quality` and `combine` bring the samples and fixes into shape; `plausibility` (with `turns`)
and `recognise` hold them against the flight file; `still` finds the rests; `gaps` and `increments` make what the filter integrates.
"""
