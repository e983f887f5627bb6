"""What survives power-off: burned parameters, program, variables and arrays."""

from dataclasses import dataclass, field

from sautereau.sim_backend.devices.galil.axis import AXES, factory_settings
from sautereau.sim_backend.devices.galil.program import Program
from sautereau.sim_backend.devices.galil.reference import entries

OUTPUTS = 8  # Digital outputs, numbered from 1

Config = dict[str, list[float]]  # Numbers of the controller, by the commands that set them


def factory_config() -> Config:
    """Return the numbers of the controller as the factory sets them."""
    codes = ("CN", "CW", "EI", "EO", "LZ", "SM", "TM", "US")
    numbers = {
        code: [argument.default or 0.0 for argument in entries()[code].arguments] for code in codes
    }
    return {**numbers, "PF": [10.0, 0.0], "VF": [10.0, 4.0]}


@dataclass(frozen=True)
class Parameters:
    """What BN burns."""

    axes: tuple[dict[str, float], ...] = field(
        default_factory=lambda: tuple(factory_settings() for _ in AXES)
    )
    motors_on: tuple[bool, ...] = (True,) * len(AXES)
    """A new controller powers its motors; burn MO to prevent that."""
    config: Config = field(default_factory=factory_config)
    lock: tuple[str, bool] = ("", False)
    """Password of the program, and whether it is locked."""
    outputs: tuple[bool, ...] = (False,) * OUTPUTS

    def only_burnable(self) -> "Parameters":
        """Return them with factory values of those that BN does not burn."""
        table, factory = entries(), Parameters()
        axes = tuple(
            {
                code: value if table[code].burnable else standard[code]
                for code, value in axis.items()
            }
            for axis, standard in zip(self.axes, factory.axes, strict=True)
        )
        config = {
            code: list(values) if table[code].burnable else list(factory.config[code])
            for code, values in self.config.items()
        }
        return Parameters(axes, self.motors_on, config, self.lock, self.outputs)


@dataclass
class Memory:
    """The EEPROM."""

    parameters: Parameters = field(default_factory=Parameters)
    program: Program = field(default_factory=Program)
    variables: dict[str, float] = field(default_factory=dict)
    arrays: dict[str, list[float]] = field(default_factory=dict)
