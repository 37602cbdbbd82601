"""`thumper demo`: the missions of the thesis's experiment 8.3, evaluated against ground truth."""
