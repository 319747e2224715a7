"""The report: a static site built from published notebooks, without executing anything.

`build` checks and lays out, `pages` turns a published notebook into a page, `findings` and
`overview` write what concerns all of them, and `extension` adds to Sphinx. The prose is in `docs/`.
"""
