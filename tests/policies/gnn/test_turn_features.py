"""Every turn feature by hand, on one team of five, and laws; times are in windows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mixed_missions import MISSION as WALK
from mixed_missions import flown

from swarm_mj.mission import paper, reference
from swarm_mj.policies.gnn import turn_features
from swarm_mj.policies.gnn.turn_features import TurnFeatures
from swarm_mj.protocol.buffers import NEVER, empty_buffers
from swarm_mj.protocol.window import LocalViews
from swarm_mj.simulation.swarm import Swarm

NOW = 10.0
OBSERVER = 1  # the robot whose row is looked at
APART = {
    **{"0.15 ranges": 0.15, "0.25 ranges": 0.25, "0.35 ranges": 0.35, "0.5 ranges": 0.5},
    **{"0.7 ranges": 0.7, "1 range": 1.0, "1.5 ranges": 1.5, "2 ranges": 2.0, "3 ranges": 3.0},
}
NEAREST = (3, 6, 12, 24)
# As stored policies know them, in their order, and none of the code under test: two features that
# change places are both wrong.
NAMES = (
    *("is oneself", "is known", "age of T", "age of L", "x, in ranges", "y, in ranges", "distance"),
    *("is in range", "P is oneself", "v_x", "v_y", "rank by distance"),
    *("is staler", "rank by T"),
    *("T is not from before L", "teammates behind it in the tree of P", "hops in the tree of P"),
    *(f"is due within {each}" for each in APART),
    *("teammates unknown", "neighbours", "staler robots within 0.25 ranges"),
    *("staler robots within 0.5 ranges", "staler robots within 1 range"),
    *("staler robots within 2 ranges", "staler robots"),
    *(f"staler robots among the nearest {number}" for number in NEAREST),
    *("since the robot last spoke first", "its last packet was answered", "greatest age of T"),
    "least age of T",
    *(f"is itself due within {each}" for each in APART),
)


def buffers_of_robot_1():
    """It heard of robot 0 at 4 from itself, never of robot 2; of robots 3 and 4 by way of robot 0.

    It last addressed robot 0, at 8, and robot 3, at 3. A range is 250 m. Robot 0 is 50 m to the
    right, robot 3 is 350 m off, robot 4 is 100 m above.
    """
    buffers = empty_buffers(1, 5)
    buffers.timestamp[0, OBSERVER] = [4.0, NOW, NEVER, 9.0, 8.5]
    buffers.position_m[0, OBSERVER] = [
        [150.0, 0.0], [100.0, 0.0], [0.0, 0.0], [-110.0, -280.0], [100.0, 100.0],
    ]  # fmt: skip
    buffers.velocity_mps[0, OBSERVER] = [
        [1.0, -3.0], [-1.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [-1.0, 1.5],
    ]  # fmt: skip
    buffers.parent[0, OBSERVER] = [1, -1, -1, 0, 3]
    buffers.last_attempt[0, OBSERVER, [0, 3]] = [8.0, 3.0]
    return buffers


def seen(buffers, mission=None, observer=OBSERVER):
    """The features of each teammate by their names, and the graphs."""
    num_robots = buffers.shape[1]
    extractor = TurnFeatures(mission or paper("stationary", num_robots=num_robots))
    graphs = extractor.graphs(LocalViews(buffers=buffers, now=np.array([NOW]), phases=()))
    return dict(zip(NAMES, graphs.node[observer].T, strict=True)), graphs


def log_age(windows):
    return math.log(1 + windows) / math.log(501)


def log_count(count):
    return math.log(1 + count) / math.log(41)


def check(found, expected):
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-6, err_msg=name)


def test_places_of_distances_are_named_by_them():
    places = {name: place for name, place in vars(turn_features).items() if name.startswith("AT_")}
    assert len(places) == len(turn_features.DISTANCES_APART)
    for name, place in places.items():
        digits = name.removeprefix("AT_")
        named = float(f"{digits[0]}.{digits[1:] or 0}")
        assert turn_features.DISTANCES_APART[place] == named


def test_the_names_are_those_of_stored_policies_in_their_order():
    assert TurnFeatures.names == NAMES


def test_states_and_ages():
    found, graphs = seen(buffers_of_robot_1())
    check(
        found,
        {
            "is oneself": [0, 1, 0, 0, 0],
            "is known": [1, 1, 0, 1, 1],
            "age of T": [log_age(6), 0, 1, log_age(1), log_age(1.5)],
            "age of L": [log_age(2), log_age(2), 1, log_age(7), 1],  # its own: of its last packet
            "x, in ranges": [0.2, 0, 0, -0.84, 0],
            "y, in ranges": [0, 0, 0, -1.12, 0.4],
            "distance": [0.05, 0, 1, 0.35, 0.1],  # of 4 ranges; who is unknown may be far
            "is in range": [1, 0, 0, 0, 1],
            "P is oneself": [1, 0, 0, 0, 0],
            "v_x": [2 / 3, 0, 0, 0, 0],
            "v_y": [-1, 0, 0, 0, 0.5],
            "rank by distance": [log_count(n) for n in (1, 0, 4, 3, 2)],
            "T is not from before L": [0, 0, 0, 1, 0],
            "teammates unknown": [log_count(1)] * 5,
            "neighbours": [0.2] * 5,
            "since the robot last spoke first": [log_age(2)] * 5,
            "its last packet was answered": [0] * 5,
            "greatest age of T": [log_age(6)] * 5,
            "least age of T": [log_age(1)] * 5,
        },
    )
    assert graphs.may_address[OBSERVER].tolist() == [True, True, True, False, True]
    assert graphs.parent[OBSERVER].tolist() == [1, -1, -1, 0, 3]
    assert not graphs.has_turn.any()


def test_heights_are_part_of_distances():
    """Robot 0 flies 300 m above robot 1, 1.2 ranges: no packet reaches it."""
    flat = buffers_of_robot_1()
    lifted = np.zeros((*flat.position_m.shape[:3], 3))
    lifted[..., :2] = flat.position_m
    lifted[..., 0, 2] = 300.0
    moved = np.zeros_like(lifted)
    moved[..., :2] = flat.velocity_mps
    mission = paper("stationary", num_robots=5, robot="quadrotor")
    found, graphs = seen(replace(flat, position_m=lifted, velocity_mps=moved), mission)
    apart_m = math.hypot(50.0, 300.0)
    np.testing.assert_allclose(found["distance"][0], apart_m / 250.0 / 4.0, rtol=1e-6)
    assert found["is in range"].tolist() == [0, 0, 0, 0, 1]
    assert graphs.may_address[OBSERVER].tolist() == [False, True, True, False, True]


def test_the_tree_of_parents():
    """Robot 4's news came over robot 3, whose own came over robot 0."""
    check(
        seen(buffers_of_robot_1())[0],
        {
            "teammates behind it in the tree of P": [log_count(2), 0, 0, log_count(1), 0],
            "hops in the tree of P": [0.2, 0, 0, 0.4, 0.6],
        },
    )


