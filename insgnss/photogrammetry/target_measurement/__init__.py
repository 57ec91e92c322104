"""`insgnss targets`: ground points of a flight, predicted and measured in its photographs.

============ =====================================================================================
request      what is asked for
inputs       exterior orientation, camera and ground points in one frame; what is predicted of them
photographs  the photographs of a directory, one at a time
windows      all targets of all photographs, with the verdict on each
trials       what would have found the targets, where nearly none was found
products     tables and the files of other programs
sheet        the contact sheet
run          the two jobs, with their texts for the terminal
============ =====================================================================================
"""
