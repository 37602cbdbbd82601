"""`pio run` and the Makefile make the same image.

pio_run.txt holds the compile and link lines that `pio run -v -e trex -e trex_new -e nano -e nano_new` printed
(PlatformIO Core 6.2.0, platform-atmelavr 5.2.0). Replayed with the compiler at hand they make the image that
the tests on the emulated chip use.
"""

import subprocess
from pathlib import Path

import pytest
from platformio.project.config import ProjectConfig

from tests.variants import some_of

FIRMWARE = Path(__file__).parents[3] / "firmware"
PRINTED = Path(__file__).with_name("pio_run.txt").read_text(encoding="utf-8").splitlines()
ENVIRONMENTS = ("trex", "trex_new", "nano", "nano_new")


def lines_of(environment: str) -> list[str]:
    return [line for line in PRINTED if f".pio/build/{environment}/" in line]


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_recorded_lines_have_the_flags_and_sources_of_platformio_ini(environment: str) -> None:
    """If this fails, run `pio run -v` again and replace pio_run.txt by the lines that it prints."""
    *compiles, link, _ = lines_of(environment)
    flags = set(ProjectConfig(str(FIRMWARE / "platformio.ini")).get(f"env:{environment}", "build_flags"))
    for line in compiles:
        assert {flag for flag in flags if not flag.startswith("-Wl,")} <= set(line.split())
    assert {flag for flag in flags if flag.startswith("-Wl,")} <= set(link.split())
    sources = [
        source.relative_to(FIRMWARE) for d in ("app", "board") for source in (FIRMWARE / d).glob("*.cpp")
    ]
    assert sorted(line.split()[-1] for line in compiles) == sorted(map(str, sources))


@pytest.mark.parametrize("environment", some_of(ENVIRONMENTS, 2))
def test_the_replayed_lines_make_the_image_of_the_makefile(environment: str, tmp_path: Path) -> None:
    for folder in ("app", "board"):
        (tmp_path / environment / "src" / folder).mkdir(parents=True)
    for line in lines_of(environment):
        command = line.replace(".pio/build", str(tmp_path)).split()
        subprocess.run(command, cwd=FIRMWARE, check=True, capture_output=True)
    board = environment.removesuffix("_new")
    build = tmp_path / "make"
    subprocess.run(["make", "-s", "-C", str(FIRMWARE), f"BOARD={board}", f"BUILD={build}"], check=True)
    assert (tmp_path / environment / "firmware.hex").read_bytes() == (build / "thumper.hex").read_bytes()
