import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from replication.learning import compiled


def test_no_trial_is_left_out_by_the_schedule() -> None:
    """Groups are at most two, each has a trial of its own, and only a few run one by one."""
    for live in range(200):
        groups = compiled.count_groups(live)
        assert 0 <= groups <= 2
        assert groups == 0 or live >= (groups - 1) * compiled.LANES + compiled.WORTHWHILE
        assert groups > 0 or live < compiled.WORTHWHILE


@pytest.mark.parametrize("writable", ["package", "user", "nothing"])
def test_compiles_wherever_it_can_or_cannot_write(tmp_path: Path, writable: str) -> None:
    """Compiled code is kept beside the package, or else in the user's folder, or else nowhere."""
    module = Path(shutil.copy(compiled.__file__, tmp_path))
    home = tmp_path / "home"
    # A file where a folder should be stops even an administrator from writing there.
    if writable != "package":
        (tmp_path / "__pycache__").touch()
    home.touch() if writable == "nothing" else home.mkdir()
    environment = {name: value for name, value in os.environ.items() if "CACHE" not in name}
    subprocess.run(
        [sys.executable, "-c", "import compiled; assert compiled.count_groups(30) == 2"],
        cwd=module.parent,
        env=environment | {"HOME": str(home), "XDG_CACHE_HOME": str(home)},
        check=True,
    )
    places = {"package": tmp_path / "__pycache__", "user": home}
    kept = {
        name: any(folder.rglob("compiled.count_groups*.nbc")) for name, folder in places.items()
    }
    assert kept == {name: name == writable for name in places}
