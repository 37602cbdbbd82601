"""What everything uses: geometry, kinematics, errors, serial port."""
