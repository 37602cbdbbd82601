"""What the board's states, refusals and faults mean, and how to fix them."""

from thumper.board.messages import AckStatus, Fault, State

UNREADABLE = (
    "its saved parameters are unreadable, or of another firmware version; `thumper tune` measures and saves "
    "the gains, the dashboard sets the others"
)
STATE_NAMES = {  # of `State`, in plain words
    State.DISARMED.name: "disarmed",
    State.CLOSED_LOOP.name: "armed",
    State.MANUAL.name: "armed",
    State.FAULT.name: "fault",
}
ARMED_STATES = (State.CLOSED_LOOP.name, State.MANUAL.name)  # the motors may turn
REFUSAL_REASONS = {
    AckStatus.UNKNOWN_COMMAND: "it does not know this command; flash the firmware of this program's version",
    AckStatus.UNKNOWN_PARAMETER: (
        "it does not know this parameter; flash the firmware of this program's version"
    ),
    AckStatus.OUT_OF_RANGE: "the value is out of range",
    AckStatus.FAULT_LATCHED: "a fault is latched; clear it first",
    AckStatus.BATTERY_LOW: "the battery is below battery_rearm per cell (7.0 V with 2 cells); charge it",
    AckStatus.BATTERY_HIGH: "the battery reads above 4.5 V per cell; set battery_cells, or check its wiring",
    AckStatus.INPUT_ACTIVE: "a protecting input is active; release the bumper or emergency stop",
    AckStatus.PINS_IN_USE: "A4 and A5 are in use: gyroscope and currents_at_a4 exclude each other",
    AckStatus.NO_ACCELEROMETER: "this board has no accelerometer; leave tilt_limit and impact_limit at 0",
    AckStatus.BATTERY_UNKNOWN: "it has not measured its battery; check the board",
    AckStatus.ARMED: "it is armed; disarm it first",
    AckStatus.BAD_PARAMETERS: UNREADABLE,
    AckStatus.NOT_SAVED: "its EEPROM did not store them; it may be worn out",
}


FAULT_NAMES = {
    Fault.LINK_LOST: "connection lost",
    Fault.LOW_BATTERY: "battery empty",
    Fault.E_STOP: "emergency stop",
    Fault.STALL_LEFT: "left wheels stalled",
    Fault.STALL_RIGHT: "right wheels stalled",
    Fault.REVERSED_LEFT: "left encoder reversed",
    Fault.REVERSED_RIGHT: "right encoder reversed",
    Fault.LOST_EDGES: "encoder signal disturbed",
    Fault.OVER_CURRENT: "too much motor current",
    Fault.WATCHDOG: "firmware hung",
    Fault.BAD_PARAMETERS: "saved parameters unreadable",
    Fault.ADC_STOPPED: "battery not measured",
    Fault.HIGH_BATTERY: "battery voltage too high",
    Fault.INPUT_1: "input 1",
    Fault.INPUT_2: "input 2",
    Fault.TILTED: "robot tilted",
    Fault.IMPACT: "impact",
}
FAULT_HINTS = {
    Fault.LINK_LOST: "it received no command for 300 ms; is the computer overloaded or the cable loose?",
    Fault.LOW_BATTERY: "the battery is empty; charge it",
    Fault.E_STOP: "the emergency stop was pressed",
    Fault.STALL_LEFT: "the left wheels do not turn; are they blocked or on a thick carpet, "
    "is a motor or encoder wire loose?",
    Fault.STALL_RIGHT: "the right wheels do not turn; are they blocked or on a thick carpet, "
    "is a motor or encoder wire loose?",
    Fault.REVERSED_LEFT: "the left encoder counts backwards; swap its two wires, or the motor's, "
    "or set left_encoder_reversed",
    Fault.REVERSED_RIGHT: "the right encoder counts backwards; swap its two wires, or the motor's, "
    "or set right_encoder_reversed",
    Fault.LOST_EDGES: "an encoder signal is disturbed; route its wires away from the motor wires",
    Fault.OVER_CURRENT: "a motor draws too much current; is something jammed, or the carpet too thick?",
    Fault.WATCHDOG: "its firmware hung and restarted; check its power supply",
    Fault.BAD_PARAMETERS: UNREADABLE,
    Fault.ADC_STOPPED: "it cannot measure battery and motor currents; check its 5 V supply, then replace it",
    Fault.HIGH_BATTERY: "the battery reads above 4.5 V per cell; set battery_cells, or check its wiring",
    Fault.INPUT_1: "input 1 is active (bumper, cliff sensor or emergency stop); release it",
    Fault.INPUT_2: "input 2 is active (bumper, cliff sensor or emergency stop); release it",
    Fault.TILTED: "the robot is tilted; put it on its wheels, or check the sign of tilt_limit",
    Fault.IMPACT: "the accelerometer felt an impact; check what the robot hit, or raise impact_limit",
}


def fault_line(fault: Fault) -> str:
    """Return name and hint of a fault in one line; only the hint if it has the name in it."""
    name, hint = FAULT_NAMES[fault], FAULT_HINTS[fault]
    return hint if name in hint else f"{name}: {hint}"
