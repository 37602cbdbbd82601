"""Why the board refuses a request, in words for its user."""

from thumper.link.messages import AckStatus

REFUSALS = {
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
