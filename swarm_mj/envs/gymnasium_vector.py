"""Gymnasium's vector face: B missions in as few swarms as can be.

Missions that begin together are one group, played as one swarm. A mission that is begun alone,
by `reset_mask`, leaves its group for one of its own; its row there flies on, silent and unseen.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from gymnasium.utils import EzPickle, seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from jaxtyping import Bool, Float, Int, UInt8

from swarm_mj.envs.gymnasium import check_paid_together
from swarm_mj.envs.options import check_reset
from swarm_mj.envs.screen import RENDERING, Screen
from swarm_mj.envs.spaces import team_spaces
from swarm_mj.envs.team import Info, Observation, Team, check_count, next_seed
from swarm_mj.mission import Mission
from swarm_mj.system.fields import did_you_mean

METADATA: dict[str, Any] = {**RENDERING, "render_modes": ["rgb_array"]}
Step = tuple[Observation, np.ndarray, np.ndarray, np.ndarray, Info]


@dataclass(frozen=True, kw_only=True)
class _Group:
    """Missions that began together, and the environments that they still are."""

    team: Team
    rows: Int[np.ndarray, "E"]  # of the team's missions
    envs: Int[np.ndarray, "E"]  # and which environment each is


class SwarmVectorEnv(VectorEnv[Observation, np.ndarray, np.ndarray], EzPickle):
    """B missions; each environment is as `SwarmEnv`, and sees the same missions by the same seeds.

    `metadata["autoreset_mode"]` says what happens after a mission's last window. `reset` takes
    `options={"reset_mask": mask}`, which begins the missions where the mask is True.
    """

    metadata = METADATA

    def __init__(
        self,
        num_envs: int = 1,
        mission: Mission | str = "flocking",
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Take how many missions, and which; options as `Team` does.

        Raises:
            ValueError: A value is unknown or out of range.
            TypeError: An option is unknown.
        """
        EzPickle.__init__(
            self,
            num_envs,
            mission,
            autoreset_mode=autoreset_mode,
            render_mode=render_mode,
            **options,
        )
        check_count("num_envs", num_envs)
        self.num_envs = num_envs
        self._mode = _mode_of(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        self._screen = Screen(render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._mission: Mission | str = mission
        self._options = options
        self._groups: list[_Group] = []
        self._is_over = np.zeros(num_envs, dtype=np.bool_)
        self._rngs: dict[int, np.random.Generator] = {}  # that draw seeds, by environment
        team = self._make_team(1)
        check_paid_together(team)
        self.single_observation_space, self.single_action_space = team_spaces(team)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._seen = cast(
            "Observation", create_empty_array(self.single_observation_space, num_envs)
        )

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Begins missions, all or those of `options["reset_mask"]` [B].

        Args:
            seed: One for each environment; or the first one's, which the others count on from; or
                None, for missions drawn from the last seeds given.
            options: `reset_mask`, or nothing.

        Raises:
            ValueError: Not one seed or one bool per environment, another option, or no connected
                team could be drawn.
        """
        check_reset(options or {}, ("reset_mask",))
        super().reset(seed=seed if isinstance(seed, int) else None)
        envs = np.flatnonzero(self._mask_of(options or {}))
        seeds = self._seeds_of(seed)
        infos: Info = {}
        self._begin(envs, [seeds[env] for env in envs.tolist()], infos)
        return self._copied(), infos

    def step(self, actions: np.ndarray) -> Step:
        """One window of every mission; `actions[b, i]` is whom robot i of mission b addresses.

        Raises:
            ValueError: A recipient is no robot, there is not one per robot, or a mission is over
                and nothing begins it anew.
        """
        begun = np.flatnonzero(self._is_over)
        if begun.size and self._mode == AutoresetMode.DISABLED:
            raise ValueError(
                f"environment {begun[0]} is over; begin it anew by reset(options="
                '{"reset_mask": mask})'
            )
        reward, infos = np.zeros(self.num_envs), {}
        self._play(np.asarray(actions), reward, infos)
        is_over = self._is_over.copy()
        is_over[begun] = False
        if begun.size:
            self._begin(begun, [None] * begun.size, infos)
        elif self._mode == AutoresetMode.SAME_STEP and is_over.any():
            infos = self._finals(is_over, infos)
            ended = np.flatnonzero(is_over)
            self._begin(ended, [None] * ended.size, infos)
        return self._copied(), reward, np.zeros_like(is_over), is_over, infos

    def render(self) -> tuple[UInt8[np.ndarray, "H W 3"], ...] | None:
        """Every mission as it is now, in the render mode "rgb_array".

        Raises:
            OSError: No OpenGL works here; it says what to install.
        """
        if self.render_mode != "rgb_array":
            return None
        places = {
            int(env): (group.team, int(row))
            for group in self._groups
            for row, env in zip(group.rows, group.envs, strict=True)
        }
        return tuple(self._screen.picture(*places[env]) for env in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Give back what pictures took."""
        self._screen.close()

    def _make_team(self, num_missions: int) -> Team:
        return Team(self._mission, num_missions, **self._options)

    def _mask_of(self, options: dict[str, Any]) -> Bool[np.ndarray, "B"]:
        """Which environments are to begin."""
        mask = np.asarray(options.get("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(
                f"reset_mask must be {self.num_envs} bools, one an environment and not all False, "
                f"not {mask!r}"
            )
        return mask

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        """Return a seed for each environment, or None."""
        if seed is None or isinstance(seed, int):
            return [seed if seed is None else seed + env for env in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(
                f"seed must be one number, or {self.num_envs}, one an environment, not {seed!r}"
            )
        return seed

    def _begin(self, envs: Int[np.ndarray, "E"], seeds: Sequence[int | None], infos: Info) -> None:
        """Begins these environments' missions; writes what they say into `infos`."""
        for env, seed in zip(envs, seeds, strict=True):
            if seed is not None or env not in self._rngs:
                self._rngs[env], _ = seeding.np_random(seed)
        begun = [
            next_seed(self._rngs[env]) if seed is None else seed
            for env, seed in zip(envs, seeds, strict=True)
        ]
        team = self._spare_team(envs)
        team.restart(begun)
        group = _Group(team=team, rows=np.arange(len(envs)), envs=envs)
        self._groups = [*self._without(envs), group]
        self._is_over[envs] = False
        self._show(group)
        self._note(infos, envs, team.infos())

    def _spare_team(self, envs: Int[np.ndarray, "E"]) -> Team:
        """Return a team of so many missions that no other environment is part of."""
        for group in self._groups:
            if group.team.num_missions == len(envs) and np.isin(group.envs, envs).all():
                return group.team
        return self._make_team(len(envs))

    def _without(self, envs: Int[np.ndarray, "E"]) -> Iterator[_Group]:
        """Return the groups, without environments that begin anew."""
        for group in self._groups:
            stays = ~np.isin(group.envs, envs)
            if stays.any():
                yield _Group(team=group.team, rows=group.rows[stays], envs=group.envs[stays])

    def _play(self, actions: np.ndarray, reward: Float[np.ndarray, "B"], infos: Info) -> None:
        """One window of every mission that is not over yet; fills rewards and infos."""
        if actions.shape != self.action_space.shape:
            raise ValueError(
                f"actions must have shape {self.action_space.shape}, environments by robots, not "
                f"{actions.shape}"
            )
        for group in self._groups:
            if not self._is_over[group.envs[0]]:
                recipient = group.team.flown.views.silence.astype(actions.dtype)
                recipient[group.rows] = actions[group.envs]
                reward[group.envs] = group.team.step(recipient)[group.rows, 0]
                self._is_over[group.envs] = group.team.is_over
                self._show(group)
                said = group.team.infos().items()
                self._note(infos, group.envs, {name: each[group.rows] for name, each in said})

    def _finals(self, is_over: Bool[np.ndarray, "B"], infos: Info) -> Info:
        """What was seen last, and the last window's costs, out of the way of what begins now."""
        left: Info = {}
        last = {name: each for name, each in infos.items() if not name.startswith("_")}
        final: Info = {}
        for envs, place in ((~is_over, left), (is_over, final)):
            if (chosen := np.flatnonzero(envs)).size:
                self._note(place, chosen, {name: each[chosen] for name, each in last.items()})
        seen = np.full(self.num_envs, None, dtype=object)
        for env in np.flatnonzero(is_over):
            seen[env] = {name: each[env].copy() for name, each in self._seen.items()}
        mask = {"_final_obs": is_over.copy(), "_final_info": is_over.copy()}
        return {**left, "final_obs": seen, "final_info": final, **mask}

    def _show(self, group: _Group) -> None:
        """Take over what a group sees."""
        for name, each in group.team.observation.items():
            self._seen[name][group.envs] = each[group.rows]

    def _note(self, infos: Info, envs: Int[np.ndarray, "E"], values: dict[str, np.ndarray]) -> None:
        """Write what these environments say into `infos`, beside masks of who said it."""
        for name, each in values.items():
            if name not in infos:
                infos[name] = np.zeros(self.num_envs, dtype=each.dtype)
                infos[f"_{name}"] = np.zeros(self.num_envs, dtype=np.bool_)
            infos[name][envs], infos[f"_{name}"][envs] = each, True

    def _copied(self) -> Observation:
        return {name: each.copy() for name, each in self._seen.items()}


def _mode_of(mode: str | AutoresetMode) -> AutoresetMode:
    """What happens after a mission's last window; raises ValueError if it is no such thing."""
    modes = [each.value for each in AutoresetMode]
    if mode not in (*modes, *AutoresetMode):
        raise ValueError(
            f"autoreset_mode must be one of {', '.join(modes)}, not {mode!r:.80}"
            f"{did_you_mean(mode, modes)}"
        )
    return AutoresetMode(mode)
