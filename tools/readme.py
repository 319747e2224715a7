"""Write docs/findings.md and the answer in README.md from figures/; `--check` only compares.

The prose is docs/findings.md.jinja. The words around its numbers are checked against them in
`tests/trends/test_readme.py`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from replication import files
from replication.files import write_file
from replication.site.findings import render_findings

BEGIN = "<!-- answer: written by `make readme` from figures/, checked by the tests -->"
END = "<!-- end of answer -->"

NOTE = "<!-- Written by `make readme` from findings.md.jinja and figures/: change those. -->\n\n"


class MarkError(ValueError):
    """A mark in README.md is missing or stands twice; the message is one line."""


def fill(text: str, answer: str) -> str:
    """Return a README with the answer between its marks.

    Raises
    ------
    MarkError
        If a mark is missing, stands twice, or the second comes first.
    """
    for mark in (BEGIN, END):
        if (count := text.count(mark)) != 1:
            raise MarkError(f"README.md: {mark!r} stands there {count} times; it must be once")
    before, _, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise MarkError(f"README.md: {END!r} must come after {BEGIN!r}")
    return f"{before}{BEGIN}\n\n{answer}\n\n{END}{after}"


def written() -> dict[Path, str]:
    """Return both files as they should be."""
    readme = files.PROJECT / "README.md"
    findings, answer = render_findings(files.PROJECT / "figures")
    return {
        readme: fill(readme.read_text(encoding="utf-8"), answer),
        files.PROJECT / "docs" / "findings.md": NOTE + findings,
    }


def main() -> int:
    """Write both files; with `--check`, return 1 if one is not up to date."""
    try:
        wanted = written()
    except MarkError as error:
        print(error)
        return 1
    stale = [
        path
        for path, text in wanted.items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    for path in stale:
        if "--check" in sys.argv[1:]:
            print(f"{path.name} does not show the results in figures/: run `make readme`")
        else:
            write_file(path, wanted[path])
    return int("--check" in sys.argv[1:] and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
