"""One conversion of a receiver's log by RTKLIB, in a process of its own:
`python -m insgnss.gnss.engine.convert_worker FORMAT FILE OBSERVATIONS NAVIGATION [Y,M,D,h,m,s]`.

FORMAT is a name of RTKLIB's stream formats (UBX, SEPT, RTCM3). Failures are reported on standard
error, with exit code 1.
"""

import sys

# RINEX 3.04; bits of code, phase, Doppler and C/N0, and of the six carriers of RTKLIB
RINEX_304, ALL_KINDS, ALL_FREQUENCIES = 304, 15, 63
OUTPUTS = 9  # files that convrnx() takes names of: observations, navigation, seven others


def main(arguments: list[str]) -> int:
    """Run convrnx() on the arguments, and return its exit code."""
    import pyrtklib5 as rtklib

    stream_format, log, observations, navigation, *date = arguments
    options = rtklib.rnxopt_t()
    options.rnxver = RINEX_304
    options.navsys = rtklib.SYS_ALL
    options.obstype = ALL_KINDS
    options.freqtype = ALL_FREQUENCIES
    if date:
        calendar = rtklib.Arr1Ddouble(6)
        for k, value in enumerate(date[0].split(",")):
            calendar[k] = float(value)
        options.trtcm = rtklib.epoch2time(calendar)
    files = [observations, navigation, *[""] * (OUTPUTS - 2)]
    status = rtklib.convrnx(getattr(rtklib, f"STRFMT_{stream_format}"), options, log, files)
    if status > 0:
        return 0
    sys.stderr.write(f"convrnx() returned {status}\n")
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
