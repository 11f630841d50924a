"""Our channels against decisions recorded from ns-3, a simulator that no one here wrote.

The recordings in tests/golden/ns3 hold scenes: one slot of a team at rest, in which some robots
send at once. ns-3 says which packets each robot could decode, and how strong they are. `make
reference` asks it again.
"""

import math
import re
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference import ns3
from scipy.stats import ks_2samp

import swarm_mj
from swarm_mj.mission import paper
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.fading import fade, mixed
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import mission_radio, radio_of

LIGHT_MPS = 299_792_458.0
# Eq. 1 rounds 20 log10(c / 4 pi) to 147.55: that much more arrives in ns-3 of the same power.
ROUNDED_DB = 20.0 * math.log10(LIGHT_MPS / (4.0 * math.pi)) - 147.55
CERTAIN = [name for name, scenes in ns3.SETS.items() if scenes.mission.fading == "none"]
all_sets = pytest.mark.parametrize("name", ns3.SETS)
certain_sets = pytest.mark.parametrize("name", CERTAIN)


@cache
def load(name):
    with np.load(ns3.GOLDEN / f"{name}.npz") as recording:
        return dict(recording)


def theirs(name):
    """The sender that each robot decodes [k, j], by ns-3's decisions and powers."""
    golden = load(name)
    return ns3.heard(ns3.SETS[name].mission, golden["recipient"], golden)


def started(mission, num_missions=1):
    """The mission's radio, ready to fly that many missions."""
    radio = mission_radio(mission)
    if isinstance(radio.channel, ComposedChannel):
        rngs = [np.random.default_rng(seed) for seed in range(num_missions)]
        radio.channel.start(mission.num_robots, rngs)
    return radio


def ours(name, threshold_factor=1.0, position_m=None):
    """The sender that each robot decodes [k, j] in our channel, whose threshold may be wrong.

    None for the positions is where ns-3 had the robots.
    """
    recipient = load(name)["recipient"]
    if position_m is None:
        position_m = load(name)["position_m"]
    each = np.arange(len(recipient))  # a mission for each scene, in its first slot
    channel = started(ns3.SETS[name].mission, len(each)).channel
    if isinstance(channel, ComposedChannel):
        rule = channel.reception
        channel.reception = rule._replace(threshold=rule.threshold * threshold_factor)
        return channel.at(np.zeros_like(each), each)(position_m, recipient)
    assert isinstance(channel, FreeSpaceRadio)
    return replace(channel, threshold=channel.threshold * threshold_factor)(position_m, recipient)


def apart_at_one_height(name):
    """The receptions [k, j] that we decide otherwise if all robots are at one height."""
    at_one_height_m = load(name)["position_m"] * (1.0, 1.0, 0.0)
    return np.argwhere(ours(name, position_m=at_one_height_m) != theirs(name))


@all_sets
def test_ns3_was_given_the_radio_of_the_mission(name):
    golden, radio = load(name), radio_of(ns3.SETS[name].mission)
    power_w, noise_w, threshold, frequency_hz = golden["radio"].tolist()
    assert noise_w * 1e3 == pytest.approx(radio.noise_mw, rel=1e-12)
    assert abs(ROUNDED_DB - 0.0022) < 5e-5
    assert power_w * 1e3 * 10.0 ** (ROUNDED_DB / 10.0) == pytest.approx(radio.power_mw, rel=1e-12)
    assert (threshold, frequency_hz) == (radio.threshold, radio.frequency_hz)
    assert str(golden["law"]) == ns3.SETS[name].law
    assert str(golden["made_by"]).startswith("ns-3 3.44: make reference")


def test_there_are_thousands_of_decisions_and_many_packets_decode():
    decisions = packets = 0
    for name in CERTAIN:
        recipient = load(name)["recipient"]
        num_robots = recipient.shape[1]
        decisions += int(np.sum(recipient != np.arange(num_robots))) * (num_robots - 1)
        packets += int(load(name)["decodes"].sum())
    assert decisions == 27_474
    assert packets == 1_850


@certain_sets
def test_eq4_every_decision_is_ns3s(name):
    np.testing.assert_array_equal(ours(name), theirs(name))


