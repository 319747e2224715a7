"""Write the claims table of README.md from the files in figures/; with `--check` only compare."""

from __future__ import annotations

import sys

import pandas as pd

from replication.files import write_file
from replication.paths import PROJECT
from replication.tables import markdown, readable_claims

BEGIN = "<!-- results: written by `make readme` from figures/, checked by the tests -->\n"
END = "<!-- end of results -->\n"
COLUMNS = ["Claim", "Place", "F", "Difference [95 %]", "Paper", "SD ratio", "p (Holm)", "Verdict"]
MAZES = {"Open maze": "table1_claims.csv", "Maze with obstacles": "table2_claims.csv"}


def results() -> str:
    """Return the claims of both mazes as one Markdown table."""
    parts = []
    for maze, name in MAZES.items():
        table = pd.read_csv(PROJECT / "figures" / name)
        readable = readable_claims(table)[COLUMNS]
        readable.insert(0, "Maze", maze)
        parts.append(readable)
    return markdown(pd.concat(parts))


def main() -> int:
    """Replace the block between the marks; return 1 if `--check` finds another one there."""
    path = PROJECT / "README.md"
    text = path.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    new = f"{before}{BEGIN}\n{results()}\n{END}{after}"
    if "--check" in sys.argv[1:]:
        if new != text:
            print("README.md does not show the results in figures/: run `make readme`")
        return int(new != text)
    write_file(path, new)
    return 0


if __name__ == "__main__":
    sys.exit(main())
