"""What is published, for other programs: an RO-Crate with CodeMeta and Croissant in it.

`write` makes the folder. `crate`, `run` and `verdicts` describe what was run and found, `croissant`
and `columns` the data, `codemeta` the package; the other modules are what these have in common.
Nothing is executed, and the same published files give the same bytes.
"""
