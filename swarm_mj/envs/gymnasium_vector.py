"""Gymnasium's vector interface: B missions in as few swarms as can be.

Missions that begin together are one batch, played as one swarm. A mission that begins alone, by
`reset_mask`, leaves its batch for a new one; its row in the old batch flies on, silent and unseen.
"""

from collections.abc import Sequence
from numbers import Number
from typing import Any, Unpack, cast

import numpy as np
from gymnasium.utils import EzPickle, seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from jaxtyping import Int, UInt8

from swarm_mj.envs.gymnasium import Screen, rendering
from swarm_mj.envs.mission_batch import Info, MissionBatch, Observation, seed_or_next, seeds_from
from swarm_mj.envs.options import BatchOptions, make_team_batch, team_spaces
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.feature_sets import is_own_set
from swarm_mj.protocol.checks import as_array, checked_robots
from swarm_mj.system.arguments import check_names

MODES = ("rgb_array",)  # a window on the screen would show one mission of many


class SwarmVectorEnv(VectorEnv[Observation, np.ndarray, np.ndarray], EzPickle):
    """B missions; each environment is as `SwarmEnv`, and sees the same missions by the same seeds.

    `metadata["autoreset_mode"]` says what happens after a mission's last window. `reset` takes
    `options={"reset_mask": mask}`, which begins the missions where the mask is True.
    """

    metadata: dict[str, Any] = rendering(Mission(), MODES)

    def __init__(
        self,
        num_envs: int = 1,
        mission: Mission | str = "flocking",
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Unpack[BatchOptions],
    ) -> None:
        """Take B, a mission or its task, and options of `make_batch`; raises as that does."""
        modes = {"autoreset_mode": autoreset_mode, "render_mode": render_mode}
        EzPickle.__init__(self, num_envs, mission, **modes, **options)
        batch = make_team_batch(mission, num_envs, **options)
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)  # TorchRL looks for it here
        self._screen = Screen(render_mode, MODES)
        self.render_mode = render_mode
        self._mission = mission
        self._options = options
        self.metadata = rendering(batch.mission, MODES) | {"autoreset_mode": self.autoreset_mode}
        # Of each environment: the batch that flies it, and its row there.
        self._batches = np.full(num_envs, batch, dtype=object)
        self._num_robots = batch.mission.num_robots
        self._rows = np.arange(num_envs)
        self._flies_as_one = True  # in one batch, row by row, as long as none began alone
        self._is_over = np.zeros(num_envs, dtype=np.bool_)
        self._rngs = [seeding.np_random()[0] for _ in range(num_envs)]  # that draw later seeds
        self.single_observation_space, self.single_action_space = team_spaces(batch)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._seen: Any = create_empty_array(self.single_observation_space, num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Begin missions, all or those of `options["reset_mask"]`.

        Args:
            seed: One for each environment, [B], where None draws that environment's mission from
                its last seed; or the first one's, which the others count on from; or None, which
                draws all of them.
            options: `{"reset_mask": mask}` with one bool for each environment, [B], at least one of
                them True; None begins all missions.

        Returns:
            The observations of all environments, [B, ...] each, and the infos of the missions that
            began: [B] each, next to a mask of the same name with a leading underscore.

        Raises:
            ValueError: Unless there is one seed and one bool per environment, or if no connected
                team could be drawn.
            TypeError: If there is no such option.
            gymnasium.error.Error: If a seed is not an integer of 0 or more.

        Example:
            >>> seen, infos = SwarmVectorEnv(4, "flocking").reset(seed=1)  # seeds 1 to 4
        """
        check_names("reset", options or {}, ("reset_mask",))
        super().reset(seed=seed if isinstance(seed, int) else None)
        mask = np.asarray((options or {}).get("reset_mask", [True] * self.num_envs))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(
                f"reset_mask must be {self.num_envs} bools, one an environment and not all False, "
                f"not {mask!r}"
            )
        is_first = seed is None or isinstance(seed, Number)
        seeds: Any = seeds_from(cast("int | None", seed), self.num_envs) if is_first else seed
        if len(seeds) != self.num_envs:
            raise ValueError(
                f"seed must be one number, or {self.num_envs}, one an environment, not {seed!r}"
            )
        infos: Info = {}
        envs = np.flatnonzero(mask)
        self._begin(envs, [seeds[env] for env in envs.tolist()], infos)
        return self._shown(), infos

    def step(
        self, actions: np.ndarray
    ) -> tuple[Observation, np.ndarray, np.ndarray, np.ndarray, Info]:
        """Fly one window of each mission that is not over.

        What follows a mission's last window depends on the autoreset mode. In NEXT_STEP the next
        step begins another mission, ignores the actions of that environment, and pays it 0. In
        SAME_STEP another one begins at once, and the infos have `final_obs` and `final_info`. In
        DISABLED `reset` begins it.

        Args:
            actions: The recipient of each robot, [B N] integers from 0 to N - 1; itself is silence.

        Returns:
            The observations, [B, ...] each; the rewards [B], each minus the cost that the option
            `reward` names, in its unit; all False [B], as no mission terminates; which missions had
            their last window (truncated) [B]; and the infos, [B] each, next to masks of whose they
            are.

        Raises:
            ValueError: If the actions are not one integer from 0 to N - 1 per robot, if no mission
                has begun, if one is over in the mode DISABLED, or if no connected team could be
                drawn.
        """
        actions = self._checked(actions)
        reward = np.zeros(self.num_envs)
        infos: Info = {}
        final_infos: Info = {}  # of missions that end in this step, and begin anew in it
        was_over = self._is_over.copy()  # in the mode NEXT_STEP; they begin in this step
        is_same_step = self.autoreset_mode == AutoresetMode.SAME_STEP
        for batch in dict.fromkeys(self._batches[~was_over]):
            if self._flies_as_one:
                reward[:] = batch.step(actions)[:, 0]
                self._is_over[:] = batch.is_over
            else:
                envs = np.flatnonzero(self._batches == batch)
                rows = self._rows[envs]
                recipient = batch.flown.views.silence.copy()
                recipient[rows] = actions[envs]
                reward[envs] = batch.step(recipient)[rows, 0]
                self._is_over[envs] = batch.is_over
            self._note(final_infos if batch.is_over and is_same_step else infos, batch)
        ends = self._is_over & ~was_over
        if final_infos:
            last_seen = np.full(self.num_envs, None, dtype=object)
            for env in np.flatnonzero(ends):
                last_seen[env] = {name: each[env].copy() for name, each in self._seen.items()}
            infos |= {"final_obs": last_seen, "_final_obs": ends.copy()}
            infos |= {"final_info": final_infos, "_final_info": ends.copy()}
        begun = np.flatnonzero(ends if is_same_step else was_over)
        if begun.size:
            self._begin(begun, [None] * begun.size, infos)
        return self._shown(), reward, np.zeros_like(ends), ends, infos

    def render(self) -> tuple[UInt8[np.ndarray, "H W 3"], ...] | None:
        """Draw all missions, in the mode "rgb_array"; raises OSError without OpenGL."""
        if self.render_mode is None:
            return None
        pictures: list[np.ndarray] = []
        for batch, row in zip(self._batches, self._rows.tolist(), strict=True):
            picture = self._screen.picture(batch, row)
            if picture is not None:
                pictures.append(picture)
        return tuple(pictures)

    def close_extras(self, **_: Any) -> None:
        """Give back what pictures took."""
        self._screen.close()

    def _checked(self, actions: np.ndarray) -> Int[np.ndarray, "B N"]:
        """Return the actions; raise ValueError for any that is no robot, before a batch moves."""
        if self._is_over.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            raise ValueError(
                f"environment {np.argmax(self._is_over)} is over; begin it anew by reset(options="
                '{"reset_mask": mask})'
            )
        given = as_array("actions", actions).copy()
        shape = (self.num_envs, self._num_robots)
        if given.shape != shape:
            raise ValueError(
                f"actions must have shape {shape}, environments by robots, not {given.shape}"
            )
        given[self._is_over] = 0  # whatever they are: these missions begin anew in this step
        return checked_robots("action", given, shape)

    def _begin(self, envs: Int[np.ndarray, "E"], seeds: Sequence[int | None], infos: Info) -> None:
        """Begin these environments' missions in a batch of their own; note their infos."""
        begun = []
        for env, seed in zip(envs.tolist(), seeds, strict=True):
            if seed is not None:
                self._rngs[env], _ = seeding.np_random(seed)
            begun.append(seed_or_next(seed, self._rngs[env]))
        batch = cast("MissionBatch", self._batches[envs[0]])
        envs_of_batch = np.flatnonzero(self._batches == batch)
        if batch.num_missions != envs.size or not np.array_equal(envs_of_batch, envs):
            batch = make_team_batch(self._mission, envs.size, **self._options)
        batch.restart(begun)  # in the swarm that flew exactly these, if there is one
        self._batches[envs] = batch
        self._rows[envs] = np.arange(envs.size)
        self._flies_as_one = envs.size == self.num_envs
        self._is_over[envs] = False
        self._note(infos, batch)

    def _note(self, infos: Info, batch: MissionBatch) -> None:
        """Keep what a batch shows, and write its infos next to masks of whose they are."""
        if self._flies_as_one:
            # By reference: picking rows copies every number, twice.
            self._seen.update(batch.observation)
            for name, each in batch.infos().items():
                infos[name] = each.copy()
                infos[f"_{name}"] = np.ones(self.num_envs, dtype=np.bool_)
            return
        envs = np.flatnonzero(self._batches == batch)
        rows = self._rows[envs]
        for name, each in batch.observation.items():
            # In a copy: what was shown before is the user's own.
            self._seen[name] = self._seen[name].copy()
            self._seen[name][envs] = each[rows]
        for name, each in batch.infos().items():
            own = infos.setdefault(name, np.zeros(self.num_envs, dtype=each.dtype))
            is_own = infos.setdefault(f"_{name}", np.zeros(self.num_envs, dtype=np.bool_))
            own[envs] = each[rows]
            is_own[envs] = True

    def _shown(self) -> Observation:
        """Return the user's own arrays: new ones, or copies of what `reset_mask` shows again."""
        is_shown_again = self.autoreset_mode == AutoresetMode.DISABLED
        # A user's own features may write into the same array again.
        copies = is_shown_again or is_own_set(self._options.get("features", ""))
        return {name: each.copy() if copies else each for name, each in self._seen.items()}
