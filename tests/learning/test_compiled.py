import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from replication.learning import compiled


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
        [sys.executable, "-c", "import compiled; compiled.load((1, 2, 3, 4))"],
        cwd=module.parent,
        env=environment | {"HOME": str(home), "XDG_CACHE_HOME": str(home)},
        check=True,
    )
    places = {"package": tmp_path / "__pycache__", "user": home}
    kept = {name: any(folder.rglob("compiled.load*.nbc")) for name, folder in places.items()}
    assert kept == {name: name == writable for name in places}
