"""Curves hold the results' numbers and the published ones; what cannot be compared is refused."""

import numpy as np
import pytest
from synthetic import altered, result, sweep

from swarm_mj.evaluation.figures.curves import curves, perfect_curve, results_of
from swarm_mj.evaluation.figures.drawing import caption
from swarm_mj.evaluation.published import RESULT_FIGURES
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE

FIG3, FIG4, FIG5, FIG6 = RESULT_FIGURES.values()


def found(figure, results, cost=AOI):
    """Curves by method and source."""
    its = curves(figure, cost, results_of(figure, results))
    return {(curve.method, curve.is_published): curve for curve in its}


def test_a_curve_holds_its_policys_results_in_the_order_of_x():
    values = {0.5: (9.0, 0.3), 0.2: (40.0, 2.0), 0.75: (7.0, 0.1)}
    curve = found(FIG4, sweep("tdma", "range_ratio", values))["tdma", False]
    np.testing.assert_array_equal(curve.x, [0.2, 0.5, 0.75])
    np.testing.assert_array_equal(curve.mean, [40.0, 9.0, 7.0])
    np.testing.assert_array_equal(curve.sem, [2.0, 0.3, 0.1])
    assert not curve.is_level


def test_published_values_sit_at_their_x():
    """Fig. 4 publishes, of 100 missions at range ratio 0.2, MST 62.8942 with a std of 14.1061."""
    results = [result("mst")]
    curve = found(FIG4, results)["mst", True]
    np.testing.assert_array_equal(curve.x, [0.2, 0.25, 0.5, 0.75, 1.0])
    assert curve.mean[0] == 62.8942
    assert curve.sem[0] == pytest.approx(1.41061)
    gnn = found(FIG4, results)["GNN", True]
    np.testing.assert_array_equal(gnn.mean, [62.04, 34.79, 12.37, 9.57, 8.57])


def test_both_costs_of_a_flock():
    results = [result("mst", "flocking", velocity_variance_mean=0.2, velocity_variance_sem=0.01)]
    variance = found(FIG6, results, VELOCITY_VARIANCE)
    np.testing.assert_array_equal(variance["mst", False].mean, [0.2])
    assert variance["GNN trained on AoI", True].mean[-1] == 3.0422
    assert found(FIG6, results)["GNN trained on AoI", True].mean[-1] == 39.609


def test_a_baseline_has_no_receptive_field_so_it_is_level():
    its = found(FIG3, sweep("tdma", "range_ratio", {0.25: (26.0, 0.4), 0.5: (9.0, 0.1)}))
    for key, mean in {("tdma", False): 26.0, ("mst", True): 42.02}.items():
        assert its[key].is_level
        np.testing.assert_array_equal(its[key].x, [0.0, 5.0])
        np.testing.assert_array_equal(its[key].mean, [mean, mean])
    assert not its["GNN", True].is_level
    np.testing.assert_array_equal(its["GNN", True].x, [0, 1, 2, 3, 4, 5])


def test_a_policy_with_receptive_fields_has_a_curve_over_them():
    results = [
        result("learned", config={"receptive_field": field}, aoi_mean=mean)
        for field, mean in {3: 20.0, 1: 30.0}.items()
    ]
    curve = found(FIG3, results)["learned", False]
    np.testing.assert_array_equal(curve.x, [1.0, 3.0])
    np.testing.assert_array_equal(curve.mean, [30.0, 20.0])
    assert not curve.is_level


def test_trainings_with_several_seeds_are_one_curve_with_a_band():
    names = ["GNN", "GNN, seed 2", "GNN, seed 3"]
    ages = {0.2: [50.0, 44.0, 47.0], 0.5: [13.0, 12.0, 17.0]}
    results = [
        result(name, range_ratio=x, aoi_mean=age, aoi_sem=1.0)
        for x, each in ages.items()
        for name, age in zip(names, each, strict=True)
    ]
    curve = found(FIG4, results)["GNN", False]
    np.testing.assert_array_equal(curve.mean, [47.0, 14.0])
    np.testing.assert_array_equal(curve.band, [[44.0, 12.0], [50.0, 17.0]])
    assert np.isnan(curve.sem).all()  # they flew the same missions
    assert "from the best to the worst training" in caption(FIG4, results)
    assert found(FIG4, results[::3])["GNN", False].band is None


def test_other_regimes_are_passed_over():
    others = [result("mst", "random-walk"), result("mst", num_robots=20)]
    kept = result("tdma", velocity_ratio=0.5)  # which is nothing to a stationary team
    assert results_of(FIG4, [*others, kept]) == [kept]
    assert results_of(FIG5, [*others, kept]) == others[:1]
    with pytest.raises(ValueError, match="none of the 1 results has task random-walk") as refused:
        results_of(FIG5, [kept])
    assert "--task random-walk --preset reference --robots 10 20 40 60 80" in str(refused.value)


def test_a_single_episode_has_no_error():
    assert np.isnan(found(FIG4, [result("tdma", aoi_sem=None)])["tdma", False].sem[0])


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("episodes", 7, "one episodes, not 4 .tdma at range_ratio 0.25. and 7"),
        ("seed", 51, "one seed, not 50"),
        ("version", "1.2.4", r"one version, not 1\.2\.3"),
        ("num_windows", 250, "num_windows is 500, not 250"),
        ("boundary", "none", "boundary is reflect, not none"),
        ("physics", "contact", "physics is exact, not contact"),
        ("failure_fraction", 0.2, r"failure_fraction is 0, not 0\.2"),
        ("wall_hit", "mirror", "wall_hit is clip, not mirror"),  # in the config alone
    ],
)
def test_mixed_results_are_refused(name, value, complaint):
    mixed = [result("tdma"), result("mst", **{name: value})]
    with pytest.raises(ValueError, match=complaint) as refused:
        results_of(FIG4, mixed)
    assert "swarm-mj evaluate --task stationary " in str(refused.value)


def test_the_caption_says_on_how_much_our_gnns_were_trained():
    trained = [
        result("GNN", config={"receptive_field": hops, "decisions": decisions})
        for hops, decisions in ((0, 40_000), (1, 40_000))
    ]
    results = altered([*trained, result("mst")], commit="def456")
    assert "commits abc123, def456" in caption(FIG3, results)
    assert "trained on" not in caption(FIG3, results[2:])
    assert "trained on 40,000 team decisions each" in caption(FIG3, results)
    longer = result("GNN", config={"receptive_field": 2, "decisions": 1_500_000})
    assert "trained on 40,000 to 1,500,000 team decisions" in caption(FIG3, [*results, longer])


def test_perfect_knowledge_has_the_places_of_the_published_curves_and_the_results_by_hand():
    """Sum over k of 0.81^k is 0.81 / 0.19; the start's variance is 2 V_max² / 3 of 39/40."""
    results = [result("mst", "flocking", velocity_ratio=0.4)]
    curve = perfect_curve(FIG6, FIG6.panels[1], results)
    assert curve is not None
    np.testing.assert_array_equal(curve.x, [0.15, 0.25, 0.325, 0.4, 0.5])
    speed_mps = 20.0 * curve.x  # V_max: 1 km in 50 s is 20 m/s
    expected = 2 * speed_mps**2 / 3 * 39 / 40 * (0.81 / 0.19) / 500
    np.testing.assert_allclose(curve.mean, expected)
    assert perfect_curve(FIG6, FIG6.panels[0], results) is None