def test_the_page_has_the_numbers_of_the_recordings():
    page = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    section = page.partition("## Parity with ns-3")[2].partition("\n## ")[0]
    shown = [line.split("|")[3:7] for line in section.splitlines() if line.startswith("|")][2:]
    for name, row in zip(CERTAIN, shown, strict=True):
        is_sender = load(name)["recipient"] != np.arange(load(name)["recipient"].shape[1])
        pairs = is_sender.sum() * (is_sender.shape[1] - 1), load(name)["decodes"].sum()
        differ = (np.sum(ours(name, factor) != theirs(name)) for factor in (1.0, 1.03, 0.97))
        numbers = [int(number) for cell in row for number in cell.split(",")]
        assert numbers == [int(number) for number in (*pairs, *differ)], name
    flat = sum(len(apart_at_one_height(name)) for name in ("heights", "heights-street"))
    assert f"the same height, {flat} receptions would differ" in section
    authors = load("authors")
    is_addressed = authors["recipient"][:, :, None] == np.arange(20)
    while_sending = authors["decodes_if_silent"] & is_addressed & ~authors["decodes"]
    assert f"{while_sending.sum()} of the packets decoded under `--preset reference`" in section


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_a_threshold_wrong_by_three_per_cent_disagrees(factor):
    """So the comparison could fail."""
    mismatches = [np.sum(ours(name, factor) != theirs(name)) for name in CERTAIN]
    assert sum(mismatches) >= 10
    assert sum(count > 0 for count in mismatches) >= 4


