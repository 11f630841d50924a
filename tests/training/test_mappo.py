"""The example of a centralised critic: its arithmetic, and a round of training."""

import mappo
import torch


class ByHand:
    """A critic whose values are the states themselves."""

    def value(self, state):
        return state[..., 0]


def test_advantages_are_discounted_sums_of_errors(monkeypatch):
    monkeypatch.setattr(mappo, "NUM_WINDOWS", 3)
    values, rewards = [[1.0, 5.0], [2.0, 4.0], [4.0, 1.0], [8.0, 0.0]], [1.0, 0.0, 2.0]
    flown = {
        "state": torch.tensor(values[:3])[..., None],
        "last_state": torch.tensor(values[3])[..., None],
        "reward": torch.tensor(rewards)[:, None].expand(3, 2),
    }
    mappo.add_advantages(ByHand(), flown)
    for b in (0, 1):
        errors = [rewards[t] + 0.9 * values[t + 1][b] - values[t][b] for t in range(3)]
        for t in range(3):
            expected = sum(0.81 ** (later - t) * errors[later] for later in range(t, 3))
            assert abs(flown["target"][t, b].item() - values[t][b] - expected) < 1e-5
    assert abs(flown["advantage"].mean()) < 1e-6
    assert abs(flown["advantage"].std() - 1.0) < 1e-6


def test_it_trains_and_draws(monkeypatch, tmp_path):
    small = {"NUM_MISSIONS": 2, "NUM_WINDOWS": 10, "NUM_ROUNDS": 1, "ROUNDS_PER_POINT": 1}
    for name, value in {**small, "HELD_OUT": range(1000, 1002)}.items():
        monkeypatch.setattr(mappo, name, value)
    curve = mappo.train()
    assert [windows for windows, _ in curve] == [0, 20]
    assert all(0.0 < age < 10.0 for _, age in curve)
    mappo.draw(curve, str(tmp_path / "curve.png"))
    assert (tmp_path / "curve.png").stat().st_size > 1000
