"""The covariance of a fix: one table of rules, and the one place where they act.

Readers report what a source states: standard deviations as they are printed (a zero among others
that reach down to the last digit is half of that digit, six zero roots of RTKLIB are none), for
which fixes it states none, and the place of the base. `decision.decide` then applies these rules,
each to what the one before left, in this order, once a recording:

    rule        acts on                                      effect
    ----------  -------------------------------------------  -------------------------------------
    stated      fixes with standard deviations               C of the source
    assumed     fixes without                                C = diag(gnss.sigma_m^2); of PPK
                                                             `numbers.UNKNOWN_SIGMA_M`, as single
    calibrated  positions of an engine with quality,         (V.1) to (V.6) of `classes`: C' = K C K
                satellites and base: a `.pos`, unless        + floor^2 + (ppm d)^2 by class; fixed
                gnss.calibrate_covariance = false; PPK,      ones that nothing confirms are float
                by both of its runs (gnss.ppk)
    raised      fixes of a quality with a floor              the variance missing to the floor is
                (gnss.quality_sigma_m; by default            added to the axis that lacks it
                `numbers.QUALITY_SIGMA_M`, of PPK none,
                whose classes have floors)
    left out    fixes of a better quality than the usual,    none: they leave the recording
                with several times the sigma of those
                around them (`quality`)
    rounded     positions with fewer digits than their       n q^2 / 12 is added (Q.1) of `decision`
                sigma claims

PPK calibrates while it solves, since its corrections of troposphere and ionosphere come after that
and add their own covariance; its fixes are stated and calibrated when they arrive here. What scales
the errors of all fixes of a flight alike (`gnss.white_scale`, `gnss.gm_sigma`, what `diagnosis`
adopts: wider, or narrowed where no lasting error may hide in the claim) belongs to the filter's
error model and not to the covariance of a fix.
"""
