"""Types of the module; its docstrings say what each item does."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Error", "FileError", "Interrupted", "Mesh", "Network", "Octree", "OctreeLevel", "Online", "Outcome",
    "Prediction", "Sample", "SetupsOutcome", "Sites", "Tool", "ToolAnswers", "ToolsOutcome", "Trainer",
    "__version__", "analyze", "compare", "explain", "online", "read_tools", "sample", "setups",
]

__version__: str

_Path: TypeAlias = str | os.PathLike[str]
_Unit: TypeAlias = Literal["mm", "cm", "m", "in"]
_Progress: TypeAlias = Callable[[str, int, int], bool | None]

class _HasFaces(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

class Error(ValueError):
    kind: str

class FileError(Error, OSError): ...
class Interrupted(Error): ...

@final
class Mesh:
    def __new__(
        cls,
        vertices: ArrayLike | _HasFaces,
        triangles: ArrayLike | None = None,
        *,
        name: str = "part",
        unit: _Unit = "mm",
        weld: float = 1e-6,
        repair: bool = False,
        force: bool = False,
    ) -> Mesh: ...
    @staticmethod
    def read(
        path: _Path, unit: _Unit | None = None, *, weld: float = 1e-6, repair: bool = False, force: bool = False,
    ) -> Mesh: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def triangles(self) -> NDArray[np.uint32]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def name(self) -> str: ...
    @property
    def area_mm2(self) -> float: ...
    @property
    def volume_mm3(self) -> float: ...
    @property
    def bounds_mm(self) -> tuple[list[float], list[float]]: ...
    @property
    def origin_mm(self) -> list[float] | None: ...
    @property
    def notices(self) -> list[str]: ...

@final
class Sites:
    def __new__(cls, points: ArrayLike, normals: ArrayLike) -> Sites: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def faces(self) -> NDArray[np.uint32] | None: ...
    def __len__(self) -> int: ...

@final
class Tool:
    def __new__(
        cls,
        lengths: str | ArrayLike | None = None,
        *,
        cr: float | None = None,
        ch: float | None = None,
        fr: float | None = None,
        fh: float | None = None,
        kind: Literal["ball", "flat"] = "ball",
        corner: float | None = None,
        clearance: float = 0.0,
        allowance: float = 0.0,
        name: str | None = None,
    ) -> Tool: ...
    @property
    def name(self) -> str: ...
    @property
    def lengths_mm(self) -> tuple[float, float, float, float]: ...
    @property
    def corner_mm(self) -> float: ...
    @property
    def clearance_mm(self) -> float: ...
    @property
    def stick_out_mm(self) -> float: ...
    @property
    def words(self) -> str: ...

_Part: TypeAlias = Mesh | _HasFaces
_Tools: TypeAlias = Tool | str | Iterable[Tool | str]
_Directions: TypeAlias = int | str | Sequence[Sequence[float]] | NDArray[Any]

def read_tools(
    path: _Path,
    *,
    stick_out: float | None = None,
    holder: _Path | None = None,
    shank: float | None = None,
    flutes: float | None = None,
    unit: _Unit | None = None,
    strict: bool = False,
) -> tuple[list[Tool], list[str]]: ...
def sample(
    mesh: _Part, *, sites: int | Literal["vertices"] = 7000, seed: int = 0, smooth: float | None = None,
) -> Sites: ...
def analyze(
    part: _Part | Sites,
    tools: _Tools,
    *,
    directions: _Directions | None = None,
    sites: int | Literal["vertices"] = 7000,
    seed: int = 0,
    smooth: float | None = None,
    occlusion: bool = False,
    occlusion_share: float = 0.1,
    obstacles: str | None = None,
    fixtures: Iterable[_Part] = (),
    table: float | None = None,
    tolerance: float | None = None,
    finish: float | None = None,
    allowance: float = 0.0,
    search: int | None = None,
    prove: bool = False,
    clearance_limit: float | None = None,
    name: str | None = None,
    progress: _Progress | None = None,
) -> Outcome: ...
def setups(
    part: _Part,
    tools: _Tools,
    machine: str,
    *,
    share: float = 0.99,
    at_most: int | None = None,
    clampings: Literal["standing", "flat", "box", "any"] | None = None,
    directions: int | None = None,
    given: str | Sequence[str] | ArrayLike = (),
    sites: int | Literal["vertices"] = 7000,
    seed: int = 0,
    smooth: float | None = None,
    tolerance: float | None = None,
    finish: float | None = None,
    allowance: float = 0.0,
    name: str | None = None,
    progress: _Progress | None = None,
) -> SetupsOutcome: ...
def compare(
    part: _Part,
    tools: _Tools,
    *,
    share: float = 0.95,
    directions: _Directions | None = None,
    sites: int | Literal["vertices"] = 7000,
    seed: int = 0,
    smooth: float | None = None,
    fixtures: Iterable[_Part] = (),
    table: float | None = None,
    tolerance: float | None = None,
    finish: float | None = None,
    allowance: float = 0.0,
    search: int | None = None,
    prove: bool = False,
    name: str | None = None,
    progress: _Progress | None = None,
) -> ToolsOutcome: ...
def explain(
    result: Outcome | _Path, site: int | None = None, *, at: ArrayLike | None = None, tool: int | str | None = None,
) -> dict[str, Any]: ...

@final
class Outcome:
    def __len__(self) -> int: ...
    def __getitem__(self, key: int | str, /) -> ToolAnswers: ...
    def __iter__(self) -> Iterator[ToolAnswers]: ...
    @property
    def part(self) -> str: ...
    @property
    def definition(self) -> Literal["mesh", "published"]: ...
    @property
    def tools(self) -> list[Tool]: ...
    @property
    def sites(self) -> Sites: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def faces(self) -> NDArray[np.uint32] | None: ...
    @property
    def directions(self) -> NDArray[np.float32]: ...
    @property
    def area_shares(self) -> NDArray[np.float64]: ...
    @property
    def surface_mm2(self) -> float | None: ...
    @property
    def findings(self) -> list[dict[str, Any]]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def notices(self) -> list[str]: ...
    @property
    def seconds(self) -> tuple[float, float, float]: ...
    def save(
        self,
        folder: _Path,
        *,
        report: bool = False,
        pictures: bool = True,
        also: str | Sequence[str] = (),
        unit: _Unit = "mm",
        progress: _Progress | None = None,
    ) -> list[Path]: ...
    def report(self, path: _Path, *, unit: _Unit = "mm") -> Path: ...
    def explain(
        self, site: int | None = None, *, at: ArrayLike | None = None, tool: int | str | None = None,
    ) -> dict[str, Any]: ...

@final
class ToolAnswers:
    def __len__(self) -> int: ...
    @property
    def tool(self) -> Tool: ...
    @property
    def inaccessible(self) -> NDArray[np.bool_]: ...
    @property
    def tip_does_not_fit(self) -> NDArray[np.bool_] | None: ...
    @property
    def accessible(self) -> NDArray[np.bool_]: ...
    @property
    def occlusion(self) -> NDArray[np.bool_] | None: ...
    @property
    def accessible_directions(self) -> NDArray[np.uint32] | None: ...
    @property
    def accessible_share(self) -> NDArray[np.float32] | None: ...
    @property
    def witness(self) -> NDArray[np.float32]: ...
    @property
    def tip_mm(self) -> NDArray[np.float64] | None: ...
    @property
    def clearance_mm(self) -> NDArray[np.float32] | None: ...
    @property
    def tolerance_mm(self) -> NDArray[np.float64] | None: ...
    @property
    def open_directions(self) -> NDArray[np.float32] | None: ...
    @property
    def finding_of_site(self) -> NDArray[np.uint32]: ...
    @property
    def findings(self) -> list[dict[str, Any]]: ...
    @property
    def warnings(self) -> list[str]: ...

@final
class SetupsOutcome:
    def __len__(self) -> int: ...
    @property
    def setups(self) -> list[dict[str, Any]]: ...
    @property
    def first(self) -> NDArray[np.int64]: ...
    @property
    def can_be_reached(self) -> NDArray[np.bool_]: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def reached_share(self) -> float: ...
    @property
    def reachable_share(self) -> float: ...
    @property
    def at_least(self) -> int: ...
    @property
    def premise(self) -> str: ...
    @property
    def findings(self) -> list[dict[str, Any]]: ...
    @property
    def notices(self) -> list[str]: ...
    def save(
        self,
        folder: _Path,
        *,
        report: bool = False,
        pictures: bool = True,
        unit: _Unit = "mm",
        progress: _Progress | None = None,
    ) -> list[Path]: ...

@final
class ToolsOutcome:
    def __len__(self) -> int: ...
    @property
    def tools(self) -> list[Tool]: ...
    @property
    def table(self) -> list[dict[str, Any]]: ...
    @property
    def fewest(self) -> list[dict[str, Any]]: ...
    @property
    def accessible(self) -> NDArray[np.bool_]: ...
    @property
    def least_stick_out_mm(self) -> NDArray[np.float64]: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def unreached_share(self) -> float: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def notices(self) -> list[str]: ...
    def save(
        self, folder: _Path, *, pictures: bool = True, unit: _Unit = "mm", progress: _Progress | None = None,
    ) -> list[Path]: ...

@final
class Network:
    @staticmethod
    def shipped() -> Network: ...
    @staticmethod
    def read(path: _Path) -> Network: ...
    def save(self, path: _Path) -> Path: ...
    @property
    def definition(self) -> Literal["mesh", "published"] | None: ...
    def predict(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        cutter: Tool | str | ArrayLike,
        *,
        out_of_domain: bool = False,
        occlusion_share: float | None = None,
    ) -> Prediction: ...

@final
class Prediction:
    def __len__(self) -> int: ...
    @property
    def inaccessible(self) -> NDArray[np.bool_]: ...
    @property
    def occlusion(self) -> NDArray[np.bool_]: ...
    @property
    def probability_inaccessible(self) -> NDArray[np.float32]: ...
    @property
    def probability_occlusion(self) -> NDArray[np.float32]: ...
    @property
    def accessible_share(self) -> NDArray[np.float32] | None: ...
    @property
    def logits_inaccessible(self) -> NDArray[np.float32]: ...
    @property
    def logits_occlusion(self) -> NDArray[np.float32]: ...
    @property
    def coarse_answers(self) -> NDArray[np.float32] | None: ...
    @property
    def outside_domain(self) -> list[str]: ...

def online(
    parts: Iterable[_Part | Sites],
    cutters: Literal["uniform", "short", "long", "extreme"] = "uniform",
    *,
    seed: int = 0,
    epochs: int | None = None,
    first_epoch: int = 1,
    directions: _Directions | None = None,
    sites: int | Literal["vertices"] = 7000,
    smooth: float | None = None,
    mirror: bool = True,
    turn: Literal["none", "quarter", "any"] = "quarter",
    sides: float = 0.3,
    tilt: float = 0.1,
    size_mm: tuple[float, float] | None = None,
) -> Online: ...

@final
class Online:
    def __iter__(self) -> Online: ...
    def __next__(self) -> Sample: ...

@final
class Sample:
    def __new__(
        cls,
        points: ArrayLike,
        normals: ArrayLike,
        cutter: Tool | str | ArrayLike,
        inaccessible: ArrayLike,
        occlusion: ArrayLike,
        *,
        name: str = "part",
    ) -> Sample: ...
    def __len__(self) -> int: ...
    @property
    def name(self) -> str: ...
    @property
    def epoch(self) -> int: ...
    @property
    def index(self) -> int: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def cutter_mm(self) -> NDArray[np.float64]: ...
    @property
    def inaccessible(self) -> NDArray[np.bool_]: ...
    @property
    def occlusion(self) -> NDArray[np.bool_]: ...
    @property
    def accessible_share(self) -> NDArray[np.float32] | None: ...

@final
class Trainer:
    def __new__(
        cls,
        samples: Iterable[Sample],
        validation: Iterable[Sample] = (),
        *,
        preset: Literal["paper", "reference", "small", "tiny"] = "small",
        settings: dict[str, Any] | None = None,
        definition: Literal["mesh", "published"] | None = None,
    ) -> Trainer: ...
    @staticmethod
    def resume(path: _Path, samples: Iterable[Sample], validation: Iterable[Sample] = ()) -> Trainer: ...
    def save(self, path: _Path) -> Path: ...
    def step(self) -> dict[str, Any] | None: ...
    def train(self, progress: Callable[[dict[str, Any]], bool | None] | None = None) -> bool: ...
    @property
    def is_finished(self) -> bool: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def history(self) -> list[dict[str, Any]]: ...
    @property
    def network(self) -> Network: ...

@final
class Octree:
    def __new__(
        cls, clouds: Iterable[Sites | tuple[ArrayLike, ArrayLike]], *, depth: int = 5, full_depth: int = 2,
    ) -> Octree: ...
    @property
    def depth(self) -> int: ...
    @property
    def points(self) -> NDArray[np.float32]: ...
    @property
    def node_of_point(self) -> NDArray[np.uint32]: ...
    @property
    def point_ranges(self) -> list[tuple[int, int]]: ...
    @property
    def scales(self) -> NDArray[np.float64]: ...
    def __getitem__(self, depth: int, /) -> OctreeLevel: ...
    def __len__(self) -> int: ...

@final
class OctreeLevel:
    @property
    def keys(self) -> NDArray[np.uint64]: ...
    @property
    def children(self) -> NDArray[np.int32]: ...
    @property
    def neighbors(self) -> NDArray[np.int32]: ...
    @property
    def nonempty(self) -> NDArray[np.uint32]: ...
    @property
    def ranges(self) -> list[tuple[int, int]]: ...
    def __len__(self) -> int: ...
