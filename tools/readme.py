"""Write the results in README.md from the files in figures/; with `--check` only compare."""

from __future__ import annotations

import sys

import pandas as pd

from replication.files import write_file
from replication.paths import PROJECT
from replication.tables import findings_of_sets, markdown, readable_claims

BEGIN = "<!-- results: written by `make readme` from figures/, checked by the tests -->\n"
END = "<!-- end of results -->\n"
COLUMNS = ["Claim", "Place", "F", "Effect [95 %]", "Paper", "p, Holm", "Verdict"]
CLAIMS = {
    "Open maze": "table1_claims.csv",
    "Maze with obstacles": "table2_claims.csv",
    "Robot soccer": "soccer_claims.csv",
}
SETS = {"Open maze": "open_maze_sets.csv", "Maze with obstacles": "obstacle_maze_sets.csv"}


def results() -> str:
    """Return the claims on all tasks as one table, and which demonstrations save iterations."""
    parts = []
    for task, name in CLAIMS.items():
        readable = readable_claims(_stored(name))[COLUMNS]
        readable.insert(0, "Task", task)
        parts.append(readable)
    sets = [f"{task}:\n\n{findings_of_sets(_stored(name))}" for task, name in SETS.items()]
    return "\n".join([markdown(pd.concat(parts)), *sets])


def _stored(name: str) -> pd.DataFrame:
    return pd.read_csv(PROJECT / "figures" / name, keep_default_na=False, na_values=[""]).fillna(
        {"F": "", "verdict": ""}
    )


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
