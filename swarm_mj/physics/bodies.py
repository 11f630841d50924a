"""Robots with bodies: B worlds of MuJoCo models, each steered by its pilot, one window a call.

The paper's equation gives no body its velocity, but the set point of its pilot, see `set_points`. A
body that flies and touches anything has crashed: its rotors idle, and its radio is off.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco import batch
from mujoco._enums import mjtDyn
from mujoco._structs import MjModel

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Started
from swarm_mj.mission.faults import MIN_SURVIVORS
from swarm_mj.mission.geometry import HEIGHT, PLANE, SPACE
from swarm_mj.physics.energy import Motors, motors_of, use_energy
from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.physics.pilots import GRAVITY_MPS2, Pilot, Sensed, SetPoint
from swarm_mj.physics.robot_model import (
    ABOUT_Z,
    ATTITUDE,
    FREE_QVEL,
    HEADING,
    LEVEL,
    PLACE,
    PLANAR_PLACE,
    REAL,
    TURN_RATE,
    VELOCITY,
    collides,
    is_motor,
)
from swarm_mj.physics.robots import (
    OwnPilot,
    RobotKind,
    kinds_of,
    make_pilots,
    sensor_limits,
)
from swarm_mj.physics.scene import AIR_DENSITY, Scene, compiled_scene, compose, num_body_steps
from swarm_mj.physics.set_points import hold_places, move_set_points
from swarm_mj.physics.state import RobotStates
from swarm_mj.physics.wind import Wind
from swarm_mj.physics.worlds import check_accelerations
from swarm_mj.system.compiled import compiled
from swarm_mj.system.user_code import is_ours

LAGS = [int(mjtDyn.mjDYN_FILTER), int(mjtDyn.mjDYN_FILTEREXACT)]  # a control, a while later
FARTHEST = 1e6  # no robot of a stable model gets so far [m], or so fast [m/s and rad/s]
# Of what has crashed [rad/s]: in a storm it tumbles, and Euler's steps would spin it up for ever.
MOST_TUMBLING_RPS = 100.0


class _Flown(NamedTuple):
    """The robots of a kind, and their part of MuJoCo's arrays: views, which steps change."""

    kind: RobotKind
    pilot: Pilot
    robots: slice  # their numbers
    qpos: Float[np.ndarray, "B n Q"]
    qvel: Float[np.ndarray, "B n V"]
    ctrl: Float[np.ndarray, "B n U"]
    contact_n: Float[np.ndarray, "B n V"]  # forces of contacts; about axes, Nm
    sensors: Float[np.ndarray, "B n S"]
    force_n: Float[np.ndarray, "B n U"]  # of motors; of those that turn, Nm
    speed_mps: Float[np.ndarray, "B n U"]  # of what they move; of what turns, rad/s
    wanted: SetPoint
    has_crashed: Bool[np.ndarray, "B n"]
    energy_j: Float[np.ndarray, "B n"]
    motors: Motors | None  # None: the model does not say what they use
    thrust_per_n: Float[np.ndarray, "U 3"]  # of each motor's force, by the robot's weight [1/N]
    is_trusted: bool  # the pilot is the package's own
    free: Sensed | None  # views of a free base's states; None: its base is on a plane


