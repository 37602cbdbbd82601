"""The options of `thumper tune` as a TOML file with the tables [excitation], [verify] and [design]."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from pydantic import TypeAdapter

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.strict_toml import read_checked
from thumper.common.texts import choice_hint
from thumper_tuning.design.gains import RULE_NAMES, DesignOptions
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.verify import VerifyOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneOptions:
    """The content of the file; every key is optional."""

    excitation: ExcitationOptions = field(default_factory=ExcitationOptions)
    verify: VerifyOptions = field(default_factory=VerifyOptions)
    design: DesignOptions = field(default_factory=DesignOptions)

    def override(
        self,
        *,
        lane_m: float | None = None,
        hold_s: float | None = None,
        rule: str | None = None,
        largest_sensitivity: float | None = None,
    ) -> "TuneOptions":
        """Return the options with those of the command line; None keeps the file's value."""
        excitation, verify, design = self.excitation, self.verify, self.design
        if lane_m is not None:
            excitation = replace(excitation, lane_m=lane_m)
        if hold_s is not None:
            verify = replace(verify, hold_s=hold_s)
        if rule is not None:
            _check_rule(rule, "--rule")
            design = replace(design, rule=rule, manual=None)
        if largest_sensitivity is not None:
            design = replace(design, largest_sensitivity=largest_sensitivity)
        return TuneOptions(excitation=excitation, verify=verify, design=design)


def load_settings(path: Path | None) -> TuneOptions:
    """Read the file, or return the defaults for None.

    Raises
    ------
    ThumperError
        The file cannot be read, is not TOML, or has an unknown key, a wrong type or a value out of range.
    """
    if path is None:
        return TuneOptions()
    settings = read_checked(path, TypeAdapter(TuneOptions), TuneOptions, "settings")
    excitation, design = settings.excitation, settings.design
    if excitation.low_pwm >= excitation.high_pwm:
        raise ThumperError(
            f"{path}: excitation.low_pwm = {excitation.low_pwm}: must be less than high_pwm = "
            f"{excitation.high_pwm}",
            exit_code=EXIT_USAGE,
        )
    _check_rule(design.rule, f"{path}: design.rule")
    if design.period_s != DesignOptions().period_s:
        raise ThumperError(
            f"{path}: design.period_s: the board reports its own rate; for a log use `tune design --rate`",
            exit_code=EXIT_USAGE,
        )
    return settings


def _check_rule(rule: str, where: str) -> None:
    if rule not in RULE_NAMES:
        raise ThumperError(
            f"{where} = {rule!r}: unknown rule; {choice_hint(rule, RULE_NAMES)}", exit_code=EXIT_USAGE
        )
