"""A page in a headless browser."""

import os
import subprocess
from pathlib import Path

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr", "--hide-scrollbars",
)  # fmt: skip


def browse(chromium: str, tmp_path: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Open a page with `options`; its process, whose stderr holds the console."""
    profile = tmp_path / "profile"
    home = {**os.environ, "HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    return subprocess.run(
        [chromium, *FLAGS, f"--user-data-dir={profile}", *options],
        capture_output=True,
        text=True,
        timeout=120,
        env=home,
    )