class BodyWorlds:
    """The `Worlds` of robots with bodies, D = 3.

    Their states also have attitudes, what sensors measured, who has crashed, and the energy that
    each robot has used [J].
    """

    def __init__(
        self,
        mission: Mission,
        num_missions: int,
        *,
        scene: Scene | None = None,
        pilot: OwnPilot | None = None,
        num_threads: int = 1,
    ) -> None:
        """Compile the scene and make B worlds.

        Args:
            mission: Of all worlds.
            num_missions: B.
            scene: A user's, which adds to the arena.
            pilot: A user's, or its name, which makes controls in place of a shipped one.
            num_threads: Of MuJoCo's own.

        Raises:
            ValueError: A robot's model, the pilot or the scene is refused.
            TypeError: The pilot is not called as one is.
        """
        self._mission = mission
        self._kinds = kinds = kinds_of(mission)
        self._model = compiled_scene(compose(mission, scene=scene), scene)
        if scene is not None:
            _check_bodies(self._model, kinds)
        found = obstacles_of(self._model)
        self.obstacles = found if len(found.kind) > 0 else None
        self._batch = batch.Batch(self._model, num_missions, num_threads)
        self._act = self._batch.bind("act")
        self._wind = Wind(mission, self._batch.expand("opt.wind")) if mission.has_wind else None
        self._num_steps = num_body_steps(mission, kinds)
        self._step_s = mission.window_s / self._num_steps
        pilots = make_pilots(kinds, self._step_s, pilot)
        shape = (num_missions, mission.num_robots)
        self._course_mps = np.zeros((*shape, 3))  # the set points of the paper's equation
        self._wanted_mps = np.zeros((*shape, 3))  # those of pilots, who also hold places
        self._place_m = np.zeros((*shape, PLANE))
        self._height_m = np.zeros(shape)
        self._has_crashed = np.zeros(shape, dtype=np.bool_)
        self._energy_j = np.zeros(shape)
        self.reach_m = np.concatenate([np.full(kind.num_robots, kind.reach_m) for kind in kinds])
        self._works: np.ndarray | None = None  # who was not made to fail
        self._flown = self._divide(kinds, pilots)
        self._num_sensed = len(sensor_limits(kinds))  # S
        self.states = RobotStates(
            position_m=np.zeros((*shape, 3)),
            velocity_mps=np.zeros((*shape, 3)),
            attitude=np.zeros((*shape, 4)),
        )

    def _divide(self, kinds: Sequence[RobotKind], pilots: Sequence[Pilot]) -> list[_Flown]:
        """Return each kind's part of the arrays, whose robots follow each other."""
        starts: dict[str, int] = {}

        def part(name: str, kind: RobotKind, width: int) -> Float[np.ndarray, "B n W"]:
            """Return the next robots' part of one of MuJoCo's arrays."""
            start = starts.get(name, 0)
            starts[name] = start + kind.num_robots * width
            array = self._batch.bind(name)[:, start : starts[name]]
            return array.reshape(len(array), kind.num_robots, width)

        found = []
        for kind, pilot in zip(kinds, pilots, strict=True):
            model = kind.model
            qpos = part("qpos", kind, model.nq)
            qvel = part("qvel", kind, model.nv)
            sensors = part("sensordata", kind, model.nsensordata)
            robots = slice(kind.first, kind.first + kind.num_robots)
            flown = _Flown(
                kind=kind,
                pilot=pilot,
                robots=robots,
                qpos=qpos,
                qvel=qvel,
                ctrl=part("ctrl", kind, model.nu),
                contact_n=part("qfrc_constraint", kind, model.nv),
                sensors=sensors,
                force_n=part("actuator_force", kind, model.nu),
                speed_mps=part("actuator_velocity", kind, model.nu),
                wanted=SetPoint(
                    velocity_mps=_seen(self._wanted_mps[:, robots]),
                    height_m=_seen(self._height_m[:, robots]),
                ),
                has_crashed=self._has_crashed[:, robots],
                energy_j=self._energy_j[:, robots],
                motors=motors_of(
                    np.linalg.norm(kind.thrust_axes, axis=1),
                    kind.declared,
                    self._step_s,
                    AIR_DENSITY,
                ),
                thrust_per_n=kind.thrust_axes / (kind.mass_kg * GRAVITY_MPS2),
                is_trusted=is_ours(pilot),
                free=_free_states(qpos, qvel, sensors) if kind.is_free else None,
            )
            found.append(flown)
        return found

    @property
    def pose(self) -> tuple[Float[np.ndarray, "B Q"], Float[np.ndarray, "B V"]]:
        """MuJoCo's coordinates of all worlds and their rates, as they are now."""
        return self._batch.bind("qpos"), self._batch.bind("qvel")

    def draw_heights_m(self, rng: np.random.Generator) -> Float[np.ndarray, "N"]:
        """Return where robots begin: those that fly in the mission's range, others on the floor."""
        mission = self._mission
        height_m = np.full(mission.num_robots, mission.height_m)
        if mission.height_range_m > 0.0:
            height_m += rng.uniform(0.0, mission.height_range_m, mission.num_robots)
        for flown in self._flown:
            if not flown.kind.is_free:
                height_m[flown.robots] = flown.kind.base_m
        return height_m

    def start(
        self,
        rngs: Sequence[np.random.Generator],
        pilot_rngs: Sequence[np.random.Generator],
    ) -> None:
        """Draw what is each mission's own: how robots differ, and gusts; start the pilots."""
        if self._mission.robot_spread > 0.0:
            self._vary(rngs)
        for flown in self._flown:
            if isinstance(flown.pilot, Started):
                flown.pilot.start(flown.kind.num_robots, pilot_rngs)
        if self._wind is not None:
            self._wind.start(rngs)

    def _vary(self, rngs: Sequence[np.random.Generator]) -> None:
        """Make each robot heavier or lighter, and its motors stronger or weaker, than its model.

        Both factors are normal around 1, cut off at three deviations.
        """
        model = self._model
        mass_kg = self._batch.expand("body_mass")
        inertia_kgm2 = self._batch.expand("body_inertia")
        gain = self._batch.expand("actuator_gainprm")
        spread = self._mission.robot_spread
        shape = (2, self._mission.num_robots)
        drawn = np.clip(np.stack([rng.normal(0.0, 1.0, shape) for rng in rngs]), -3.0, 3.0)
        heavier, stronger = np.moveaxis(1.0 + spread * drawn, 1, 0)
        # In a scene robots come first, one after the other.
        of_body = self._owners([kind.model.nbody - 1 for kind in self._kinds])
        of_actuator = self._owners([kind.model.nu for kind in self._kinds])
        bodies = slice(1, 1 + len(of_body))
        mass_kg[:, bodies] = model.body_mass[bodies] * heavier[:, of_body]
        inertia_kgm2[:, bodies] = model.body_inertia[bodies] * heavier[:, of_body, None]
        drives = is_motor(model)  # whose gain is their force
        own_gain = model.actuator_gainprm[drives]
        gain[:, drives] = own_gain * stronger[:, of_actuator[drives], None]
        self._batch.set_const()

    def _owners(self, numbers: Sequence[int]) -> Int[np.ndarray, "K"]:
        """Return the robot of each part, by how many a robot of each kind has."""
        by_robot = []
        for kind, number in zip(self._kinds, numbers, strict=True):
            by_robot += [number] * kind.num_robots
        return np.repeat(np.arange(len(by_robot)), by_robot)

    def place(
        self, position_m: Float[np.ndarray, "B N 3"], velocity_mps: Float[np.ndarray, "B N 3"]
    ) -> None:
        """Restart all worlds from p_0 [m] and v_0 [m/s], level, with rotors at their set points."""
        self._batch.reset()
        self._course_mps[:] = velocity_mps
        self._wanted_mps[:] = velocity_mps
        self._place_m[:] = position_m[..., :PLANE]
        self._height_m[:] = position_m[..., HEIGHT]
        self._has_crashed[:] = False
        self._works = None
        self.states = replace(self.states, is_active=None)
        for flown in self._flown:
            flown.energy_j[:] = np.nan if flown.motors is None else 0.0
            place_m = position_m[:, flown.robots]
            first_mps = velocity_mps[:, flown.robots]
            if flown.kind.is_free:
                flown.qpos[..., PLACE] = place_m
                flown.qpos[..., ATTITUDE] = LEVEL
                flown.qvel[..., VELOCITY] = first_mps
            else:
                flown.qpos[..., PLANAR_PLACE] = place_m[..., :PLANE]
                flown.qpos[..., HEADING] = np.arctan2(first_mps[..., 1], first_mps[..., 0])
                flown.qvel[..., PLANAR_PLACE] = first_mps[..., :PLANE]
        if self._num_sensed > 0:
            self._batch.forward()  # or pilots would begin with what sensors measured before
        self._steer()
        self._start_actuators()
        self._batch.forward()
        self._take_states()

    def _start_actuators(self) -> None:
        """Let what follows its control by a lag begin where the control is: rotors turn already."""
        model = self._model
        control = self._batch.bind("ctrl")
        for u in np.flatnonzero(np.isin(model.actuator_dyntype, LAGS)).tolist():
            begun = control[:, u]
            if model.actuator_ctrllimited[u]:
                begun = np.clip(begun, *model.actuator_ctrlrange[u])
            self._act[:, model.actuator_actadr[u]] = begun

    def deactivate(self, is_active: Bool[np.ndarray, "B N"]) -> None:
        """Make these the robots that work from now on; the others keep moving."""
        self._works = is_active
        self._count_active()

    def _count_active(self) -> None:
        """Take robots that crashed for failed; two stay on whatever happens.

        An age of information needs a pair. Those that fly come first, then those that are still on:
        of these the ones of least number, if several crash at once. What went off stays off.
        """
        if self._works is None and not np.any(self._has_crashed):
            return
        works = np.ones_like(self._has_crashed) if self._works is None else self._works
        is_active = works & ~self._has_crashed
        was_active = works if self.states.is_active is None else self.states.is_active
        for b in np.flatnonzero(np.sum(is_active, axis=1) < MIN_SURVIVORS).tolist():
            rank = np.where(is_active[b], 0, np.where(was_active[b], 1, 2))
            order = np.argsort(rank, kind="stable")
            chosen = [i for i in order.tolist() if works[b, i]][:MIN_SURVIVORS]
            is_active[b, chosen] = True
        self.states = replace(self.states, is_active=is_active)

    def step(self, acceleration_mps2: Float[np.ndarray, "B N 3"]) -> RobotStates:
        """Move all robots one window on; ValueError for a wrong u or a model that is unstable."""
        check_accelerations(acceleration_mps2, self.states.position_m.shape)
        mission = self._mission
        move_set_points(
            acceleration=acceleration_mps2,
            position=self.states.position_m,
            dt_s=mission.window_s,
            limit_mps2=mission.max_acceleration_mps2,
            limit_mps=mission.max_velocity_mps,
            wall_m=mission.half_side_m if mission.has_walls else np.inf,
            course_mps=self._course_mps,
            height_m=self._height_m,
        )
        hold_places(
            position=self.states.position_m,
            course_mps=self._course_mps,
            dt_s=mission.window_s,
            limit_mps=mission.max_velocity_mps,
            place_m=self._place_m,
            wanted_mps=self._wanted_mps,
        )
        for _ in range(self._num_steps):
            self._steer()
            self._batch.step()
            for flown in self._flown:
                _check_stable(flown)  # before the next step: MuJoCo dies of what is no number
                if flown.motors is not None:
                    use_energy(
                        flown.motors,
                        flown.force_n,
                        flown.speed_mps,
                        flown.has_crashed,
                        flown.energy_j,
                    )
                if flown.kind.is_free:
                    _note_contacts(flown.contact_n, flown.has_crashed)
                    _slow_tumbling(flown.has_crashed, flown.qvel)
        self._take_states()
        if self._wind is not None:
            self._wind.change()
        self._count_active()
        return self.states

    def _steer(self) -> None:
        """Let the pilots write all controls; those of robots that crashed are 0."""
        for flown in self._flown:
            answer: object = flown.pilot(_sensed(flown), flown.wanted, flown.ctrl)
            if not flown.is_trusted:
                _check_written(flown, answer)
            _stop(flown.has_crashed, flown.ctrl)

    def _take_states(self) -> None:
        """Copy where robots are, in arrays that later steps do not change."""
        states = self.states
        position_m = np.empty_like(states.position_m)
        velocity_mps = np.empty_like(position_m)
        shape = position_m.shape[:2]
        attitude = np.empty((*shape, 4))
        # A robot with fewer sensors than others has zeros behind its own.
        sensors = np.zeros((*shape, self._num_sensed)) if self._num_sensed > 0 else None
        thrust = np.empty((*shape, 3))
        for flown in self._flown:
            sensed = _sensed(flown)
            thrust[:, flown.robots] = flown.force_n @ flown.thrust_per_n
            if sensors is not None:
                sensors[:, flown.robots, : sensed.sensors.shape[2]] = sensed.sensors
            position_m[:, flown.robots] = sensed.position_m
            velocity_mps[:, flown.robots] = sensed.velocity_mps
            attitude[:, flown.robots] = sensed.attitude
        self.states = replace(
            states,
            position_m=position_m,
            velocity_mps=velocity_mps,
            attitude=attitude,
            has_crashed=self._has_crashed.copy(),
            sensors=sensors,
            thrust=thrust,
            wind_mps=None if self._wind is None else self._wind.now_mps,
            energy_j=self._energy_j.copy(),
        )


