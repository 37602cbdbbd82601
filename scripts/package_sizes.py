"""Install a wheel into an empty environment and print what each package takes: a table of the documentation.

Run it as `python scripts/package_sizes.py dist/thumper_robot-*.whl`.
"""

import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

REPORT = """
import importlib.metadata, json, re
packages = {}
plain = lambda name: name.lower().replace("_", "-")
for one in importlib.metadata.distributions():
    files = {file.locate() for file in one.files or ()}
    folders = {path.parent / "__pycache__" for path in files if path.suffix == ".py"}
    files |= {path for folder in folders if folder.is_dir() for path in folder.iterdir()}
    size = sum(path.stat().st_size for path in files if path.is_file())
    needs = [re.match("[A-Za-z0-9_.-]+", line)[0] for line in one.requires or () if "extra ==" not in line]
    packages[plain(one.name)] = [size, [plain(need) for need in needs]]
print(json.dumps(packages))
"""
LARGE_BYTES = 5e6


def main() -> None:
    """Print a table of the large packages, and the totals."""
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = Path(folder) / "bin/python"
        before = set(_report(python))
        subprocess.run(
            [python, "-m", "pip", "install", "-qq", "--disable-pip-version-check", sys.argv[1]], check=True
        )
        packages = {name: found for name, found in _report(python).items() if name not in before}
    print("| package | MB | brought by |\n|---|---|---|")
    for name, (size, _) in sorted(packages.items(), key=lambda one: -one[1][0]):
        if size >= LARGE_BYTES:
            users = sorted(user for user, (_, needs) in packages.items() if name in needs)
            print(f"| {name} | {size / 1e6:.0f} | {', '.join(users)} |")
    total = sum(size for size, _ in packages.values())
    print(f"| all {len(packages)} | {total / 1e6:.0f} | |")


def _report(python: Path) -> dict[str, tuple[int, list[str]]]:
    done = subprocess.run([python, "-c", REPORT], check=True, capture_output=True, text=True)
    return {name: (size, needs) for name, (size, needs) in json.loads(done.stdout).items()}


if __name__ == "__main__":
    main()
