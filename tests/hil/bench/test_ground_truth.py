"""The ring of true poses keeps the newest rows in order and stays bounded."""

from thumper_hil.bench.ground_truth import GroundTruth


def test_the_newest_rows_stay_in_order() -> None:
    truth = GroundTruth(max_rows=3)
    assert truth.rows().shape == (0, 6)
    for time_s in range(5):
        truth.add((float(time_s), 0.0, 0.0, 0.0, 1.0, 2.0))
    assert truth.rows()[:, 0].tolist() == [2.0, 3.0, 4.0]
    truth.clear()
    truth.add((9.0, 0.0, 0.0, 0.0, 1.0, 2.0))
    assert truth.rows().tolist() == [[9.0, 0.0, 0.0, 0.0, 1.0, 2.0]]