def _check_written(flown: _Flown, answer: object) -> None:
    """Raise TypeError or ValueError for a user's pilot that did not write its controls."""
    name = flown.kind.name
    if answer is not None:
        raise TypeError(
            f"the pilot of {name} must write its controls into `control`, and return nothing"
        )
    is_wrong = ~np.isfinite(flown.ctrl)
    if np.any(is_wrong):
        b, i, u = np.argwhere(is_wrong)[0]
        control = flown.kind.model.actuator(u).name or f"number {u}"
        raise ValueError(
            f"the pilot of {name} must write finite controls, not {flown.ctrl[b, i, u]:g}, which "
            f"robot {flown.kind.first + i} has for {control}"
        )


def _check_stable(flown: _Flown) -> None:
    """Raise ValueError if a robot of this kind is nowhere."""
    b, i = _lost_robot(flown.qpos, flown.qvel)
    if b >= 0:
        raise ValueError(
            f"robot {flown.kind.first + i} of mission {b} is nowhere: its model is not stable "
            "under its pilot; choose lower gains, or a shorter timestep in its file"
        )


def _check_bodies(model: MjModel, kinds: Sequence[RobotKind]) -> None:
    """Raise ValueError if a scene made robots heavier or lighter, tied them, or let them pass."""
    mass_kg: list[float] = []
    num_colliding = 0
    for kind in kinds:
        mass_kg += kind.model.body_mass[1:].tolist() * kind.num_robots
        num_colliding += kind.num_robots * int(np.sum(collides(kind.model)))
    last = len(mass_kg)
    is_of_robots = (model.geom_bodyid > 0) & (model.geom_bodyid <= last)
    is_tied = model.neq + model.ntendon > 0
    is_other = not np.allclose(model.body_mass[1 : last + 1], mass_kg)
    if is_tied or is_other or np.sum(collides(model) & is_of_robots) != num_colliding:
        raise ValueError(
            "a scene must leave the robots, but changed their mass or what collides of them, or "
            "tied them; add static geoms to the world instead"
        )


