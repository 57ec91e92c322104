"""Image blocks: adjustment, mounting, targets, and comparison with poses of other programs.

It imports `base`, `geodesy`, `records`, `io`, `navigation`, `report`, `flight` and (for the dry run
of a block) `simulation`; `api` and `cli` import it.

The way of the data, room by room; the last four are each behind a verb
    `adjust/` the adjustment itself: observation groups with full covariances, precision and tests
    `lever_arm/` adjustments of a lever arm alone; `targets/` one ground point in one image:
        predicted, searched, matched, accepted or rejected
    `comparison/` poses of any two files held against each other: `compare`
    `block_adjustment/` files joined to a block, checked, adjusted, judged, written: `adjust`
    `mounting_calibration/` poses and positions of any file adjusted with the flight, verdicts,
        `mounting.toml`: `calibrate tripod, similarity, materialise, mounting`
    `target_measurement/` ground points in the photographs of a flight: `targets`

Where to look
    image observations, derivatives, points eliminated: `adjust/kernels/collinearity.py`,
        `elimination.py` there; derivation in `adjust/__init__.py`
    thousands of images: `adjust/ordering.py` (in which order), `envelope.py` there (what is stored)
    weights by variance components: `adjust/variance_components.py`; unknowns hardly told apart:
        `separation.py` there; an advice there needs a flight in which it helps, in
        `tests/photogrammetry/adjust/test_separation.py`
    another observation, such as a distance: a group as in `adjust/groups.py` (residual, Jacobian
        over named blocks of unknowns, weight matrix); the engine stays as it is
        (`tests/photogrammetry/adjust/test_adjustment.py` brings two of its own)
    flight lines weighed by their covariance: (J.8) in `adjust/aerial.py`, groups in
        `block_adjustment/aerial/control.py`
    relative control: (J.12 to J.18) in `adjust/relative.py`; pairs, weights, weak datum in
        `block_adjustment/aerial/relative.py`
    indirect, Fast AT, direct: `block_adjustment/mode.py`; points from held poses (J.19, J.20):
        `adjust/direct.py`, by `block_adjustment/solve.py`, `residuals/check_points.py` there
    kinematic ground control: (J.21) to (J.23) in `adjust/kinematic.py`; files, (KI.1), wrong clock,
        base or lever arm: `block_adjustment/vehicle/`; options:
        `insgnss/flight/config/block_tables/vehicle.py`; size (GT.7):
        `target_measurement/products.py`
    ground points in the axes of a block: `block_adjustment/ground.py`; first poses: `placing.py`
        there
    groups that contradict each other: `block_adjustment/judgement.py`; what explains it, each
        adjusted again: `trials.py` there
    files that do not belong together: `block_adjustment/plausibility.py`; how they would fit:
        `readings.py` there, of a calibration `insgnss/geodesy/readings.py`
    lever arm, bore-sight, delay of a flight from poses: (L.1) to (L.6) in
        `mounting_calibration/equations.py` and `solution.py`, its other modules in `__init__.py`
        there; a delay along the flight direction: `lever_arm/flight_direction.py`
    dense least squares of every calibration: `insgnss/geodesy/least_squares.py`
    a lever arm from camera poses: `lever_arm/tripod.py`, `similarity.py` (in flight),
        `materialisation.py` (targets on camera and receiver) there
    a ground point is seen: `VISIBILITY` in `targets/prediction.py`; its target was found: `Rules`
        in `measurement.py`, `neighbours.py`; another kind: `signals.py`; ring codes: `codes.py`
        there
    photographs: `target_measurement/photographs.py`; nearly nothing found: `FEW` in `run.py`,
        `trials.py` there
    pages: `block_adjustment/page.py`, `comparison/result.py`, `mounting_calibration/products.py`
"""
