"""Detect that wheels and gyroscope disagree about a turn: the wheels slip, or the robot is stuck."""

# Page's cumulative sum test ("Continuous inspection schemes", Biometrika 41, 1954) on the difference between
# the rotation of the wheels and that of the gyroscope: it sums what exceeds the allowance, and a sum at the
# limit is a slip.
ALLOWANCE, LIMIT = 0.75, 9.0  # standard deviations
STUCK_RAD = 1.0  # turn of the wheels in one slip ...
STUCK_SHARE = 0.1  # ... of which the gyroscope saw less than this share


class TurnSlip:
    """Counts the periods of slip. A period ends when both sums are 0 again."""

    def __init__(self) -> None:
        self.is_slipping = self.is_stuck = False
        self.slips = 0
        self.stuck = 0  # of them, those in which the wheels turned and the robot did not
        self._sums = (0.0, 0.0)  # counter-clockwise and clockwise
        self._wheels_rad = self._gyro_rad = 0.0  # in this period

    def add(self, sigmas: float, wheels_rad: float, gyro_rad: float) -> None:
        """Add a step: the disagreement [standard deviations], and the turn by both."""
        left, right = self._sums
        left = min(LIMIT, max(0.0, left + sigmas - ALLOWANCE))
        right = min(LIMIT, max(0.0, right - sigmas - ALLOWANCE))
        self._sums = (left, right)
        if max(self._sums) == 0.0:
            self.is_slipping = self.is_stuck = False
            self._wheels_rad = self._gyro_rad = 0.0
            return
        self._wheels_rad += wheels_rad
        self._gyro_rad += gyro_rad
        if max(self._sums) >= LIMIT:
            self.slips += not self.is_slipping
            self.is_slipping = True
        share = abs(self._gyro_rad) / max(abs(self._wheels_rad), STUCK_RAD)
        is_stuck = self.is_slipping and abs(self._wheels_rad) > STUCK_RAD and share < STUCK_SHARE
        self.stuck += is_stuck and not self.is_stuck
        self.is_stuck |= is_stuck