def _seen(array: np.ndarray) -> np.ndarray:
    """Return a view that cannot be written: pilots read what MuJoCo and the set points are."""
    view = array[:]
    view.flags.writeable = False
    return view


def _free_states(
    qpos: Float[np.ndarray, "B n Q"],
    qvel: Float[np.ndarray, "B n V"],
    sensors: Float[np.ndarray, "B n S"],
) -> Sensed:
    """Return views of the states of free bases, made once: they follow MuJoCo's steps."""
    return Sensed(
        position_m=_seen(qpos[..., PLACE]),
        attitude=_seen(qpos[..., ATTITUDE]),
        velocity_mps=_seen(qvel[..., VELOCITY]),
        turn_rate_rps=_seen(qvel[..., TURN_RATE]),
        sensors=sensors,
    )


def _sensed(flown: _Flown) -> Sensed:
    """Return the states of a kind's robots."""
    if flown.free is not None:
        return flown.free
    qpos = flown.qpos
    qvel = flown.qvel
    shape = qpos.shape[:2]
    position_m = np.empty((*shape, SPACE))
    velocity_mps = np.zeros((*shape, SPACE))
    attitude = np.zeros((*shape, 4))
    turn_rate_rps = np.zeros((*shape, SPACE))
    position_m[..., :PLANE] = qpos[..., PLANAR_PLACE]
    position_m[..., HEIGHT] = flown.kind.base_m
    velocity_mps[..., :PLANE] = qvel[..., PLANAR_PLACE]
    half = 0.5 * qpos[..., HEADING]
    attitude[..., REAL] = np.cos(half)
    attitude[..., ABOUT_Z] = np.sin(half)
    turn_rate_rps[..., HEIGHT] = qvel[..., HEADING]  # about the vertical
    return Sensed(position_m, attitude, velocity_mps, turn_rate_rps, flown.sensors)


