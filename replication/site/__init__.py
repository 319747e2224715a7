"""The report: a static site built from executed notebooks, without executing anything.

`build` checks and stages, `pages` turns an executed notebook into a page, `overview` writes what
the site says of all of them together, and `extension` is what Sphinx has to know. The prose is in
`docs/`.
"""
