"""Write the results in README.md from the files in figures/; with `--check` only compare."""

from __future__ import annotations

import sys

import pandas as pd

from replication.claims import claims
from replication.files import write_file
from replication.paths import PROJECT
from replication.sensitivity import findings_at_once
from replication.tables import markdown, read_table, readable_verdicts
from replication.verdicts import NOT_TESTABLE, REPRODUCED, overall

BEGIN = "<!-- results: written by `make readme` from figures/, checked by the tests -->\n"
END = "<!-- end of results -->\n"


def results() -> str:
    """Return the verdicts on the claims, and what they depend on."""
    judged = read_table(PROJECT / "figures" / "claims.csv")
    outcomes = read_table(PROJECT / "figures" / "sensitivity_outcomes.csv")
    shares = read_table(PROJECT / "figures" / "sensitivity_shares.csv")
    levels = read_table(PROJECT / "figures" / "sensitivity_levels.csv")
    compared = judged[judged["direction"] != "inside"]
    readable = readable_verdicts(compared)
    readable["Holds with other choices"] = [
        _holding(outcomes, id) for id in compared["id"].drop_duplicates()
    ]
    return "\n".join(
        [
            markdown(readable),
            _numbers(judged),
            "What the claims depend on:\n",
            "\n".join(findings_at_once(outcomes, shares, levels)) + "\n",
        ]
    )


def _holding(outcomes: pd.DataFrame, id: str) -> str:
    """Say in how many specifications a claim holds: of all choices at once, or one at a time.

    Those of the mazes are on several maps, and stand for the same claim on another maze as well.
    """
    claim, tested = claims().by_id(id), set(outcomes["claim"])
    same = [
        one.id
        for one in claims().claim
        if one.id in tested
        and (one.measure, one.statistic, one.x, one.y)
        == (claim.measure, claim.statistic, claim.x, claim.y)
        and (one.task == "soccer") == (claim.task == "soccer")
    ]
    own = outcomes[outcomes["claim"].isin(same)].set_index("group")
    for group in ("factorial", "single"):
        if group in own.index:
            row = own.loc[group]
            return f"{row['holds']} of {row['specifications'] - row['undefined']}"
    return "–"


def _numbers(judged: pd.DataFrame) -> str:
    """Say how many of the published numbers lie where they should."""
    verdicts = [
        overall(part["verdict"].tolist())
        for _, part in judged[judged["direction"] == "inside"].groupby("id", sort=False)
    ]
    tested = [one for one in verdicts if one != NOT_TESTABLE]
    runs = claims().judging
    return (
        f"Of the {len(tested)} published means, SDs and single runs that could be tested, "
        f"{tested.count(REPRODUCED)} are reproduced; [all verdicts](figures/claims.md), with the "
        f"numbers in [`claims.csv`](figures/claims.csv), from root seed {runs.root_seed}, "
        "which was used for nothing else before.\n"
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
