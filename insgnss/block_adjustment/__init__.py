"""What stands behind `insgnss adjust`: from files to an adjusted block, its judgement and products.

inputs -> plausibility -> control -> solve -> result -> products, and `plan` for a block that is
not flown yet.

============== ===================================================================
inputs         files of the block file joined to one block in the tangent plane
control        aerial control of the orientation, its mounting and its flight lines
plausibility   whether rays meet with the poses that are given; `readings` that do
solve          adjustment without gross errors, variances by components, trials
result         what was found, for the terminal and adjust.json
words          what was determined and what not, in sentences
products       eo.json, exports, cameras, mounting, adjust.json, the page
============== ===================================================================
"""
