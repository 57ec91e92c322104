"""What stands behind `insgnss adjust`: from files to an adjusted block, its judgement and products.

inputs -> plausibility -> control -> solve -> figures, judgement -> products, in `run`.

============== ===================================================================
inputs         files of the block file joined to one block in the tangent plane
ground         ground points in the axes of the block
parameters     unknowns between trajectories and images, as the block file asks for them
placing        first poses of a program's own axes
plausibility   whether rays meet with the poses that are given; `readings` that do
control        aerial control of the orientation, its mounting and its flight lines
vehicle        kinematic ground control: a vehicle whose target the images see
solve          adjustment without gross errors, variances by components
figures        everything that was determined, as adjust.json has it
residuals      check points, judged together; what residuals have in common on the format
judgement      what contradicts, what was determined and what not, in sentences
trials         what explains a contradiction: each remedy is adjusted
products       eo.json, exports, cameras, mounting, adjust.json; `page` the page
trajectory     the flight after the images, by `--trajectory`
plan           the precision to expect of a block that is not measured yet
============== ===================================================================
"""
