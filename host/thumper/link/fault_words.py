"""The board's faults in words: what is wrong, and what mends it."""

from thumper.link.messages import Fault

FAULT_CURES = {
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
