"""Campaign files: their jobs, what is refused, and the digest of their content."""

from pathlib import Path

import pytest

from tests.hil.campaign.samples import FILE, written
from thumper.common.errors import ThumperError
from thumper_hil.campaign.spec import campaign_digest, expand_jobs, load_campaign, mission_of_seed


def test_jobs_cover_all_missions_seeds_and_parameter_sets(tmp_path: Path) -> None:
    jobs = expand_jobs(load_campaign(written(tmp_path)), tmp_path)
    assert [job.key for job in jobs[:3]] == ["step/default/3", "step/gentle/3", "step/default/4"]
    assert len(jobs) == len({job.key for job in jobs}) == 4
    assert '"v_max_m_s":0.3' in jobs[1].robot_json


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('world = "lab"', 'world = "moon"', "moon"),
        ("count = 2", "count = 0", "seeds.count"),
        ("count = 2", "count = 1000000000", "seeds.count"),
        ("goal = ", "gaol = ", "missions.0.gaol"),
        ("[0.6, 0.0]", '"there"', "goal"),
        ('"gentle.toml"', '"none.toml"', "none.toml"),
        ('name = "gentle"', 'name = "default"', "same name"),
        ('robot = "gentle.toml"', 'scenario = "gentle.toml"', "gentle.toml"),
        ("seeds = ", 'show = ["luck"]\nseeds = ', "show.*goal_error_m"),
        ('name = "step"', 'name = "step #1"', "missions.0.name.*letters"),
        ('name = "step"', 'name = "a/b"', "letters"),
        ('name = "step"', 'name = ""', "letters"),
        ('name = "gentle"', 'name = "50% | pipe?"', "parameters.1.name.*letters"),
        ("[1.0, 0.0, 180.0]", "[100.0, 0.0, 180.0]", "step: .*outside the room"),
        ("[1.0, 0.0, 180.0]", "[1.0, nan, 180.0]", "missions.0.start"),
        ("[1.0, 0.0, 180.0]", "[1.0, 0.0, 1800.0]", "heading"),
        ("[0.6, 0.0]", "[60.0, 0.0]", "more than 50 m"),
        ("seeds =", "seeds", "TOML"),
    ],
)
def test_invalid_campaign_file_is_reported_in_one_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(ThumperError, match=says) as caught:
        expand_jobs(load_campaign(written(tmp_path, FILE.replace(old, new))), tmp_path)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


def test_removed_key_in_a_robot_file_is_refused_with_the_fix(tmp_path: Path) -> None:
    path = written(tmp_path)
    (tmp_path / "gentle.toml").write_text("[recording]\nwaiting_messages = 16\n")
    with pytest.raises(ThumperError) as caught:
        expand_jobs(load_campaign(path), tmp_path)
    assert str(caught.value) == (
        f"{tmp_path / 'gentle.toml'}:2: recording.waiting_messages was removed: "
        "it is fixed at 4096 messages; delete the key"
    )
    assert caught.value.exit_code == 2


def test_more_seeds_continue_the_same_campaign(tmp_path: Path) -> None:
    few = expand_jobs(load_campaign(written(tmp_path)), tmp_path)
    more = expand_jobs(load_campaign(written(tmp_path, FILE.replace("count = 2", "count = 9"))), tmp_path)
    other = expand_jobs(load_campaign(written(tmp_path, FILE.replace("[0.6,", "[0.5,"))), tmp_path)
    assert campaign_digest(few) == campaign_digest(more) != campaign_digest(other)


@pytest.mark.slow
def test_digest_depends_on_file_content_not_on_paths(tmp_path: Path) -> None:
    """Editing world, base map, scenario or masks makes a new campaign; moving the files does not."""
    text = FILE.replace('world = "lab"', 'world = "room.toml"').replace(
        '{ name = "default" }', '{ name = "default", scenario = "slip.toml" }'
    )

    def digest(folder: str, **changed: str) -> str:
        here = tmp_path / folder
        here.mkdir()
        image = changed.get("image", "P2 3 1 255 255 255 255\n")
        files = {
            "slip.toml": "faults = [{ at_s = 0.5, slip.left = 0.7 }]",
            "base.toml": 'map = "map.yaml"\n[[wall]]\npoints_m = [[-3, -3], [3, -3]]\n',
            "room.toml": 'base = "base"\n[[circle]]\nx_m = -2\ny_m = 0\nradius_m = 0.1\n',
            "map.yaml": "image: map.pgm\nresolution: 9.0\norigin: [-13.5, -4.5, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
            "mask.yaml": "image: mask.pgm\nresolution: 1.0\norigin: [7.0, 0.0, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
            "map.pgm": image,
            "mask.pgm": changed.get("mask", "P2 1 1 255 255\n"),
        } | {f"{name}.toml": text for name, text in changed.items() if name not in ("image", "mask")}
        for name, content in files.items():
            (here / name).write_text(content)
        path = written(here, text)
        (here / "gentle.toml").write_text('[navigation.masks]\nkeepout = "mask.yaml"\n')
        return campaign_digest(expand_jobs(load_campaign(path), here))

    first = digest("a")
    assert digest("b") == first
    assert digest("c", slip="faults = [{ at_s = 0.5, motor.left = 'dead' }]") != first
    assert digest("d", room='base = "base"\n[[circle]]\nx_m = -2\ny_m = 0\nradius_m = 0.2\n') != first
    assert digest("e", base='map = "map.yaml"\n[[wall]]\npoints_m = [[-3, -3], [4, -3]]\n') != first
    assert digest("f", image="P2 3 1 255 0 255 255\n") != first
    assert digest("g", mask="P2 1 1 255 0\n") != first


def test_every_seed_has_its_own_house(tmp_path: Path) -> None:
    path = tmp_path / "houses.toml"
    path.write_text(
        'seeds = { first = 5, count = 2 }\nparameters = [{ name = "hard", preset = "hard" }]\n'
        '[[missions]]\nname = "house"\nworld = "house"\n'
    )
    jobs = expand_jobs(load_campaign(path), tmp_path)
    drawn = [mission_of_seed(job.mission, job.seed) for job in jobs]
    assert [mission.world for mission in drawn] == ["house-5", "house-6"]
    assert drawn[0].start != drawn[1].start
    assert [job.preset for job in jobs] == ["hard", "hard"]
    text = path.read_text().replace("count = 2", "count = 9")
    path.write_text(text)
    assert campaign_digest(expand_jobs(load_campaign(path), tmp_path)) == campaign_digest(jobs)
    path.write_text(text + "goal = [1, 1]\n")
    with pytest.raises(ThumperError, match="every house has its own"):
        load_campaign(path)
    path.write_text('[[missions]]\nname = "a"\nworld = "lab"\nstart = [0, 0, 0]\n')
    with pytest.raises(ThumperError, match="goal: missing"):
        load_campaign(path)
