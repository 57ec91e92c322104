"""Noise models from recordings: moments, estimation, `insgnss tune`, and an IMU's calibration.

It imports `base`, `geodesy`, `records`, `io`, `navigation`, `report` and `flight`; `simulation`,
`api` and `cli` import it. The model itself and its file belong to
`insgnss/navigation/noise_model/`, since the filter needs them.

The way of the data, room by room
    `tuning/` reads and checks static recordings (`recordings.py` there)
    `moments/` makes wavelet variances of them, and of models the same with their covariance
    `estimation/` fits composite models to the variances (GMWM), with tests of fit
    `tuning/` gives the verdict and the noise model's file (`static.py` has the order there);
        `tuning/in_flight/` starts from the innovations of a flight instead
    `processes/` draws realisations of a model, and writes it as other programs read it
    `multi_position/` is the deterministic calibration of an IMU from static positions

Where to look
    the wavelet (Allan) variance: of data `moments/wavelet.py`, of a model `theory.py` there; as a
        chart `insgnss/report/figures/noise.py`
    a new noise process: "How to add" in `docs/ARCHITECTURE.md`
    its realisation: `processes/realisation.py`, its letters `composition.py` there
    the covariance of the variances: `moments/haar_covariance.py`
    choosing a model: `tuning/fitting.py`; processes a recording cannot determine: `usable.py`
        there; warming up: `trend.py` there; the bias at turn-on: `static.py` there
    recordings of some channels: `tuning/some_channels.py`; several IMUs: `several.py` there
    options: `tuning/options.py`; pages: `tuning/result.py`, `tuning/in_flight/result.py`
"""
