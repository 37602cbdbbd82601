"""The words of column headers: quantities, units and wheels, in nine languages, without accents.

English, German, Spanish, Portuguese, French, Italian, Dutch, Czech and Polish.
"""

import math
from enum import Enum


class Quantity(Enum):
    """Quantity that a column holds."""

    TIME = "time"
    PWM = "pwm"
    VOLTAGE = "voltage"
    COUNTS = "counts"
    COUNTS_PER_ROW = "counts_per_row"
    SPEED = "speed"
    CURRENT = "current"
    BATTERY = "battery"
    SETPOINT = "setpoint"
    DIRECTION = "direction"


# Ratio, percent or PWM: without a unit, their size says it.
DUTY_NAMES = frozenset(
    ("duty", "dutycycle", "duty cycle", "tastverhaltnis", "tastgrad", "ciclo de trabajo", "ciclo trabajo",
     "ciclo de trabalho", "ciclo ativo", "razao ciclica", "rapport cyclique", "strida", "wypelnienie")
)  # fmt: skip
# Matched as whole words, longest first, after the wheel is removed. The other words are the unit.
NAMES = {
    Quantity.TIME: (
        "time", "t", "timestamp", "time stamp", "stamp", "zeit", "tijd", "tiempo", "tempo", "temps",
        "elapsed", "elapsed time", "clock", "millis", "micros", "cas", "czas", "date", "datetime",
        "date time", "ms", "us", "sec", "seconds", "unix", "unix time", "unixtime", "unix timestamp",
        "epoch", "epoch time", "posix time", "utc", "utc time", "utc timestamp", "x value", "zeitstempel",
        "uhrzeit", "datum", "datum uhrzeit", "fecha", "marca de tiempo", "data hora", "instante",
        "horodatage", "tijdstip",
    ),
    Quantity.PWM: (
        "pwm", "u", "command", "cmd", "drive", "input", "throttle", "effort", "stellgrosse", "stellwert",
        "commande", "comando", "mando", "akcni zasah", "sterowanie", *DUTY_NAMES,
    ),
    Quantity.VOLTAGE: (
        "voltage", "volt", "volts", "v", "uin", "vin", "vm", "motor voltage", "input voltage", "voltaje",
        "voltagem", "tension", "tensao", "tensione", "spannung", "motorspannung", "klemmenspannung",
        "spanning", "napeti", "napiecie", "mv",
    ),
    Quantity.COUNTS: (
        "counts", "count", "ticks", "tick", "encoder", "enc", "position", "pos", "steps", "pulses", "angle",
        "theta", "phi", "posicion", "pulsos", "cuentas", "angulo", "posicao", "contagem", "impulse",
        "inkremente", "winkel", "drehwinkel", "impulsions", "impulsi", "posizione", "angolo", "positie",
        "hoek", "poloha", "uhel", "pulzy", "impulzy", "pozycja", "kat", "impulsy",
    ),
    Quantity.COUNTS_PER_ROW: (
        "delta counts", "counts delta", "counts per row", "dcounts", "delta ticks", "dticks",
    ),
    Quantity.SPEED: (
        "speed", "velocity", "omega", "vel", "w", "rate", "rpm", "angular velocity", "angular speed",
        "wheel speed", "theta dot", "thetadot", "dtheta", "dtheta dt", "phi dot", "phidot", "dphi",
        "velocidad", "velocidad angular", "velocidade", "velocidade angular", "vitesse", "vitesse angulaire",
        "velocita", "velocita angolare", "geschwindigkeit", "winkelgeschwindigkeit", "drehzahl",
        "motordrehzahl", "snelheid", "hoeksnelheid", "toerental", "rychlost", "uhlova rychlost", "otacky",
        "predkosc", "predkosc katowa", "predkosc obrotowa", "obroty",
        "rad s", "rads", "radps", "deg s", "rps", "rev s",
    ),
    Quantity.CURRENT: ("current", "i", "amps", "strom", "corriente", "corrente", "courant", "stroom"),
    Quantity.BATTERY: ("battery", "vbat", "supply", "battery voltage", "vbatt", "bus voltage", "bateria"),
    Quantity.DIRECTION: ("direction", "dir", "richtung", "direccion", "direcao", "sens"),
}  # fmt: skip
BY_UNIT = frozenset(("y", "n", "output"))  # only the unit says what they are
BY_UNIT_OF = (Quantity.SPEED, Quantity.COUNTS, Quantity.PWM, Quantity.VOLTAGE)
SETPOINTS = frozenset(
    ("setpoint", "target", "reference", "ref", "desired", "goal", "sp", "sollwert", "soll", "consigna",
     "consigne", "referencia", "riferimento", "zadana", "zadany")
)  # fmt: skip
NO_QUANTITY = frozenset(("error", "err", "kp", "ki", "kd", "integral", "proportional", "derivative"))
# Words that add nothing. They are dropped only if a header is not recognized with them.
QUALIFIERS = frozenset(
    ("motor", "wheel", "measured", "meas", "actual", "act", "real", "raw", "filtered", "filt", "value",
     "signal", "encoder", "shaft", "applied", "in", "of", "the", "dc", "data", "avg", "mean", "estimate",
     "wert", "hodnota", "valor", "valeur", "wartosc", "ist", "axis", "de", "du", "del")
)  # fmt: skip
DEGREES = ("deg", "degree", "degrees", "grad", "grados", "graus", "degres", "gradi", "graden")
TURNS = ("rev", "revs", "revolutions", "turns", "umdrehungen", "vueltas", "voltas", "tours", "giri")
POSITIONS_RAD = {"rad": 1.0, **dict.fromkeys(DEGREES, math.pi / 180.0), **dict.fromkeys(TURNS, math.tau)}
SHORT_TURNS = ("1", "r", "u", "tr", "ot", "obr", "omw")  # per minute
UNITS: dict[Quantity, dict[str, float]] = {
    Quantity.TIME: {"s": 1.0, **dict.fromkeys(("sec", "secs", "second", "seconds"), 1.0), "ms": 1e-3,
                    "msec": 1e-3, "millis": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "micros": 1e-6,
                    "ns": 1e-9, "min": 60.0},
    Quantity.PWM: {"": 1.0, "pwm": 1.0, "%": 2.55, "percent": 2.55, "duty": 255.0},
    Quantity.VOLTAGE: {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3},
    Quantity.COUNTS: {"": 1.0, **dict.fromkeys(POSITIONS_RAD, math.nan)},
    Quantity.SPEED: {"rad s": 1.0, "rads": 1.0, "radps": 1.0, "mrad s": 1e-3, "rpm": math.pi / 30.0,
                     "rps": math.tau, "tr s": math.tau, "hz": math.tau,
                     **{f"{unit} s": rad for unit, rad in POSITIONS_RAD.items()},
                     **{f"{unit} min": math.pi / 30.0 for unit in (*TURNS, *SHORT_TURNS)}},
    Quantity.CURRENT: {"a": 1.0, "ma": 1e-3},
    Quantity.BATTERY: {"v": 1.0, "mv": 1e-3},
    Quantity.DIRECTION: {"": 1.0},
}  # fmt: skip
# The units as errors list them.
SHOWN_UNITS = {
    Quantity.TIME: ("s", "ms", "us", "ns", "min"),
    Quantity.PWM: ("pwm", "duty", "%"),
    Quantity.VOLTAGE: ("V", "mV"),
    Quantity.COUNTS: ("counts", "rad", "deg", "rev"),
    Quantity.SPEED: ("rad/s", "deg/s", "rev/s", "rpm", "counts/s"),
    Quantity.CURRENT: ("A", "mA"),
    Quantity.BATTERY: ("V", "mV"),
}
COUNT_SPEEDS = ("steps s", "counts s", "ticks s", "count s", "cps", "pulses s")
RPM_NAMES = frozenset(("drehzahl", "motordrehzahl", "toerental", "otacky", "obroty"))  # turns per minute
SIDES = {
    **{side: side for side in ("left", "right", "front", "rear", "fl", "fr", "rl", "rr")},
    **dict.fromkeys(("l", "links", "izquierda", "izquierdo", "gauche", "esquerda", "esquerdo"), "left"),
    **dict.fromkeys(("r", "rechts", "derecha", "derecho", "droite", "direita", "direito"), "right"),
}  # fmt: skip