def test_parents_that_lead_in_a_circle_end():
    """As those of news from different times may."""
    buffers = buffers_of_robot_1()
    buffers.parent[0, OBSERVER] = [1, -1, -1, 4, 3]
    assert seen(buffers)[0]["hops in the tree of P"].tolist() == pytest.approx([0.2, 0, 0, 2, 2])


@pytest.mark.parametrize(("heard", "is_answered"), [(7.5, 0.0), (8.0, 1.0), (9.0, 1.0)])
def test_an_answer_is_news_of_the_robot_addressed_from_then_on(heard, is_answered):
    """It addressed robot 0 at 8."""
    buffers = buffers_of_robot_1()
    buffers.timestamp[0, OBSERVER, 0] = heard
    found, _ = seen(buffers)
    assert found["T is not from before L"].tolist() == [is_answered, 0, 0, 1, 0]
    assert np.all(found["its last packet was answered"] == is_answered)


def test_silence_is_no_packet_where_it_is_noted():
    """Under the reference preset, a silent robot notes that it addressed itself."""
    buffers = buffers_of_robot_1()
    buffers.last_attempt[0, OBSERVER, OBSERVER] = 9.5
    found, _ = seen(buffers)
    assert found["age of L"][OBSERVER] == pytest.approx(log_age(2))
    assert found["rank by T"][OBSERVER] == pytest.approx(log_count(1))


def test_who_has_been_silent_for_longer():
    """Robot 1 spoke at 8: robot 0, heard of at 4, is staler; robots 4 and 3 are not."""
    one = log_count(1)
    check(
        seen(buffers_of_robot_1())[0],
        {
            "is staler": [1, 0, 0, 0, 0],
            # Who is unknown comes last.
            "rank by T": [0, one, log_count(4), log_count(3), log_count(2)],
            "staler robots within 0.25 ranges": [one] * 5,
            "staler robots within 0.5 ranges": [one] * 5,
            "staler robots within 1 range": [one] * 5,
            "staler robots within 2 ranges": [one] * 5,
            "staler robots": [one] * 5,
            **{f"staler robots among the nearest {number}": [one] * 5 for number in NEAREST},
        },
    )


