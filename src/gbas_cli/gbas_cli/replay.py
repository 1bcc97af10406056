"""``gbas replay``: recorded inputs through running nodes again, and the outputs compared with the recorded ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gbas_bags import bags
from gbas_bags.compare import TopicComparison, compare
from gbas_bags.topic_names import is_observation
from gbas_bringup.environment import free_domain
from gbas_bringup.launcher import RunPlan
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance
from gbas_bringup.run_config import RunConfig, read_run_config
from gbas_bringup.runs import execute
from gbas_core.errors import BagError

CONFIGURATION_FOLDER = "configuration"


@dataclass(frozen=True, kw_only=True)
class ReplayRequest:
    """What to replay.

    Attributes
    ----------
    bag : Path
    out : Path
        Folder for the new bag.
    speed : float
        Multiple of real time, 0 for as fast as the nodes go.
    config : Path or None
        Configuration in place of the one stored in the bag.
    """

    bag: Path
    out: Path
    speed: float = 0.0
    config: Path | None = None
    single_process: bool = False
    domain: int | None = None
    verbose: bool = False
    quiet: bool = False
    command: str = ""


@dataclass(frozen=True, kw_only=True)
class ReplayResult:
    """What a replay gave."""

    bag: Path
    replayed: Path
    topics: tuple[TopicComparison, ...]

    @property
    def identical(self) -> bool:
        """Whether every recorded output came out again, bit for bit."""
        return bool(self.topics) and all(topic.same for topic in self.topics)

    @property
    def differs(self) -> bool:
        """Whether anything that can be compared did not come out again, or nothing can be compared."""
        compared = [topic for topic in self.topics if not topic.older]
        return not compared or not all(topic.same for topic in compared)

    def as_json(self) -> dict[str, Any]:
        """The result as JSON-able data."""
        return {
            "bag": str(self.bag),
            "replayed": str(self.replayed),
            "identical": self.identical,
            "topics": [
                {
                    "topic": topic.topic,
                    "name": topic.name,
                    "recorded": topic.recorded,
                    "identical": topic.identical,
                    "different": topic.different,
                    "missing": topic.missing,
                    "extra": topic.extra,
                    "older": topic.older or None,
                    "first_difference": topic.first_difference,
                }
                for topic in self.topics
            ],
        }


def replay(request: ReplayRequest) -> ReplayResult:
    """Start the nodes as they were, play the bag's inputs, record, and compare.

    Raises
    ------
    BagError
        When the bag is missing, damaged, or holds no configuration or no observations.
    GbasError
        When a node fails.
    """
    metadata, epochs = _survey(request.bag)
    config = _configuration(request, metadata)
    player = NodeInstance(kind=NODE_KINDS["player"])
    plan = RunPlan(
        config=config.with_nodes(driver=player),
        directory=request.out,
        speed=request.speed,
        single_process=request.single_process,
        domain=free_domain() if request.domain is None else request.domain,
        isolated=True,
        overrides={player.full_name: {"bag": str(request.bag)}, **_stored_files(config, request)},
        command=request.command,
    )
    execute(plan, title=f"replaying {request.bag}", verbose=request.verbose, quiet=request.quiet, total=epochs)
    topics = tuple(compare(request.bag, plan.bag_path))
    return ReplayResult(bag=request.bag, replayed=plan.bag_path, topics=topics)


def play(request: ReplayRequest) -> None:
    """Publish everything in a bag as it was recorded, without any node."""
    _, epochs = _survey(request.bag)
    player = NodeInstance(kind=NODE_KINDS["player"])
    request.out.mkdir(parents=True, exist_ok=True)
    path = request.out / "player.yaml"
    path.write_text("/**:\n  ros__parameters: {}\n", encoding="utf-8")
    alone = {"bag": str(request.bag), "mode": "all", "wait_for": [""], "wait_for_ground": [""]}
    plan = RunPlan(
        config=RunConfig(path=path, nodes=(player,), parameters={}),
        directory=request.out,
        speed=request.speed,
        domain=request.domain,
        overrides={player.full_name: alone},
    )
    execute(plan, title=f"playing {request.bag}", verbose=request.verbose, quiet=request.quiet, total=epochs)


def _survey(path: Path) -> tuple[dict[str, dict[str, str]], int]:
    """Metadata of a bag and the number of its epochs; a bag that is damaged is refused."""
    reader = bags.BagReader(path)
    keys: set[int] = set()
    for message in reader.messages():
        if is_observation(message.channel.topic):
            key = bags.epochs.epoch_of(message.channel.schema.name, message.data)
            keys.add(key or 0)
    return reader.metadata, len(keys)


def _configuration(request: ReplayRequest, metadata: dict[str, dict[str, str]]) -> RunConfig:
    if request.config is not None:
        return read_run_config(request.config)
    stored = bags.configuration_of(request.bag, metadata)
    folder = request.out / CONFIGURATION_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in stored.items():
        (folder / Path(name).name).write_text(text, encoding="utf-8")
    main = metadata.get(bags.SUITE_METADATA, {}).get(bags.MAIN_CONFIGURATION, next(iter(stored)))
    if main not in stored:
        raise BagError(request.bag, f"its configuration {main} is not stored in it; give one with --config")
    return read_run_config(folder / Path(main).name)


def _stored_files(config: RunConfig, request: ReplayRequest) -> dict[str, dict[str, Any]]:
    """Files that nodes read, as they were when the bag was recorded."""
    folder = request.out / CONFIGURATION_FOLDER
    copies = {name: folder / Path(file).name for name, file in config.files.items()}
    return {name: {"config": str(copy)} for name, copy in copies.items() if copy.is_file()}
