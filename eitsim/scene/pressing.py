"""How a skin is pressed and read: punch, coating, time and accuracy."""

import math
from dataclasses import dataclass

from eitsim.scene.scene_limits import plain, require

FRICTIONS = ("none", "stick", "coulomb")
STRAINS = ("normal", "principal", "areal")
# What a layer's conductivity follows in its volume, and the kinds of skins.
LAYER_STRAINS = ("principal", "volume", "piezoresistive")
SKINS = ("coating", "layer")
CONTROLS = ("force", "depth")
MODULI = ("card", "instantaneous", "longterm")


@dataclass(frozen=True)
class Punch:
    """Rigid punch pressed along -z."""

    # axis in the plane of the disc, m
    x_m: float = 0.0
    y_m: float = 0.0
    diameter_m: float = 0.014  # diameter, fillet included, m
    force_N: float | None = None  # applied force, N; 1 N unless it or the depth is given, None where the depth is given
    depth_m: float | None = None  # prescribed depth, m; None where the force is given
    profile: str = "flat"  # word of its profile
    # radius that rounds the edge, and a cone's tip; of an ellipse, its radius of curvature at the edge; m
    fillet_m: float = 0.0005
    # angle between a cone's axis and its face, rad; without effect on the other profiles
    half_angle_rad: float = math.radians(60)
    # angle, rad, between its axis, along which it is pressed, and the skin's normal; and the direction from the x axis
    # to which the axis leans, on whose side the edge stands lowest
    tilt_rad: float = 0.0
    tilt_direction_rad: float = 0.0
    # file of a closed surface of triangles, mm, whose axis is z through its origin; profile, diameter and fillet are
    # then about it, for the mesh and the start; empty: the profile is the punch
    shape: str = ""
    friction: str = "none"  # one of FRICTIONS
    friction_coefficient: float = 0.0  # shear over pressure that it slips at; 0 unless by Coulomb's law
    conductor: bool = False  # whether the punch conducts and floats
    contact_impedance_Ohm_m2: float = 1e-4  # contact impedance of a conducting punch, Ohm m^2

    def __post_init__(self) -> None:
        plain(self)
        if self.force_N is None and self.depth_m is None:
            object.__setattr__(self, "force_N", 1.0)

    @property
    def axisymmetric(self) -> bool:
        """Whether it is a body of revolution that stands upright."""
        return self.tilt_rad == 0 and not self.shape


@dataclass(frozen=True)
class Skin:
    """Conductive coating of the top surface, or a layer that conducts in its volume."""

    thickness_m: float = 20e-6  # of the coating or the layer, m
    strain: str = "principal"  # what drives its conductivity, one of STRAINS, of a layer one of LAYER_STRAINS
    # "coating", a sheet on foam; or "layer", which conducts in its volume and is itself the body, on a rigid plate:
    # the body's thickness is then this one, and that of its base
    kind: str = "coating"
    # change of the logarithm of a piezoresistive layer's resistivity by logarithmic strain along the current and across
    along: float = 0.0
    across: float = 0.0
    # a layer's soft base, which does not conduct, between it and the rigid plate: thickness, m, and the file of its
    # card; 0 and empty: none
    base_m: float = 0.0
    base_card: str = ""

    @property
    def fills(self) -> bool:
        """Whether it conducts in its volume."""
        return self.kind == "layer"

    @property
    def surface_strain(self) -> str:
        """The strain, one of STRAINS, by which tabulated effects on dV count; of a layer the one that edges change
        most."""
        return "areal" if self.fills else self.strain


