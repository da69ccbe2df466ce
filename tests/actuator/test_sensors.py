"""Sensors in an actuator's TOML: round trip, ideal sensors, and refused values."""

from pathlib import Path

import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.sensors import IDEAL, Sensor, Sensors
from emaphm.errors import ActuatorError
from emaphm.recording.schema import SCHEMA

THESIS = Actuator.thesis()

DESCRIBED = THESIS.model_copy(
    update={
        "sensors": Sensors(
            position_rad=Sensor(resolution=0.1, noise=0.2, offset=-0.1),
            current_A=Sensor(lag=5e-6, unsigned=True),
        )
    }
)


def test_sensors_are_written_with_units_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    DESCRIBED.to_toml(path)
    assert Actuator.from_toml(path) == DESCRIBED
    text = path.read_text(encoding="utf-8")
    assert "[sensors.position_rad]" in text
    assert "lag = 5e-6 # s: time constant" in text.replace("5e-06", "5e-6")
    assert "voltage_V" not in text


def test_ideal_sensors_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    THESIS.to_toml(path)
    assert "sensors" not in path.read_text(encoding="utf-8")


def test_each_channel_has_an_ideal_sensor_unless_described() -> None:
    assert DESCRIBED.sensors.of("current_A").unsigned
    for name in (*SCHEMA, "torque_Nm"):
        assert THESIS.sensors.of(name) == IDEAL
    assert set(Sensors.model_fields) < set(SCHEMA)


def test_each_channel_of_the_schema_may_have_a_foreign_name() -> None:
    assert set(Channels.model_fields) == {*SCHEMA, "sampling", "command_held"}


def test_the_squares_of_noise_and_rounding_error_add() -> None:
    # A uniform error of width r has the variance r²/12.
    assert Sensor(noise=3.0, resolution=48**0.5).noise_variance == pytest.approx(9 + 4)


@pytest.mark.parametrize(
    ("toml", "pieces"),
    [
        ("[sensors.positon_rad]\nlag = 0.1", ("sensors.positon_rad", "did you mean 'position_rad'?")),
        ("[sensors.position_rad]\nlagg = 0.1", ("sensors.position_rad.lagg", "did you mean 'lag'?")),
        ("[sensors.position_rad]\nlag = -0.1", ("sensors.position_rad.lag", "greater than or equal to 0")),
        ("[sensors.current_A]\nscale = -1.0", ("sensors.current_A.scale", "greater than -1")),
        ("[sensors.command_rad]\nlag = 0.1", ("unknown key 'sensors.command_rad'",)),
    ],
)
def test_impossible_sensors_are_refused(tmp_path: Path, toml: str, pieces: tuple[str, ...]) -> None:
    path = tmp_path / "rig.toml"
    THESIS.to_toml(path)
    path.write_text(path.read_text(encoding="utf-8") + toml, encoding="utf-8")
    with pytest.raises(ActuatorError) as caught:
        Actuator.from_toml(path)
    for piece in pieces:
        assert piece in str(caught.value)
