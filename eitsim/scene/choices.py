"""Kinds of what a plan decides, and of why a scene cannot be solved; a result's file holds the first next to the words.
"""

from enum import StrEnum

Kind = StrEnum("Kind", (
    # where a touch comes from, and its neighbours; how it is solved is the kind of its route
    "STORED", "FROM_REST", "ALONE",
    # the punch: what it conducts, its contact
    "INSULATED", "FLOATING", "END_BY_NEIGHBOUR", "END_BY_EDGE", "NO_FRICTION", "FRICTION",
    "RIGID_PUNCH",
    # time
    "HOLD_KEPT", "HOLD_STEPPED", "HOLD_ELASTIC", "LOADED_AT_ONCE", "LOADED_OVER", "ONE_RELAXATION", "NO_MEMORY",
    "NO_VISCOELASTICITY",
    # laws
    "OUTSIDE_FITS", "POSITIVE_IN_PART", "STRAIN", "ONE_CARD", "DRAWN_CARDS",
    # skin and electrodes
    "FIXED_CHOICES", "NO_LOAD_IN_SKIN", "SHEET", "LAYER", "LAYER_BASE", "LAYER_TOUCH", "LAYER_ELECTRODES",
    "STIFF_ELECTRODES", "SOFT_ELECTRODES", "YIELDING_ELECTRODES", "MESH",
    "RINGS", "UNTOUCHED_TRIANGLES", "PATCH_AREA", "EVEN_SHEET", "SHEET_CONDUCTANCE", "SCATTER", "CHANNELS", "MISSING",
    "ONE_MATRIX",
    # exact runs
    "FINER_MESH", "EXACT_SKIN"))

Why = StrEnum("Why", (
    "CONDUCTIVITY_UNIT", "TOO_THIN", "TOO_SHALLOW", "TOO_LIGHT", "ELECTRODES", "TOO_DEEP",
    # of routes
    "OFF_SKIN", "NOT_MEANT",
    # of neighbours
    "OVERLAP", "MORE_THAN_TWO", "PAIR_FRICTION", "PAIR_GAP",
    # of what is solved in three dimensions, and on curved bodies
    "TOUCHING", "UNFIT",
    # of layers that conduct in their volume
    "LAYER_EDGE", "LAYER_TILT", "LAYER_TOGETHER"))
