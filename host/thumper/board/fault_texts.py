"""The board's faults in words: what is wrong, and what mends it."""

from thumper.board.messages import AckStatus, Fault

REFUSAL_REASONS = {
    AckStatus.UNKNOWN_COMMAND: "it does not know it; flash the firmware that belongs to this program",
    AckStatus.UNKNOWN_PARAMETER: "it does not know it; flash the firmware that belongs to this program",
    AckStatus.OUT_OF_RANGE: "the value is out of range",
    AckStatus.FAULT_LATCHED: "a fault is latched; clear it first",
    AckStatus.BATTERY_LOW: "the battery is below 7.0 V; charge it",
    AckStatus.BATTERY_UNKNOWN: "it has not measured its battery; is the board all right?",
    AckStatus.ARMED: "it is armed; disarm it first",
    AckStatus.BAD_PARAMETERS: "what it has saved cannot be read; set the parameters and save them again",
    AckStatus.NOT_SAVED: "its EEPROM did not keep them; is it worn out?",
}


FAULT_HINTS = {
    Fault.LINK_LOST: "it heard no command for 300 ms; is the computer overloaded or the cable loose?",
    Fault.LOW_BATTERY: "the battery is empty; charge it",
    Fault.E_STOP: "the emergency stop was pressed",
    Fault.STALL_LEFT: "the left wheels do not turn; are they blocked, is a motor or encoder wire loose?",
    Fault.STALL_RIGHT: "the right wheels do not turn; are they blocked, is a motor or encoder wire loose?",
    Fault.REVERSED_LEFT: "the left encoder counts backwards; swap its two wires, or the motor's",
    Fault.REVERSED_RIGHT: "the right encoder counts backwards; swap its two wires, or the motor's",
    Fault.LOST_EDGES: "an encoder's signal is disturbed; lead its wires away from the motors'",
    Fault.OVER_CURRENT: "a motor draws too much current; is something jammed?",
    Fault.WATCHDOG: "its firmware hung and was restarted; look at its supply",
    Fault.BAD_PARAMETERS: "its saved parameters cannot be read; set and save them again",
}
