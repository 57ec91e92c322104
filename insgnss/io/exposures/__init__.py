"""Which exposure is which image: camera events of any source get the names of the images that
belong to them.

`images` reads the names and times of the files of the images, `match` brings events and names
together, by `clocks` where there are times, `naming` does so as a flight file asks. `numbering`
notes names and stamps that do not go together. `rig` has the exposures of all cameras and whose
clock stamps them; `instants` brings them to the clock of the recording in one stop, with what their
digits lost.
"""
