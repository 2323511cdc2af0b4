"""Kinds of what a plan decides, and of why a scene cannot be solved."""

from enum import StrEnum, auto


class Kind(StrEnum):
    """What a plan decides; a result's file holds it next to the words."""

    # routes
    AXISYMMETRIC = auto()
    NEAREST_EDGE = auto()
    ALL_EDGES = auto()
    WHOLE_DISC = auto()
    # where a touch comes from
    STORED = auto()
    FROM_REST = auto()
    # neighbours
    PAIR = auto()
    ALONE = auto()
    # the conducting punch
    INSULATED = auto()
    FLOATING = auto()
    END_BY_NEIGHBOUR = auto()
    END_BY_EDGE = auto()
    # time
    HOLD_KEPT = auto()
    HOLD_STEPPED = auto()
    LOADED_AT_ONCE = auto()
    LOADED_OVER = auto()
    ONE_RELAXATION = auto()
    NO_MEMORY = auto()
    NO_VISCOELASTICITY = auto()
    # the laws
    OUTSIDE_FITS = auto()
    POSITIVE_IN_PART = auto()
    STRAIN = auto()
    ONE_CARD = auto()
    DRAWN_CARDS = auto()
    # contact
    NO_FRICTION = auto()
    FRICTION = auto()
    RIGID_PUNCH = auto()
    SOFT_ELECTRODES = auto()
    # skin and electrodes
    FIXED_CHOICES = auto()
    NO_LOAD_IN_SKIN = auto()
    SHEET = auto()
    MESH = auto()
    RINGS = auto()
    UNTOUCHED_TRIANGLES = auto()
    PATCH_AREA = auto()
    EVEN_SHEET = auto()
    SHEET_CONDUCTANCE = auto()
    SCATTER = auto()
    CHANNELS = auto()
    MISSING = auto()
    ONE_MATRIX = auto()
    # exact runs
    FINER_MESH = auto()
    EXACT_SKIN = auto()


class Why(StrEnum):
    """Why a scene cannot be solved."""

    CONDUCTIVITY_UNIT = auto()
    TOO_THIN = auto()
    TOO_SHALLOW = auto()
    TOO_LIGHT = auto()
    ELECTRODES = auto()
    TOO_DEEP = auto()
    ON_ELECTRODES = auto()
    FRICTION_CREEPS = auto()
    # of routes
    OFF_SKIN = auto()
    SLIPS = auto()
    CREEPS = auto()
    NOT_THIS_BODY = auto()
    # of neighbours
    OVERLAP = auto()
    HELD_TOGETHER = auto()
    MORE_THAN_TWO = auto()
    PAIR_FRICTION = auto()
    PAIR_GAP = auto()