def check_skin(skin: Skin) -> None:
    """ValueError where a skin's strain is none of its kind, or a coefficient has no effect."""
    known = LAYER_STRAINS if skin.fills else STRAINS
    require(skin.strain in known, "strain in [skin]", f"of a {skin.kind} must be one of {', '.join(known)}",
            f"'{skin.strain}'")
    for name in ("along", "across"):
        require(skin.strain == "piezoresistive" or getattr(skin, name) == 0, f"{name} in [skin]",
                'has no effect without strain = "piezoresistive", which layers have; leave it out', getattr(skin, name))
    for key, own in (("base_thickness_mm", 1e3 * skin.base_m), ("base_card", skin.base_card)):
        require(skin.fills or not own, f"{key} in [skin]", 'has no effect without kind = "layer"; leave it out', own)
    if skin.base_m or skin.base_card:
        require(skin.base_m > 0, "base_thickness_mm in [skin]", "must be positive with base_card: a soft base has a "
                "thickness and a card of its own", f"{1e3 * skin.base_m:g}")
        require(bool(skin.base_card), "base_card in [skin]", "must name the card of the base with base_thickness_mm: a "
                "soft base has a thickness and a card of its own", "none")


@dataclass(frozen=True)
class Hold:
    """How long the touch lasts."""

    time_s: tuple[float, ...] = ()  # times after loading at which it is read, s; empty: none
    control: str = "force"  # one of CONTROLS
    loading_s: float = 0.0  # time that loading takes at a constant rate of force or depth, s; 0: loaded at once
    # one of MODULI: as the card labels them, or scaled by its Prony series; a hold begins with instantaneous ones
    moduli: str = "card"

    @property
    def keeps_deformation(self) -> bool:
        """Whether the foam stays as it was loaded: at a depth kept from loading at once only stresses relax."""
        return self.control == "depth" and self.loading_s == 0


@dataclass(frozen=True)
class Accuracy:
    """The relative error that a scene's numbers may have."""

    signal: float = 0.01  # requested relative error of the touch signal dV, mechanics and electrics together


def check_punch(punch: Punch, thickness_m: float) -> None:
    """ValueError where a punch cannot be on foam of a thickness, m."""
    if punch.force_N is not None and punch.depth_m is not None:
        raise ValueError("[punch] has both force_N and depth_mm; give one of them.")
    if punch.force_N is not None:
        require(punch.force_N > 0, "force_N in [punch]", "must be positive (N, pressing into the layer)", punch.force_N)
    if punch.depth_m is not None:
        require(0 < punch.depth_m < thickness_m, "depth_mm in [punch]",
                 "must lie between 0 and the layer's thickness", punch.depth_m * 1e3)
    require(punch.diameter_m > 0, "diameter_mm in [punch]", "must be positive", punch.diameter_m * 1e3)
    require(0 < punch.fillet_m <= punch.diameter_m / 2, "fillet_mm in [punch]",
             "(0.5 unless given) must be positive (a sharp edge has no finite peak stress) and at most half of "
             f"diameter_mm = {punch.diameter_m * 1e3:g}", punch.fillet_m * 1e3)
    require(0 < punch.half_angle_rad < math.pi / 2, "half_angle_deg in [punch]",
             "(from the axis to the face of a cone) must lie between 0 and 90", math.degrees(punch.half_angle_rad))
    if punch.tilt_rad and punch.friction != "none":
        raise ValueError("friction in [punch] is built for upright punches; leave it out where tilt_deg is not 0.")
    if punch.tilt_rad and punch.conductor:
        raise ValueError("conductor in [punch] is built for upright punches; leave it out where tilt_deg is not 0.")
    for key, given in (("friction", punch.friction != "none"), ("conductor", punch.conductor)):
        if punch.shape and given:
            raise ValueError(f"{key} in [punch] is built for punches with a profile; leave it out where shape names a "
                             "file.")
    by_coulomb = punch.friction == "coulomb"
    require(punch.friction_coefficient > 0 or not by_coulomb, "friction_coefficient in [punch]",
             "must be positive with friction = \"coulomb\"", punch.friction_coefficient)
    require(punch.friction_coefficient == 0 or by_coulomb, "friction_coefficient in [punch]",
             f"has no effect with friction = \"{punch.friction}\"; leave it out, or ask for \"coulomb\"",
             punch.friction_coefficient)