@pytest.mark.parametrize("name", ["heights", "heights-street"])
def test_robots_of_these_sets_fly_and_without_their_heights_we_disagree(name):
    """Heights are spread from 5 to 120 m; where all are the same, other packets decode."""
    position_m = load(name)["position_m"]
    quartiles_m = np.quantile(position_m[..., 2], [0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(quartiles_m, [5.0, 33.75, 62.5, 91.25, 120.0], atol=7.0)
    assert len(apart_at_one_height(name)) >= 15


def test_what_ns3_says_otherwise_than_it_did_is_counted(capsys):
    arrays = load("two-ray")
    assert ns3.differences("two-ray", arrays) == 0
    arrays = arrays | {"decodes": ~arrays["decodes"], "received_mw": arrays["received_mw"] * 1.001}
    assert ns3.differences("two-ray", arrays) == arrays["decodes"].size + 3363
    assert capsys.readouterr().out.splitlines()[0].endswith("207 packets decoded; 0 differ")


def test_without_ns3_or_a_compiler_the_way_out_is_named(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="make reference installs it"):
        ns3.compiled(tmp_path, tmp_path)
    header = tmp_path / "include" / "ns3" / "spectrum-module.h"
    header.parent.mkdir(parents=True)
    header.touch()
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(ValueError, match=r"install g\+\+"):
        ns3.compiled(tmp_path, tmp_path)


@certain_sets
def test_eq1_powers_are_ns3s_but_for_the_rounded_147_55(name):
    golden, truth = load(name), started(ns3.SETS[name].mission).truth
    is_sender = golden["recipient"] != np.arange(golden["recipient"].shape[1])
    for k in range(len(is_sender)):
        received_mw = truth.links(golden["position_m"][k], 0).received_mw
        expected_mw = golden["received_mw"][k]
        np.testing.assert_allclose(
            received_mw[is_sender[k]], expected_mw[is_sender[k]], rtol=1e-9, atol=0.0
        )


@certain_sets
def test_eq3_ns3s_radios_decode_nothing_while_they_send(name):
    """As the paper's: strict half duplex is ns-3's own rule, too."""
    is_sender = load(name)["recipient"] != np.arange(load(name)["recipient"].shape[1])
    assert not np.any(load(name)["decodes"] & is_sender[:, None, :])


def test_under_the_authors_half_duplex_robots_decode_while_they_send():
    """Some decisions of the recording are such."""
    is_sender = load("authors")["recipient"] != np.arange(20)
    hears_while_sending = is_sender & (theirs("authors") != np.arange(20))
    assert hears_while_sending.sum() >= 20


def test_capture_below_0_db_several_packets_are_decodable_and_the_strongest_counts():
    num_decodable = load("capture")["decodes"].sum(axis=1)
    assert np.sum(num_decodable > 1) >= 20


def p_value_of(ours, theirs):
    """That both are drawn from one distribution."""
    return np.asarray(ks_2samp(ours, theirs))[1]


def test_rayleigh_fades_have_the_distribution_of_ns3s_nakagami_fades():
    """With m = 1; two-sample Kolmogorov-Smirnov."""
    golden = load("rayleigh")
    free_space = replace(ns3.SETS["rayleigh"].mission, fading="none")
    mean_mw = started(free_space).truth.links(golden["position_m"][0], 0).received_mw
    is_link = golden["received_mw"][0] > 0.0
    their = (golden["received_mw"][:, is_link] / mean_mw[is_link]).ravel()
    keys = [np.uint64(mixed(np.uint64(7), np.uint64(k))) for k in range(20_000)]
    our = np.array([fade(key, 0.0) for key in keys])
    assert len(their) == 5400
    assert p_value_of(our, their) == pytest.approx(0.98, abs=0.005)  # as docs/results.md says
    rician = np.array([fade(key, 1.0) for key in keys])
    assert p_value_of(rician, their) == pytest.approx(1e-11, rel=0.5)  # the test can fail


def test_as_many_packets_decode_over_rayleigh_fading_as_in_ns3():
    """Link by link, with an interferer that fades, too: within 4 standard errors."""
    golden, mission = load("rayleigh"), ns3.SETS["rayleigh"].mission
    num_slots, num_robots = 20_000, mission.num_robots
    position_m = np.repeat(golden["position_m"][:1], num_slots, axis=0)
    recipient = np.repeat(golden["recipient"][:1], num_slots, axis=0)
    channel = started(mission).channel
    assert isinstance(channel, ComposedChannel)
    heard = channel.at(np.arange(num_slots), np.zeros(num_slots, dtype=int))(position_m, recipient)
    for i in range(2):
        for j in range(2, num_robots):
            share = np.mean(heard[:, j] == i)
            count, of = golden["decodes"][:, i, j].sum(), len(golden["decodes"])
            error = math.sqrt(share * (1.0 - share) * (1.0 / of + 1.0 / num_slots))
            assert abs(count / of - share) <= 4.0 * error + 1e-9


FAST = paper("random-walk", num_robots=10, num_windows=60, velocity_ratio=0.9)
SMALL = ns3.Scenes(mission=FAST)
HIGH = paper(
    "random-walk",
    num_robots=10,
    num_windows=20,
    robot="quadrotor",
    height_m=5.0,
    height_range_m=115.0,
)


class StandIn:
    """Answers in place of ns-3, by the rules of ns-2's traces and SINR in free space.

    In its traces robots stay at their first height.
    """

    def said_by(self, _, lines):
        answers = []
        for line in lines:
            word, *rest = line.split()
            if word == "radio":
                numbers = map(float, rest[:4])
                self.power_w, self.noise_w, self.threshold, self.frequency_hz = numbers
            elif word == "moves":
                answers += self.moves(rest[0], int(rest[1]), list(map(float, rest[2:])))
            else:
                answers += self.scene(int(rest[0]), list(map(float, rest[1:])))
        return answers

    def moves(self, trace, num_robots, times):
        """Where the robots are at each time, of a trace whose legs end before others begin."""
        place_m = np.zeros((len(times), num_robots, 3))
        from_m = np.zeros((num_robots, 3))
        for line in Path(trace).read_text().splitlines():
            words = line.replace('"', " ").split()
            if words[0].startswith("$node_"):
                axis = ("X_", "Y_", "Z_").index(words[2])
                place_m[:, int(words[0][7:-1]), axis] = float(words[3])
                from_m[int(words[0][7:-1]), axis] = float(words[3])
            elif words[0] == "$ns_":
                begin_s, robot = float(words[2]), int(words[3][7:-1])
                to_m = np.array([float(words[5]), float(words[6]), from_m[robot, 2]])
                length_m = np.linalg.norm(to_m - from_m[robot])
                for k, at_s in enumerate(times):
                    if at_s > begin_s:
                        share = min(1.0, (at_s - begin_s) * float(words[7]) / length_m)
                        place_m[k, robot] = from_m[robot] + share * (to_m - from_m[robot])
                from_m[robot] = to_m
        return place_m.reshape(len(times), -1).tolist()

    def scene(self, num_robots, numbers):
        """Who decodes each sender, who would if it were silent, and the power at everyone [mW]."""
        sends = numbers[:num_robots]
        place_m = np.array(numbers[num_robots:]).reshape(-1, 3)
        length_m = LIGHT_MPS / self.frequency_hz
        power_w = np.zeros((num_robots, num_robots))
        for i in range(num_robots):
            for j in range(num_robots):
                if i != j and sends[i]:
                    way_m = math.dist(place_m[i], place_m[j])
                    power_w[i, j] = self.power_w * (length_m / (4.0 * math.pi * way_m)) ** 2
        for i in range(num_robots):
            if sends[i]:
                others_w = power_w.sum(axis=0) - power_w[i]
                clears = power_w[i] / (self.noise_w + others_w) >= self.threshold
                decodes = [bool(clears[j]) and not sends[j] for j in range(num_robots)]
                yield from (decodes, clears.tolist(), (1e3 * power_w[i]).tolist())


@pytest.fixture(scope="module")
def export(tmp_path_factory):
    """Where the export of a flight is, whose files' names begin with `a`."""
    stem = tmp_path_factory.mktemp("export") / "a"
    ns3.exported(SMALL.mission, "mst", stem)
    return stem


@pytest.fixture
def flown_apart(export, tmp_path, monkeypatch):
    """How many packets have other receivers, after a change to the export's trace or table."""
    monkeypatch.setattr(ns3, "said_by", StandIn().said_by)

    def apart(change_trace=str, change_table=str):
        for ending, change in ((".tcl", change_trace), ("-schedule.csv", change_table)):
            text = export.with_name(f"a{ending}").read_text()
            (tmp_path / f"a{ending}").write_text(change(text))
        return ns3.flown_apart(Path("ns3"), SMALL, tmp_path / "a")

    return apart


def test_a_flight_that_is_exported_has_our_receptions_elsewhere(flown_apart, capsys):
    assert flown_apart() == 0
    said = capsys.readouterr().out
    assert said.endswith("receptions; 0 packets differ\n")
    assert int(said.split()[2]) > 100  # packets
    assert int(said.split()[4]) > 100  # receptions


def test_a_flight_at_several_heights_has_its_own_places_elsewhere(tmp_path, monkeypatch):
    """Up to what quadrotors climb or sink as they fly."""
    monkeypatch.setattr(ns3, "said_by", StandIn().said_by)
    run = swarm_mj.fly(HIGH, policy="mst")
    ns3.exported(HIGH, "mst", tmp_path / "a")
    at_s = [0.1 * row for row in range(20)]
    found_m = ns3.places(Path("ns3"), tmp_path / "a.tcl", 10, at_s)
    height_m = run.footage().height_m
    assert height_m is not None
    assert np.ptp(height_m[0]) > 60.0
    np.testing.assert_allclose(found_m[..., :2], run.footage().position_m, atol=1e-4)
    np.testing.assert_allclose(found_m[..., 2], height_m, atol=0.5)


def test_robots_that_stand_still_are_seen(flown_apart):
    assert flown_apart(change_trace=lambda text: text.partition("$ns_")[0]) > 0


def test_another_receiver_is_seen(flown_apart):
    """No robot decodes itself."""
    seven = r"^(\d+,\d,[\d.]+,7,.*),\d+,[\d ]+$"

    def changed(text):
        text, count = re.subn(seven, r"\1,1,7", text, count=1, flags=re.MULTILINE)
        assert count == 1
        return text

    assert flown_apart(change_table=changed) == 1


def test_another_time_is_seen(flown_apart):
    """All requests and responses of the first windows at once."""
    assert flown_apart(change_table=lambda text: re.sub(r",0\.\d+,", ",0.1,", text)) > 0
