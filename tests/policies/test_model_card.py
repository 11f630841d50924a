"""The card says what the config holds, in Markdown, and nothing else."""

from tiny_policies import tiny_config, tiny_network

from swarm_mj.policies.mlp import MlpShape
from swarm_mj.policies.model_card import mlp_card, model_card


def card(**overrides):
    network = tiny_network(edges="both")
    return model_card(tiny_config(network, **overrides))


def test_the_card_of_a_trained_policy():
    written = card(
        training={
            "settings": {"task": "random-walk", "robots": [10, 20], "rate": 0.0003},
            "command": "swarm-mj train --task random-walk\n  --robots 10 20",
            "seed": 3,
        },
        evaluation={
            "episodes": 100,
            "results": [{"robots": 10, "note": "a|b\nc"}],
            "by size": {"10": {"aoi": 7.123456789}},
        },
    )
    for line in (
        "- network: Aggregation GNN, receptive field 1, width 6, 2 layers in each MLP; parents and "
        "children hear each other",
        "- packets: T, M and P, as the paper's, and nothing more",
        "- features: `extended`, 18 for each robot",
        "- outputs: 1 for each robot; 1.5 is added to the logit of silence but in its own turn",
        "    swarm-mj fly --policy DIR --task random-walk",
        "- settings.robots: [10, 20]",
        "- settings.rate: 0.0003",
        "    swarm-mj train --task random-walk --robots 10 20",
        "- seed: 3",
        "By swarm_mj 1.2.3, commit abc123.",
        "- episodes: 100",
        '- results: [{"robots": 10, "note": "a|b\\nc"}]',
        "- by size.10.aoi: 7.12346",
        "Apache-2.0, as swarm_mj.",
    ):
        assert line in written.splitlines()


def test_what_is_not_known_is_not_said():
    written = card(training={}, evaluation={}, commit=None, silence_logit=0.0)
    assert written.count("Nothing was noted.") == 2
    assert "--task TASK" in written
    assert "commit" not in written
    assert "By swarm_mj 1.2.3." in written


def test_the_card_of_a_plain_network_says_how_to_fly_it_as_it_was_trained():
    shape = {"num_robots": 3, "num_features": 2, "hidden": (4,), "activation": "relu"}
    network = MlpShape(features="my_features:Ages", obeys_mask=True, **shape)
    written = mlp_card(network, {"mission.task": "random-walk"}, "1.2.3").splitlines()
    flags = "--task random-walk --robots 3 --features my_features:Ages"
    assert f"    swarm-mj fly --policy DIR {flags}" in written


def test_odd_values_stay_on_their_lines():
    """Whatever a value holds, it stays on its line."""
    odd = {"# a": "b\n# c", "empty": {}, "none": None, "rows": [], "flags": [{"x": {"y": [1]}}]}
    written = card(training=odd, evaluation={"command": "x\ny"}).splitlines()
    for line in (
        "- # a: b # c",
        "- empty: {}",
        "- none: null",
        "- rows: []",
        '- flags: [{"x": {"y": [1]}}]',
    ):
        assert line in written
    assert "    x y" in written
    assert sum(line.startswith("#") for line in written) == 5
