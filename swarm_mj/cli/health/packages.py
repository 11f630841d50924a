"""What is installed, against what `pyproject.toml` asks for."""

import platform
from collections.abc import Iterator
from importlib import metadata

from packaging.requirements import Requirement

from swarm_mj.cli.health.finding import Finding
from swarm_mj.system.packages import CORE
from swarm_mj.system.provenance import commit, version

PACKAGE = "swarm_mj"
PURPOSES = {  # of what flying itself does without
    "av": "videos of replays",
    "dm-control": "the dm_control environment",
    "dm-env": "the dm_control environment",
    "gymnasium": "Gymnasium environments, training",
    "matplotlib": "figures",
    "pandas": "data frames of results",
    "pillow": "pictures of replays",
    "pyarrow": "replays",
    "rerun-sdk": "replays and their viewer",
    "safetensors": "learned policies",
    "scipy": "intervals of evaluations",
    "stable-baselines3": "training",
    "tensorboard": "curves of trainings",
    "torch": "learned policies, training",
}
EXTRAS = {
    "pettingzoo": "PettingZoo environments",
    "docs": "building the documentation",
    "dev": "tests, formatter, type checker",
}


def about() -> Iterator[Finding]:
    """Which swarm_mj this is, and on what it runs."""
    group = "swarm_mj"
    at = commit()
    yield Finding(group, "version", "ok", version() + (f", commit {at}" if at else ""))
    yield Finding(group, "Python", "ok", f"{platform.python_version()} on {platform.platform()}")


def packages() -> Iterator[Finding]:
    """Each package that an installation brings, then each extra as a whole."""
    requirements = [Requirement(text) for text in metadata.requires(PACKAGE) or ()]
    for each in requirements:
        if each.marker is None or each.marker.evaluate({"extra": ""}):
            yield _package(each)
    for extra in metadata.metadata(PACKAGE).get_all("Provides-Extra") or ():
        yield _extra(extra, requirements)


def _package(requirement: Requirement) -> Finding:
    name = requirement.name
    purpose = "flying" if name in CORE else PURPOSES.get(name, "parts of swarm_mj")
    installed = _installed(name)
    if installed and requirement.specifier.contains(installed, prereleases=True):
        return Finding("packages", name, "ok", installed)
    found = f"{installed}, which is not {requirement.specifier}" if installed else "not installed"
    state = "broken" if name in CORE else "absent"
    mend = f"pip install '{name}{requirement.specifier}'"
    return Finding("packages", name, state, f"{found}; for {purpose}", mend)


def _extra(extra: str, requirements: list[Requirement]) -> Finding:
    of_extra = [
        each
        for each in requirements
        if each.marker is not None
        and each.marker.evaluate({"extra": extra})
        and not each.marker.evaluate({"extra": ""})
    ]
    missing = [each.name for each in of_extra if each.name != PACKAGE and not _fits(each)]
    name, purpose = f"extra {extra}", EXTRAS.get(extra, "more")
    if not missing:
        return Finding("packages", name, "ok", f"installed; for {purpose}")
    found = f"lacks {', '.join(missing)}; for {purpose}"
    return Finding("packages", name, "absent", found, f"pip install '{PACKAGE}[{extra}]'")


def _fits(requirement: Requirement) -> bool:
    installed = _installed(requirement.name)
    return bool(installed) and requirement.specifier.contains(installed or "", prereleases=True)


def _installed(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