@pytest.mark.parametrize(
    ("ranges", "counts"),
    [(0.24, [1, 1, 1, 1, 1]), (0.4, [0, 1, 1, 1, 1]), (0.9, [0, 0, 1, 1, 1]),
     (1.9, [0, 0, 0, 1, 1]), (2.1, [0, 0, 0, 0, 1])],
)  # fmt: skip
def test_staler_robots_count_by_their_distance(ranges, counts):
    buffers = buffers_of_robot_1()
    buffers.position_m[0, OBSERVER, 0] = [100.0, 250.0 * ranges]
    found, _ = seen(buffers)
    first = NAMES.index("staler robots within 0.25 ranges")
    for name, count in zip(NAMES[first : first + 5], counts, strict=True):
        assert found[name][OBSERVER] == pytest.approx(log_count(count)), name


def test_staler_robots_count_by_how_many_are_nearer():
    """In a row to the right, the stalest the farthest; oneself, who spoke at 8, is the freshest."""
    buffers = empty_buffers(1, 30)
    buffers.timestamp[0, OBSERVER] = np.linspace(7.0, 1.0, 30)
    buffers.last_attempt[0, OBSERVER, 0] = 8.0
    buffers.position_m[0, OBSERVER, :, 0] = 10.0 * np.arange(30)
    buffers.position_m[0, OBSERVER, OBSERVER, 0] = -10.0
    buffers.timestamp[0, OBSERVER, [0, 3]] = 9.0  # the nearest, and the third: not staler
    found, _ = seen(buffers)
    counts = [found[f"staler robots among the nearest {number}"][OBSERVER] for number in NEAREST]
    assert counts == pytest.approx([log_count(n) for n in (1, 4, 10, 22)])


def test_who_is_as_near_ranks_by_staleness():
    buffers = empty_buffers(1, 3)
    buffers.timestamp[0, OBSERVER] = [5.0, NOW, 4.0]
    buffers.position_m[0, OBSERVER, :, 0] = [0.0, 50.0, 100.0]
    found, _ = seen(buffers)
    assert found["rank by distance"].tolist() == pytest.approx([log_count(n) for n in (2, 0, 1)])


def test_who_is_due_is_far_enough_from_the_staler_ones_that_are():
    """Robots by staleness: 0, then 1 itself (0.2 ranges off), 4 and 3; 2 is unknown.

    Robot 0 always is. Robot 1 is too near to it but at the first level. Robot 4 is sqrt(0.2² +
    0.4²) = 0.45 off it and 0.4 off robot 1; robot 3 sqrt(1.04² + 1.12²) = 1.53 off robot 0.
    """
    found, _ = seen(buffers_of_robot_1())
    for name, apart in APART.items():
        due = [1, apart <= 0.2, 0, apart <= 1.5, apart <= 0.4]
        assert found[f"is due within {name}"].tolist() == due, name
        assert found[f"is itself due within {name}"].tolist() == [apart <= 0.2] * 5, name


def test_who_is_not_due_keeps_nobody_from_being():
    """In a row, 0.6 ranges apart: the second is too near to the first, so the third is due."""
    buffers = buffers_of_robot_1()
    buffers.position_m[0, OBSERVER, :, 1] = 0.0
    buffers.position_m[0, OBSERVER, :, 0] = [0.0, 150.0, 0.0, 450.0, 300.0]
    found, _ = seen(buffers)  # 0 (stalest), 1, 4, 3 from left to right
    due = {name: found[f"is due within {name}"].tolist() for name in APART}
    for name in ("0.15 ranges", "0.25 ranges", "0.35 ranges", "0.5 ranges"):
        assert due[name] == [1, 1, 0, 1, 1]
    assert due["0.7 ranges"] == due["1 range"] == [1, 0, 0, 0, 1]
    assert due["1.5 ranges"] == [1, 0, 0, 1, 0]
    assert due["2 ranges"] == due["3 ranges"] == [1, 0, 0, 0, 0]
    own = [found[f"is itself due within {name}"].tolist() for name in APART]
    assert own == [*[[1] * 5] * 4, *[[0] * 5] * 5]


