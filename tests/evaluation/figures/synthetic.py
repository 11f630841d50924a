"""Small results, made up."""

import json
from dataclasses import asdict, fields, replace

from swarm_mj.evaluation.results import Result
from swarm_mj.mission import PAPERS

SAID = {"version": "1.2.3", "commit": "abc123", "baseline": "tdma", "episodes": 4, "seed": 50}


def result(policy, task="stationary", preset="reference", config=None, **overrides):
    """One row: `overrides` are fields of the mission, or of the result."""
    names = {field.name for field in fields(Result)}
    mission = asdict(PAPERS[preset](task))
    mission |= {name: value for name, value in overrides.items() if name in mission}
    empty = {field.name: 1.0 if field.type is float else None for field in fields(Result)}
    row = empty | {name: value for name, value in mission.items() if name in names}
    row |= {"policy": policy, "config": json.dumps(mission | (config or {}))} | SAID
    return Result(**row | {name: value for name, value in overrides.items() if name in names})


def sweep(policy, x_name, values, task="stationary", **overrides):
    """A curve: AoI and its error by x."""
    return [
        result(policy, task, aoi_mean=mean, aoi_sem=sem, **({x_name: x} | overrides))
        for x, (mean, sem) in values.items()
    ]


def everything(preset="reference"):
    """A point or two in each result figure."""
    return [
        result("mst", preset=preset, aoi_mean=40.0, aoi_sem=1.0),
        result("mst", preset=preset, aoi_mean=15.0, aoi_sem=0.5, range_ratio=0.5),
        result("tdma", preset=preset, aoi_mean=26.0, aoi_sem=0.25),
        result("tdma", "random-walk", preset, aoi_mean=12.0, aoi_sem=0.3, num_robots=20),
        result(
            "greedy-oracle",
            "flocking",
            preset,
            aoi_mean=12.0,
            aoi_sem=0.5,
            velocity_variance_mean=0.1,
            velocity_variance_sem=0.01,
        ),
    ]


def altered(results, **overrides):
    """The same results, with other values in the last."""
    return [*results[:-1], replace(results[-1], **overrides)]
