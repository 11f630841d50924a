"""The numbers of a robot's model: read by name, in their ranges, and none besides."""

import numpy as np
import pytest

from swarm_mj.physics.declarations import Declarations, declared_by


def numbers(**given):
    return {name: np.array([number]) for name, number in given.items()}


def test_a_model_that_declares_nothing_has_no_gain_and_no_energy():
    declared = declared_by({})
    assert (declared.antenna_gain_dbi, declared.power_class_db) == (0.0, 0.0)
    assert declared.efficiency is None


def test_each_number_is_taken_by_its_name():
    declared = declared_by(
        numbers(
            idle_power_w=20.0,
            rotor_radius_m=0.1,
            efficiency=0.5,
            power_class_db=-3.0,
            antenna_gain_dbi=2.0,
        )
    )
    assert declared == Declarations(
        antenna_gain_dbi=2.0,
        power_class_db=-3.0,
        efficiency=0.5,
        rotor_radius_m=0.1,
        idle_power_w=20.0,
    )


@pytest.mark.parametrize(
    ("numerics", "said"),
    [
        (numbers(antena_gain=2.0), "numeric antena_gain is none of antenna_gain_dbi, power_class"),
        (numbers(antena_gain=2.0), "; did you mean antenna_gain_dbi"),
        ({"efficiency": np.array([0.5, 0.6])}, "efficiency must be one number, not 2"),
        (numbers(antenna_gain_dbi=41.0), r"antenna_gain_dbi must be a number from -30 to 40 \[dBi"),
        (numbers(power_class_db=-61.0), r"power_class_db must be a number from -60 to 60 \[dB\]"),
        (numbers(efficiency=0.0), "efficiency must be a number from 0.01 to 1, not 0"),
        (numbers(efficiency=0.5, rotor_radius_m=0.0), "rotor_radius_m must be a number from 0.005"),
        (numbers(efficiency=0.5, idle_power_w=-1.0), "idle_power_w must be a number from 0 to"),
        (numbers(rotor_radius_m=0.1), "count only with efficiency; give that, too"),
        (numbers(idle_power_w=1.0), "count only with efficiency; give that, too"),
    ],
)
def test_what_is_misspelt_or_out_of_range_is_refused(numerics, said):
    with pytest.raises(ValueError, match=said) as raised:
        declared_by(numerics)
    assert "\n" not in str(raised.value)
