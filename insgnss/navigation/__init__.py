"""From samples and fixes to smoothed states, and which error model explains them.

It imports `base`, `geodesy` and `records` and nothing of `io`: arrays in, arrays out. All wings
above import it but `report`.

The way of the data, room by room
    `prepare/` one clock, one axis convention, increments, the covariance of fixes, standstill (one
        door for samples: `prepared` in `imu.py` there); `noise_model/` an IMU's noise as a sum of
        named processes; `recognise/` what a recording says of its own units, axes and clocks
    `align/` the first attitude with its covariance, and the bias at turn-on
    `filter/` strapdown, error model, filter, smoother; its `kernels/` see a whole flight
    `innovations/` their likelihood and noise; `diagnosis/` which error model explains them
    `orient/` lever arms, bore-sight, mount: from the trajectory to the exterior orientation

Where to look
    lever arm of the antenna: `filter/kernels/measurements.py` (value and Jacobian), derivation in
        `filter/filter.py`; in the alignment `align/coarse.py`, `initial.py` there
    lever arm of the camera, eo.json's velocities and rates (O.3), the attitude in the tangent plane
        (O.1): `orient/exterior.py`; in the frame of an export: `orient/frame.py`
    the 5-sigma gate: `gate_from_sigma` in `filter/filter.py`, NIS in `filter/kernels/update.py`,
        decision in `forward.py` there
    ZUPT, ZARU, NHC: epochs in `filter/epochs.py`, rows in `filter/kernels/measurements.py`,
        stationarity in `prepare/stationarity.py`
    barometer: `prepare/barometer.py`, `barometer_rows` in `filter/kernels/measurements.py`, (K.12)
        in `filter/filter.py`
    a measurement given by its prediction: `filter/linearised.py`, again after each pass in
        `filter/solution.py`, `linearised_rows` in `filter/kernels/measurements.py`, (K.13)
    covariance of a fix: rules in `prepare/fix_covariance/__init__.py`, applied once by `decide` in
        `decision.py` there, few digits too; what is not believed: `classes.py`, what says nothing
        beside better fixes: `quality.py` there; dead bands: `prepare/dead_band.py`
    gaps of the IMU: `prepare/gaps.py`, bridged in `increments.py` there, their variance in
        `add_gap_noise` of `filter/kernels/error_model.py`
    noise numbers: `noise_model/models/`, read by `noise_model/model.py`
    first attitude: `align/initial.py`, of measurements where nothing moves `measured.py` there;
        whether a nose need follow its course:
        `recognise/propulsion.py`
    latitude and longitude exchanged, in radians, of the wrong sign: `recognise/positions.py`,
        `_mirrored` in `recognition.py`; left-handed readings: `handedness.py`; gross errors of
        clocks: `turns.py`, latency: `fit.py`; the advice on all of it, a clock set in flight:
        `claims.py` there
    time offset of the fixes: state in `filter/layout.py`, `fix_delay` in
        `filter/kernels/measurements.py`; search, advice and its share in the stamps in
        `diagnosis/decision.py`, `advice.py`, `remedies.py` there
    clock of the camera: poses and covariances in `filter/event_clock.py`
    which constant is wrong, or whose noise is larger: evidence in `diagnosis/constants.py`,
        `sensitivity.py` (spares a pass), `variances.py`, `clock_step.py`; the winner in
        `decision.py`; verdict, limits, words in `advice.py` there
    time-correlated errors of the fixes: `diagnosis/time_correlated.py`
    incorrect fixes: `diagnosis/incorrect_fixes.py`, withheld in `filter/kernels/forward.py`; what
        is tried: `REMEDIES` in `diagnosis/remedies.py`; without a solution: `failure.py` there
    incorrect values of further sensors: `innovations/incorrect_values.py`, wrong ones
        as a whole: `wrong_sensor.py` there; what they would have brought: `sensor_trial.py`
    fixes minus solution, minute by minute: `innovations/residuals.py`
    covariance of neighbouring images: (B.5) in `filter/smoother.py`, `filter/kernels/forward.py`,
        `backward.py` there; as relative control: `orient/relative.py`
    covariance of a flight line, and what lines have in common: (B.8) in `filter/smoother.py`,
        (B.8), (B.9) in `event_chain.py` there, lines in `orient/strips.py`
    what images make of the states at all epochs: (B.10) to (B.13) in `filter/correction.py`
    filter and smoother block by block: `filter/blocks.py`, kept covariances: `covariances.py`,
        between epochs: `trajectory.py` there
    digits of the covariance through an outage: (B.6) in `filter/smoother.py`, `kernels/outage.py`
        there; between which fixes: `OUTAGE_S` in `filter/filter.py`
"""