@pytest.mark.parametrize(("first_x", "due"), [(99.0, [1, 0]), (101.0, [0, 1])])
def test_who_is_equally_stale_is_due_by_where_it_is(first_x, due):
    """The one farther to the left, whoever it is: there is no order of identities."""
    buffers = empty_buffers(1, 3)
    buffers.timestamp[0, OBSERVER] = [4.0, NOW, 4.0]
    buffers.last_attempt[0, OBSERVER, 0] = 8.0
    buffers.position_m[0, OBSERVER] = [[first_x, 0.0], [300.0, 0.0], [100.0, 0.0]]
    found, _ = seen(buffers)
    assert found["is due within 0.5 ranges"][[0, 2]].tolist() == due
    assert found["rank by T"][[0, 2]].tolist() == pytest.approx([log_count(1 - d) for d in due])


def test_a_robot_that_never_spoke_is_due_by_its_own_belief():
    buffers = buffers_of_robot_1()
    buffers.last_attempt[0] = NEVER
    found, _ = seen(buffers)
    assert all(np.all(found[f"is itself due within {name}"] == 1.0) for name in APART)


def test_other_identities_are_the_same_graph():
    """The features of renamed robots are the renamed features: there is no order of identities."""
    views = flown(0)[-1]
    order = np.random.default_rng(0).permutation(views.num_robots)
    extractor = TurnFeatures(WALK)
    node = extractor.graphs(views).node.reshape(*views.buffers.timestamp.shape, -1)
    renamed = extractor.graphs(_renamed(views, order)).node.reshape(node.shape)
    np.testing.assert_array_equal(renamed, node[:, order][:, :, order])


def _renamed(views, order):
    buffers, place = views.buffers, np.argsort(order)
    pairs = {
        name: getattr(buffers, name)[:, order][:, :, order]
        for name in ("timestamp", "position_m", "velocity_mps", "parent", "last_attempt")
    }
    parent = pairs["parent"]
    pairs["parent"] = np.where(parent < 0, parent, place[parent]).astype(parent.dtype)
    return LocalViews(
        buffers=type(buffers)(**pairs, is_granted=buffers.is_granted), now=views.now, phases=()
    )


def test_nothing_tells_the_clock():
    """The same news a hundred windows later, all of it, is the same graph."""
    views = flown(0)[-1]
    buffers = views.buffers
    later = {
        name: np.where(getattr(buffers, name) > NEVER, getattr(buffers, name) + 100.0, NEVER)
        for name in ("timestamp", "last_attempt")
    }
    moved = replace(buffers, **later)
    extractor = TurnFeatures(WALK)
    node = extractor.graphs(views).node
    shifted = extractor.graphs(LocalViews(buffers=moved, now=views.now + 100.0, phases=())).node
    np.testing.assert_array_equal(shifted, node)


def plain(views, mission):
    """All features, robot by robot and name by name, in no hurry."""
    buffers = views.buffers
    rows = []
    for b, now in enumerate(views.now):
        rows += [_plain_graph(buffers, mission, b, i, now) for i in range(views.num_robots)]
    return np.array(rows, dtype=np.float32)


