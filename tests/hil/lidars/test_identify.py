"""`thumper doctor` finds out by asking which lidar is on a port, whatever the configuration expects."""

import pytest

from thumper.doctor.lidar_checks import check_lidar
from thumper.lidar.options import LidarModel, LidarOptions

NAMES: dict[LidarModel, str] = {
    "urg04lx": "URG-04LX (SCIP 2.0)",
    "ld19": "LD19 (LD06)",
    "rplidar_a1": "RPLIDAR A1, firmware ",
    "rplidar_a2": "RPLIDAR A2, firmware ",
    "rplidar_c1": "RPLIDAR C1, firmware ",
    "ydlidar_x4": "YDLIDAR X4, firmware ",
}


@pytest.mark.parametrize("connected", NAMES)
def test_the_doctor_says_which_lidar_answers(connected: LidarModel) -> None:
    expected: LidarModel = "ydlidar_x4" if connected == "ld19" else "ld19"
    port = f"sim://who-{connected}/lidar?lidar={connected}"
    (check,) = check_lidar(LidarOptions(port=port, model=expected), seconds=1.0)
    assert check.verdict == "fail"
    assert check.fix is not None
    assert check.fix.startswith(f"{port} answers as ")
    assert check.fix.endswith(f'; set [lidar] model = "{connected}"')
    assert NAMES[connected] in check.fix
