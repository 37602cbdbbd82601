"""The sample campaigns and their robots load."""

from pathlib import Path

import pytest

from thumper_hil.campaign.spec import expand_jobs, load_campaign

FOLDER = Path(__file__).parents[2] / "campaigns"


@pytest.mark.parametrize(
    "file",
    [FOLDER / f"{name}.toml" for name in ("robustness", "odometry", "speed", "slam", "noise")],
    ids=lambda file: file.stem,
)
def test_sample_campaign_has_all_its_jobs(file: Path) -> None:
    campaign = load_campaign(file)
    jobs = expand_jobs(campaign, FOLDER)
    assert len(jobs) == campaign.seeds.count * len(campaign.missions) * len(campaign.parameters)
    assert len({(job.robot_json, job.scenario, job.preset) for job in jobs}) == len(campaign.parameters)