def _plain_graph(buffers, mission, b, i, now):
    num_robots = buffers.shape[1]
    t, attempt, parent = buffers.timestamp[b, i], buffers.last_attempt[b, i], buffers.parent[b, i]
    place = (buffers.position_m[b, i] - buffers.position_m[b, i, i]) / mission.range_m
    speed = (buffers.velocity_mps[b, i] - buffers.velocity_mps[b, i, i]) / mission.max_velocity_mps
    others = [k for k in range(num_robots) if k != i]
    granted = buffers.is_granted[b]
    known = {k for k in range(num_robots) if k == i or t[k] > NEVER or granted}
    spoke = max(attempt[k] for k in others)
    since = {k: spoke if k == i else t[k] for k in known}
    order = sorted(known, key=lambda k: (since[k], *place[k]))
    ranges = np.hypot(*place.T)
    due = {name: _due(order, place, apart) for name, apart in APART.items()}
    chains = {k: _chain(parent, k, i) for k in others}
    staler = order[: order.index(i)]

    def age(then, is_granted=False):
        is_long_ago = not (then > NEVER or is_granted) or now - then >= 500.0
        return 1.0 if is_long_ago else log_age(now - then)

    def count_staler(radius):
        return log_count(sum(ranges[k] <= radius for k in staler))

    nearest = sorted(order, key=lambda k: ranges[k])

    def count_staler_of(number):
        return log_count(sum(k in staler for k in nearest[: number + 1]))

    answered = any(attempt[k] == spoke > NEVER and t[k] >= spoke for k in others)
    shared = {
        "teammates unknown": log_count(num_robots - len(known)),
        "neighbours": sum(k in known and ranges[k] <= 1.0 for k in others) / 10.0,
        "staler robots within 0.25 ranges": count_staler(0.25),
        "staler robots within 0.5 ranges": count_staler(0.5),
        "staler robots within 1 range": count_staler(1.0),
        "staler robots within 2 ranges": count_staler(2.0),
        "staler robots": log_count(len(staler)),
        **{f"staler robots among the nearest {each}": count_staler_of(each) for each in NEAREST},
        "since the robot last spoke first": age(spoke),
        "its last packet was answered": answered,
        "greatest age of T": age(min([now, *(t[k] for k in known - {i})]), True),
        "least age of T": age(max([NEVER, *(t[k] for k in known - {i})])),
        **{f"is itself due within {name}": i in its for name, its in due.items()},
    }
    nodes = []
    for k in range(num_robots):
        is_known = k in known
        of_k = {
            "is oneself": k == i,
            "is known": is_known,
            "age of T": age(t[k], is_known),
            "age of L": age(spoke if k == i else attempt[k]),
            "x, in ranges": np.clip(place[k, 0], -4.0, 4.0) if is_known else 0.0,
            "y, in ranges": np.clip(place[k, 1], -4.0, 4.0) if is_known else 0.0,
            "distance": min(ranges[k], 4.0) / 4.0 if is_known else 1.0,
            "is in range": is_known and k != i and ranges[k] <= 1.0,
            "P is oneself": k != i and parent[k] == i,
            "v_x": speed[k, 0] if is_known else 0.0,
            "v_y": speed[k, 1] if is_known else 0.0,
            "rank by distance": log_count(nearest.index(k) if is_known else len(known)),
            "is staler": k in staler,
            "rank by T": log_count(order.index(k) if is_known else len(known)),
            "T is not from before L": k != i and NEVER < attempt[k] <= t[k],
            "teammates behind it in the tree of P": log_count(
                sum(chain.count(k) for chain in chains.values() if k != i)
            ),
            "hops in the tree of P": 0.0 if k == i else len(chains[k]) / 5.0,
            **{f"is due within {name}": k in its for name, its in due.items()},
            **shared,
        }
        assert tuple(of_k) == NAMES
        nodes.append(list(of_k.values()))
    return nodes


def _due(order, place, apart):
    due = []
    for k in order:
        if all(np.hypot(*(place[k] - place[j])) >= apart for j in due):
            due.append(k)
    return due


def _chain(parent, k, i):
    """Whom a teammate's news came through: the last is the robot itself."""
    chain = [parent[k]] if parent[k] >= 0 else []
    while chain and chain[-1] not in (i, -1) and len(chain) < 10:
        chain.append(parent[chain[-1]])
    return chain


def granted():
    """What everyone knows after a few windows in which all starts were known."""
    mission = paper("random-walk", num_robots=7, prior_knowledge="start")
    swarm = Swarm(mission, [5])
    rng = np.random.default_rng(5)
    for _ in range(4):
        talk = np.where(rng.random((1, 7)) < 0.3, rng.integers(0, 7, (1, 7)), np.arange(7))
        swarm.step_with_recipients(talk)
    return swarm.views, mission


@pytest.mark.parametrize("seed", [0, 1])
def test_one_pass_writes_what_plain_loops_say(seed):
    for views in flown(seed)[::6]:
        node = TurnFeatures(WALK).graphs(views).node
        np.testing.assert_allclose(node, plain(views, WALK), rtol=1e-5, atol=1e-6)


def test_who_was_granted_is_known_and_as_stale_as_the_start():
    views, mission = granted()
    node = TurnFeatures(mission).graphs(views).node
    np.testing.assert_allclose(node, plain(views, mission), rtol=1e-5, atol=1e-6)
    assert np.all(node[..., NAMES.index("teammates unknown")] == 0.0)


def test_all_numbers_are_within_the_bounds_of_environments():
    """Also in a large team under the other preset, where silence is noted."""
    mission = reference("stationary", num_robots=60, range_ratio=1.0, num_windows=40)
    swarm = Swarm(mission, [1])
    rng = np.random.default_rng(1)
    for _ in range(40):
        speaks = rng.random((1, 60)) < 0.05
        talk = np.where(speaks, rng.integers(0, 60, (1, 60)), np.arange(60))
        swarm.step_with_recipients(talk)
    node = TurnFeatures(mission).graphs(swarm.views).node
    assert np.all(np.isfinite(node))
    assert np.abs(node).max() <= 6.0
