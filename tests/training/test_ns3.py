"""Our channels against decisions recorded from ns-3, a simulator that no one here wrote.

The recordings in tests/golden/ns3 hold scenes: one slot of a team at rest, in which some robots
send at once. ns-3 says which packets each robot could decode, and how strong they are. `make
reference` asks it again.
"""

import math
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference import ns3
from scipy.stats import ks_2samp

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


def ours(name, threshold_factor=1.0):
    """The sender that each robot decodes [k, j] in our channel, whose threshold may be wrong."""
    position_m, recipient = load(name)["position_m"], load(name)["recipient"]
    each = np.arange(len(recipient))  # a mission for each scene, in its first slot
    channel = started(ns3.SETS[name].mission, len(each)).channel
    if isinstance(channel, ComposedChannel):
        rule = channel.reception
        channel.reception = rule._replace(threshold=rule.threshold * threshold_factor)
        return channel.at(np.zeros_like(each), each)(position_m, recipient)
    assert isinstance(channel, FreeSpaceRadio)
    return replace(channel, threshold=channel.threshold * threshold_factor)(position_m, recipient)


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
    assert decisions == 21_603
    assert packets == 1_515


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
