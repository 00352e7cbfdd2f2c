"""Which parts of a surface a milling cutter cannot reach, and what is in its way.

Lengths are millimeters, directions and normals unit vectors, arrays in the order of the sites.

>>> import deepmill
>>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
>>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
>>> outcome = deepmill.analyze(mesh, ["3,20,20,20", "1.5,12,20,20"], sites=500)
>>> [answers.tool.name for answers in outcome]
['3-20-20-20', '1.5-12-20-20']
"""

from ._deepmill import *  # noqa: F403
from ._deepmill import __all__ as _names
from ._deepmill import __version__

__all__ = [name for name in _names if not name.startswith("_")] + ["__version__"]