@compiled(makes_arrays=False)
def _note_contacts(
    contact_n: Float[np.ndarray, "B n V"], has_crashed: Bool[np.ndarray, "B n"]
) -> None:
    """Note whom contacts push at all: MuJoCo's constraints act on nothing else here."""
    for b in range(contact_n.shape[0]):
        for i in range(contact_n.shape[1]):
            if contact_n[b, i, 0] != 0.0 or contact_n[b, i, 1] != 0.0 or contact_n[b, i, 2] != 0.0:
                has_crashed[b, i] = True


@compiled(makes_arrays=False)
def _slow_tumbling(has_crashed: Bool[np.ndarray, "B n"], qvel: Float[np.ndarray, "B n V"]) -> None:
    """Limit how fast what has crashed turns."""
    for b in range(qvel.shape[0]):
        for i in range(qvel.shape[1]):
            if has_crashed[b, i]:
                for axis in range(SPACE, FREE_QVEL):
                    rate = qvel[b, i, axis]
                    qvel[b, i, axis] = min(max(rate, -MOST_TUMBLING_RPS), MOST_TUMBLING_RPS)


@compiled(makes_arrays=False)
def _lost_robot(
    qpos: Float[np.ndarray, "B n Q"], qvel: Float[np.ndarray, "B n V"]
) -> tuple[int, int]:
    """Return the mission and number of a robot that is too far or too fast, or -1 twice."""
    for b in range(qpos.shape[0]):
        for i in range(qpos.shape[1]):
            for number in qpos[b, i]:
                if not abs(number) < FARTHEST:  # nor is what is no number
                    return b, i
            for number in qvel[b, i]:
                if not abs(number) < FARTHEST:
                    return b, i
    return -1, -1


@compiled(makes_arrays=False)
def _stop(has_crashed: Bool[np.ndarray, "B n"], control: Float[np.ndarray, "B n U"]) -> None:
    for b in range(control.shape[0]):
        for i in range(control.shape[1]):
            if has_crashed[b, i]:
                control[b, i] = 0.0
