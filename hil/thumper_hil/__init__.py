"""Hardware in the loop: the firmware that is flashed, on a simulated chip in a simulated world."""
