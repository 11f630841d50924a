import crashes
from examples import avoiding
from synthetic import result


def test_every_controller_with_a_delay_flies_the_same_missions():
    studies = crashes.studies()
    assert len(studies) == 7
    assert {study.regimes for study in studies.values()} == {crashes.MISSIONS}
    assert {(study.seed, study.episodes) for study in studies.values()} == {(6400, 20)}


def test_delays_are_those_of_the_controllers():
    delays = {}
    for name, study in crashes.studies().items():
        row = result("tdma", controller=study.components.controller)
        delays[name] = crashes.delay_of(row)
    assert delays.pop("Errands") is None
    assert sorted(delays.values()) == [0, 5, 10, 20, 30, 40]
    assert delays["four_seconds"] == 40
    assert avoiding.four_seconds.args == (40,)
