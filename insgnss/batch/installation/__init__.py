"""What `insgnss doctor` looks at: this installation, and whether its compiled core counts right.

`examination`   all findings in their order, as text and as a document
`packages`      what the package's own metadata asks for: present, new enough, importable?
`compiling`     the kernels of the main job compiled ahead, on all processors
`self_test`     the compiled strapdown against a closed form
`limits`        the numeric constants of the package and their reasons (`doctor --limits`)
"""
