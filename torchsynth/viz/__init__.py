"""Pictures of what a synthesis did, and of how it came about.

Each is a tensor ``(B, 3, H, W)`` with values in [0, 1], to be looked at or written like any other; an animation is
recorded while the synthesis goes on, and is a file. Drawings with words or scales of color (``draw_cost``,
``draw_coverage``, ``draw_tree``, ``sheet`` and ``draw_sheet``) need matplotlib, the extra ``viz``; the others
do not.
"""

from torchsynth.viz.animation import Recorder, check_animation, encode_animation
from torchsynth.viz.coverage import copies, draw_coverage
from torchsynth.viz.kinds import KINDS, OF_OUTPUT_SIZE, check_drawable, draw
from torchsynth.viz.lettering import check_matplotlib
from torchsynth.viz.maps import draw_cost, draw_field, draw_patches, draw_sources
from torchsynth.viz.sheet import draw_sheet, sheet
from torchsynth.viz.strip import draw_pyramid
from torchsynth.viz.tree import draw_tree, left_to_right

__all__ = [
    "KINDS",
    "OF_OUTPUT_SIZE",
    "Recorder",
    "check_animation",
    "check_drawable",
    "check_matplotlib",
    "copies",
    "draw",
    "draw_cost",
    "draw_coverage",
    "draw_field",
    "draw_patches",
    "draw_pyramid",
    "draw_sheet",
    "draw_sources",
    "draw_tree",
    "encode_animation",
    "left_to_right",
    "sheet",
]
